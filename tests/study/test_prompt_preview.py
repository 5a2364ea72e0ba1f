"""`armwright optimize --print-prompt` prints exactly the prompts that are sent."""

import json
import threading
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import ArmwrightError, RunConflictError
from armwright.llm.prompt_values import VARIABLES
from armwright.llm.transcript import Call, Transcript
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposer
from armwright.study.progress import Progress, StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE, armwright
from tests.support.fixed_problem import SIX_AXIS
from tests.support.wire_formats import llm_proposer, model_options

PROBLEM = Problem(load_task("target-1"))
OWN = '{% extends "proposal.md.j2" %}{% block role %}Only {{ n_finished }} designs so far.{% endblock %}'


def shown(*args: str, what: str | int = "next") -> tuple[str, str]:
    """What the command prints for a program, and for a person."""
    result = CliRunner().invoke(app, ["optimize", "--print-prompt", str(what), *args])
    if isinstance(result.exception, ArmwrightError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout, result.stderr


def run(
    out: Path,
    n_total: int,
    proposer: str | Proposer,
    problem: Problem = PROBLEM,
    in_flight: int | None = None,
) -> StudyResult:
    return optimize(
        problem,
        proposer=proposer,
        n_init=4,
        n_step=3,
        n_total=n_total,
        seed=5,
        out=out,
        in_flight=in_flight,
        verify=False,
    )


def asked(out: Path) -> list[Call]:
    return [call for call in Transcript(out / "transcripts.jsonl").calls if call.step in ("reasoning", "answer")]


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"prompt": "minus", "memory": "own"},
        {"answer": "one-step", "memory": "own"},
        {"prompt": "file"},
        {"memory": "chat"},
    ],
    ids=["plus", "minus-own", "one-step", "file", "chat"],
)
def test_printed_prompt_is_the_prompt_sent(chat_server: ChatServer, in_folder: Path, how: dict[str, Any]) -> None:
    out = in_folder / "run"
    if how.get("prompt") == "file":
        (in_folder / "own.md").write_text(OWN, encoding="utf-8")
        how = {"prompt": str(in_folder / "own.md")}
    run(out, 3, llm_proposer(chat_server.url, **how))
    (in_folder / "own.md").unlink(missing_ok=True)  # the run has it
    before, words = shown("run")
    assert words.startswith("about ")
    assert words.endswith("tokens; for trial 7\n")
    if (in_folder / "run" / "config.yaml").read_text(encoding="utf-8").count("template:"):
        (in_folder / "own.md").write_text(OWN, encoding="utf-8")
        assert before.startswith("Only 7 designs so far.")
    run(out, 4, llm_proposer(chat_server.url, **how))
    first, second = asked(out)
    assert before == second.prompt
    assert shown("run", what=7)[0] == second.prompt
    assert shown("run", what=4)[0] == first.prompt
    sent = [request["messages"][-1]["content"] for request in chat_server.requests]
    assert before in sent
    schemas = [request["response_format"] for request in chat_server.requests if "response_format" in request]
    printed = json.loads(shown("run", what="schema")[0])
    assert printed["properties"] == schemas[-1]["json_schema"]["schema"]["properties"]


def test_options_override_those_of_the_run(chat_server: ChatServer, in_folder: Path) -> None:
    run(in_folder / "run", 3, llm_proposer(chat_server.url, prompt="minus", memory="own"))
    told = shown("run")[0]
    assert "Step 1" not in told
    assert "Your earlier proposals" in told
    told = shown("run", "--prompt", "plus", "--memory", "none", *model_options(proposals=2))[0]
    assert "Step 1" in told
    assert "Your earlier proposals" not in told
    assert "2 new designs" in told


def test_prompt_of_a_new_run(chat_server: ChatServer, in_folder: Path) -> None:
    before = shown("target-1", "--n-init", "4", "--seed", "5", "--prompt", "minus")[0]
    run(in_folder / "run", 1, llm_proposer(chat_server.url, prompt="minus"))
    assert [call.prompt for call in asked(in_folder / "run")] == [before]


def test_prompt_after_a_run_without_a_model(in_folder: Path) -> None:
    run(in_folder / "run", 3, "none", Problem(load_task("target-2"), SIX_AXIS))
    told = shown("run")[0]
    assert "D = 6" in told
    assert shown("run", what=7)[0] == told
    assert shown("run", what=4)[0] != told


def test_preview_counts_trials_still_to_come(chat_server: ChatServer, in_folder: Path) -> None:
    run(in_folder / "run", 2, llm_proposer(chat_server.url))
    assert shown("run")[1].endswith("for trial 7; 1 trial comes before it, and will be in it\n")
    designs = [json.loads(json.dumps(dict(design.params))) for design in PROBLEM.space.sample(3, 1)]
    chat_server.answer = lambda request: json.dumps({"designs": designs}) if "response_format" in request else "so"
    run(in_folder / "many", 3, llm_proposer(chat_server.url, proposals=3))
    assert shown("many")[1].endswith(
        "for trial 13; 6 trials come before it, 2 of them of the calls so far, and will be in it\n"
    )
    run(in_folder / "many", 10, llm_proposer(chat_server.url, proposals=3))
    assert [call.proposal for call in asked(in_folder / "many")] == ["llm-0004", "llm-0013"]


def test_past_prompts_of_an_overlapped_run(chat_server: ChatServer, in_folder: Path) -> None:
    run(in_folder / "run", 7, llm_proposer(chat_server.url), in_flight=2)
    calls = asked(in_folder / "run")
    assert len(calls) == 3
    for call in calls:
        number = call.proposal.rpartition("-")[2]
        assert shown("run", what=number)[0] == call.prompt


def interrupted(out: Path, stop: int, server: ChatServer, in_flight: int | None) -> None:
    def interrupt(progress: Progress) -> None:
        if progress.doing == "finished" and progress.number == stop:
            raise KeyboardInterrupt

    proposer = llm_proposer(server.url)
    with pytest.raises(KeyboardInterrupt):
        optimize(PROBLEM, proposer=proposer, n_init=4, n_step=3, n_total=9, seed=5, out=out, in_flight=in_flight,
                 watch=interrupt)  # fmt: skip


def test_prompt_after_an_interrupt_is_the_next_one_sent(chat_server: ChatServer, in_folder: Path) -> None:
    """Two calls were in flight, for trials 4 and 7; neither was answered."""
    answered = threading.Event()

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) > 1:
            answered.wait(PATIENCE)
        return designer(request)

    chat_server.answer = answer
    interrupted(in_folder / "run", 5, chat_server, 2)
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
    for name, lines in (("trials.jsonl", 4), ("transcripts.jsonl", 2)):  # as a kill after the first answer leaves it
        file = in_folder / "run" / name
        file.write_text("".join(file.read_text(encoding="utf-8").splitlines(keepends=True)[:lines]), encoding="utf-8")
    told, words = shown("run")
    assert words.endswith("tokens; for trial 4\n")
    run(in_folder / "run", 1, llm_proposer(chat_server.url), in_flight=in_flight)
    calls = Transcript(in_folder / "run" / "transcripts.jsonl").calls
    assert told == next(call.prompt for call in calls if (call.proposal, call.step) == ("llm-0004", "parameters"))
    assert shown("run", what=4)[0] == asked(in_folder / "run")[0].prompt


def test_template_variables_are_listed() -> None:
    assert [line.partition(":")[0] for line in shown("target-1", what="variables")[0].splitlines()] == list(VARIABLES)


@pytest.mark.parametrize("name", ["plus", "minus"])
@pytest.mark.slow
def test_copied_template_gives_the_same_prompt(in_folder: Path, name: str) -> None:
    whole = shown("target-1", "--prompt", name, what="template")[0]
    (in_folder / "own.md").write_text(whole, encoding="utf-8")
    assert shown("target-1", "--prompt", "own.md")[0] == shown("target-1", "--prompt", name)[0]
    assert shown("target-1", "--prompt", "own.md", what="template")[0] == whole


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
        (["target-1", "--print-prompt", "4"], "--print-prompt 4: expected a run folder, got target-1"),
        (["target-1", "--print-prompt", "al"], '--print-prompt "al": expected next, schema, template, variables, or'),
        (["target-1", "--prompt", "pluss"], 'unknown prompt "pluss". Did you mean "plus"?'),
        (["target-1", "--prompt", "."], "prompt . is a folder, not a template file"),
        (["target-1", *model_options(memory="onw")], 'unknown memory "onw". Did you mean "own"?'),
        (["target-1", *model_options(answer="two")], 'unknown answer "two"'),
        (["target-1", *model_options(proposals=0)], "proposals: expected a number of at least 1, got 0"),
        (["run", "--space", "space.yaml"], "run is a run of another space: paper"),
        (["run", "--print-prompt", "5"], "trial 5: the proposals of run were requested for trials 4"),
        (["run", *model_options(memory="all")], 'unknown memory "all"'),
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


def test_template_error_is_one_line_on_stderr(in_folder: Path) -> None:
    (in_folder / "own.md").write_text("{{ ''.__class__ }}", encoding="utf-8")
    done = armwright("optimize", "target-1", "--print-prompt", "next", "--prompt", "own.md")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("armwright: prompt own.md, line 1 cannot be rendered: access to attribute")
    assert done.stderr.count("\n") == 1


def test_changed_template_is_refused_in_one_line(chat_server: ChatServer, in_folder: Path) -> None:
    own = in_folder / "own.md"
    for text in (OWN, OWN.replace("Only", "\n".join("Just"))):
        own.write_text(text, encoding="utf-8")
        if text == OWN:
            run(in_folder / "run", 1, llm_proposer(chat_server.url, prompt=str(own)))
    with pytest.raises(RunConflictError, match=r"proposer\.template: .* stored, .* requested") as refusal:
        run(in_folder / "run", 1, llm_proposer(chat_server.url, prompt=str(own)))
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400
