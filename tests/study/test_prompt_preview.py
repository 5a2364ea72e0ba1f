"""`armwright optimize --print-prompt` prints exactly the prompts that are sent."""

import json
import threading
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from armwright import Problem, Proposer, StudyResult, load_task, optimize
from armwright.cli.app import app
from armwright.exceptions import ArmwrightError
from armwright.llm.transcript import Call, Transcript
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE
from tests.support.controlled_runs import after, cut, interrupt
from tests.support.fixed_problem import SIX_AXIS
from tests.support.wire_formats import llm_proposer, model_options

PROBLEM = Problem(load_task("target-1"))


def shown(*args: str, what: str = "next") -> tuple[str, str]:
    """What the command prints for a program, and for a person."""
    result = CliRunner().invoke(app, ["optimize", "--print-prompt", what, *args])
    if isinstance(result.exception, ArmwrightError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout, result.stderr


def run(out: Path, n_total: int, proposer: str | Proposer, problem: Problem = PROBLEM, **more: Any) -> StudyResult:
    asked = {"n_init": 4, "n_step": 3, "n_total": n_total, "seed": 5, "out": out, "verify": False, **more}
    return optimize(problem, proposer=proposer, **asked)


def asked(out: Path) -> list[Call]:
    return [call for call in Transcript(out / "transcripts.jsonl").calls if call.step in ("reasoning", "answer")]


@pytest.mark.parametrize("how", [{}, {"prompt": "minus", "answer": "one-step"}, {"memory": "chat"}])
def test_printed_prompt_is_the_prompt_sent(chat_server: ChatServer, in_folder: Path, how: dict[str, Any]) -> None:
    out = in_folder / "run"
    run(out, 3, llm_proposer(chat_server.url, **how))
    before, words = shown("run")
    assert words.startswith("about ")
    assert words.endswith("tokens; for trial 7\n")
    run(out, 4, llm_proposer(chat_server.url, **how))
    assert before == asked(out)[1].prompt
    sent = [request["messages"][-1]["content"] for request in chat_server.requests]
    assert before in sent
    schemas = [request["response_format"] for request in chat_server.requests if "response_format" in request]
    printed = json.loads(shown("run", what="schema")[0])
    assert printed["properties"] == schemas[-1]["json_schema"]["schema"]["properties"]


def test_options_override_those_of_the_run(chat_server: ChatServer, in_folder: Path) -> None:
    run(in_folder / "run", 3, llm_proposer(chat_server.url, prompt="minus"))
    told = shown("run")[0]
    assert "Step 1" not in told
    assert "`reasoning`" not in told
    told = shown("run", "--prompt", "plus", *model_options(answer="one-step"))[0]
    assert "Step 1" in told
    assert "`reasoning`" in told


def test_prompt_of_a_new_run(chat_server: ChatServer, in_folder: Path) -> None:
    before = shown("target-1", "--n-init", "4", "--seed", "5", "--prompt", "minus")[0]
    run(in_folder / "run", 1, llm_proposer(chat_server.url, prompt="minus"))
    assert [call.prompt for call in asked(in_folder / "run")] == [before]


def test_prompt_after_a_run_without_a_model(in_folder: Path) -> None:
    run(in_folder / "run", 3, "none", Problem(load_task("target-2"), SIX_AXIS))
    assert "D = 6" in shown("run")[0]


def test_prompt_after_an_interrupt_is_the_next_one_sent(chat_server: ChatServer, in_folder: Path) -> None:
    """Two calls were in flight, for trials 4 and 7; neither was answered."""
    answered = threading.Event()

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) > 1:
            answered.wait(PATIENCE)
        return designer(request)

    chat_server.answer = answer
    with pytest.raises(KeyboardInterrupt):
        run(in_folder / "run", 9, llm_proposer(chat_server.url), in_flight=2, watch=after(5, interrupt))
    answered.set()
    told, words = shown("run")
    assert words.endswith("tokens; for trial 4\n")
    run(in_folder / "run", 9, llm_proposer(chat_server.url), in_flight=2)
    assert told == next(call.prompt for call in asked(in_folder / "run") if call.proposal == "llm-0004")


@pytest.mark.parametrize("in_flight", [None, 1])
def test_prompt_after_the_reasoning_requests_the_parameters(
    chat_server: ChatServer, in_folder: Path, in_flight: int | None
) -> None:
    run(in_folder / "run", 1, llm_proposer(chat_server.url), in_flight=in_flight)
    cut(in_folder / "run", trials=4, transcripts=2)  # as a kill after the first answer leaves it
    told, words = shown("run")
    assert words.endswith("tokens; for trial 4\n")
    run(in_folder / "run", 1, llm_proposer(chat_server.url), in_flight=in_flight)
    calls = Transcript(in_folder / "run" / "transcripts.jsonl").calls
    assert told == next(call.prompt for call in calls if (call.proposal, call.step) == ("llm-0004", "parameters"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that holds a finished run and a space file."""
    folder = tmp_path_factory.mktemp("finished")
    run(folder / "run", 1, "none")
    (folder / "space.yaml").write_text("name: mine\njoints: 5\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["target-9"], 'unknown task "target-9"'),
        (["target-1", "--print-prompt", "al"], '--print-prompt "al": expected next or schema'),
        (["run", "--space", "space.yaml"], "--space space.yaml is for a new run; run has its own"),
        (["run", *model_options(memory="all")], 'memory: expected none or chat, got "all"'),
    ],
)
def test_invalid_arguments_are_refused(
    finished: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], message: str
) -> None:
    monkeypatch.chdir(finished)
    with pytest.raises(ArmwrightError) as refusal:
        shown(*args)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
