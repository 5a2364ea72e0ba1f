"""The fallback of `output: auto`, against servers that refuse tools or JSON schemas."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ModelError
from armwright.llm import client as chat
from armwright.llm.backend import Question
from armwright.llm.transcript import Transcript
from armwright.problem.problem import Problem
from armwright.proposers.replay import ReplayProposer
from armwright.study.progress import Progress, StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.model_faults import FAULTS, anthropic_error, openai_error
from tests.support.wire_formats import llm_proposer, proposer

PROBLEM = Problem(load_task("target-1"))
STRUCTURED = ("tools", "response_format", "output_config")  # the parts of a request that ask for structured output

# As servers put it.
REFUSALS: dict[str, Answer] = {
    "ollama": openai_error(400, "registry.ollama.ai/library/m does not support tools", "api_error"),
    "no reason": (422, "{}"),
    "openrouter": openai_error(404, "No endpoints found that support tool use.", "not_found"),
    "llama-server": openai_error(500, "tools param requires --jinja flag", "server_error"),
    "either protocol": {
        "openai": openai_error(400, "Unrecognized request argument supplied: tools", "invalid_request_error"),
        "anthropic": anthropic_error(400, "tools: Extra inputs are not permitted", "invalid_request_error"),
    },
}


@pytest.fixture(autouse=True)
def _no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chat, "RETRY_SECONDS", 0.0)


def refusing(*parts: str, with_: Answer = REFUSALS["either protocol"]) -> Callable[[Request], Answer]:
    """Answer with an error if a request has one of these parts."""
    return lambda request: with_ if request.keys() & set(parts) else designer(request)


def run(asked: Any, out: Path | None, n_total: int = 4, seen: list[Progress] | None = None) -> StudyResult:
    watch = None if seen is None else seen.append
    return optimize(PROBLEM, proposer=asked, n_init=4, n_step=3, n_total=n_total, out=out, watch=watch, verify=False)


@pytest.mark.parametrize("refusal", REFUSALS)
def test_plain_server_gets_the_schema_in_the_prompt(chat_server: ChatServer, tmp_path: Path, refusal: str) -> None:
    chat_server.answer = refusing(*STRUCTURED, with_=REFUSALS[refusal])
    seen: list[Progress] = []
    result = run(llm_proposer(chat_server.url), tmp_path / "run", seen=seen)
    assert [trial.source for trial in result.trials[4:]] == ["llm", "bbo", "bbo", "llm"]
    told = [progress.note for progress in seen if "refuses output" in progress.note]
    assert told == ["test-model refuses output native and tool; this run uses output prompted"]
    accepted = [request for request in chat_server.requests if not request.keys() & set(STRUCTURED)]
    assert len(accepted) == 1 + 2 * 2  # the check, two for each proposal: nothing else was refused
    assert chat_server.requests[-4:] == accepted[-4:]
    calls = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    assert [(call.step, call.fault, call.output_mode) for call in calls] == [
        ("check", None, "prompted"),
        *[("reasoning", None, ""), ("parameters", None, "prompted")] * 2,
    ]
    assert result.summary["proposer"]["output_mode"] == "prompted"
    assert result.summary["proposer"]["call_failures"] == {}


@pytest.mark.parametrize(
    ("wire", "refused", "used"),
    [
        ("own server", "response_format", "tool"),
        ("openai", "tools", "native"),
        ("anthropic", "tools", "native"),
        ("anthropic", "x", "tool"),
        ("own server", "x", "native"),
    ],
)
def test_first_accepted_mode_is_used(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, wire: str, refused: str, used: str
) -> None:
    chat_server.answer = refusing(refused)
    result = run(proposer(wire, chat_server, monkeypatch), None, n_total=1)
    assert result.trials[4].source == "llm"
    assert result.summary["proposer"]["output_mode"] == used


def test_resumed_run_keeps_its_mode(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = refusing(*STRUCTURED)
    run(llm_proposer(chat_server.url), tmp_path / "run", n_total=1)
    chat_server.requests.clear()
    chat_server.answer = designer  # updated meanwhile
    seen: list[Progress] = []
    again = run(llm_proposer(chat_server.url), tmp_path / "run", seen=seen)
    assert again.trials[7].source == "llm"
    assert not any(request.keys() & set(STRUCTURED) for request in chat_server.requests)
    assert not any("refuses output" in progress.note for progress in seen)


def test_replay_states_the_recorded_mode(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = refusing(*STRUCTURED)
    first = run(llm_proposer(chat_server.url), tmp_path / "run")
    again = run(ReplayProposer(tmp_path / "run", strict=True), None)
    assert [trial.values for trial in again.trials] == [trial.values for trial in first.trials]
    assert again.summary["proposer"]["output_mode"] == "prompted"


@pytest.mark.parametrize("output", ["tool", "native"])
def test_refused_mode_of_the_user_is_an_error(chat_server: ChatServer, tmp_path: Path, output: str) -> None:
    chat_server.answer = refusing(*STRUCTURED)
    with pytest.raises(ModelError, match="Unrecognized request argument supplied: tools"):
        run(llm_proposer(chat_server.url, output=output), tmp_path / "run")
    assert len(chat_server.requests) == 1


@pytest.mark.parametrize("name", ["wrong key", "quota gone", "unknown model", "context too long", "refusal"])
@pytest.mark.parametrize("wire", ["openai", "anthropic"])
def test_other_faults_are_not_refusals(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, wire: str, name: str
) -> None:
    kind = next(kind for kind, faults in FAULTS.items() if name in faults)
    chat_server.answer = lambda request: FAULTS[kind][name]
    with pytest.raises(ModelError):
        run(proposer(wire, chat_server, monkeypatch), None)
    assert len(chat_server.requests) == 1


def test_server_that_refuses_everything_is_an_error_with_its_reason(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = lambda request: FAULTS["rejected"]["rejected"]
    with pytest.raises(ModelError, match="Unsupported value: 'temperature'"):
        run(llm_proposer(chat_server.url, temperature=0.0), tmp_path / "run")
    assert [call.fault for call in Transcript(tmp_path / "run" / "transcripts.jsonl").calls] == ["rejected"]


def test_question_without_a_check_finds_the_mode_once(chat_server: ChatServer) -> None:
    """As of drafts and of Optuna studies."""
    chat_server.answer = refusing(*STRUCTURED)
    asked = llm_proposer(chat_server.url)
    for number in (4, 7):
        reply = asked.backend.ask(Question(f"llm-{number:04d}", "answer", "Which?"), asked.output_format(PROBLEM))
        assert (reply.output_mode, reply.requests) == ("prompted", 1)
    assert len(chat_server.requests) == 3 + 1
