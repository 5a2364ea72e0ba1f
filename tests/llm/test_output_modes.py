"""The fallback of `output: auto`, against servers that refuse or ignore tools or JSON schemas."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ModelError
from armwright.llm.backend import AskOptions, CallError, Question
from armwright.llm.transcript import Transcript
from armwright.study.progress import Progress, StudyResult
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer, is_check
from tests.support.controlled_runs import PROBLEM
from tests.support.controlled_runs import run as short_run
from tests.support.model_faults import FAULTS, anthropic_error, openai_error
from tests.support.wire_formats import llm_proposer, proposer

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


def refusing(*parts: str, with_: Answer = REFUSALS["either protocol"]) -> Callable[[Request], Answer]:
    """Answer with an error if a request has one of these parts."""
    return lambda request: with_ if request.keys() & set(parts) else designer(request)


def ignoring(*parts: str) -> Callable[[Request], Answer]:
    """Answer in prose if a request has one of these parts: the server accepts them and does nothing."""
    return lambda request: "Here you are: base at zero." if request.keys() & set(parts) else designer(request)


def run(asked: Any, out: Path | None, n_total: int = 4, seen: list[Progress] | None = None) -> StudyResult:
    return short_run(out, asked, n_total=n_total, watch=None if seen is None else seen.append)


@pytest.mark.parametrize("refusal", REFUSALS)
def test_plain_server_gets_the_schema_in_the_prompt(chat_server: ChatServer, tmp_path: Path, refusal: str) -> None:
    chat_server.answer = refusing(*STRUCTURED, with_=REFUSALS[refusal])
    seen: list[Progress] = []
    result = run(llm_proposer(chat_server.url), tmp_path / "run", seen=seen)
    assert [trial.source for trial in result.trials[4:]] == ["llm", "bbo", "bbo", "llm"]
    told = [progress.note for progress in seen if "does not support output" in progress.note]
    assert told == ["test-model does not support output native and tool; this run uses output prompted"]
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
    ("wire", "answer", "used", "n_asked"),
    [
        ("own server", refusing("x"), "native", 1),
        ("anthropic", refusing("x"), "tool", 1),
        ("own server", refusing("response_format"), "tool", 1),
        ("openai", refusing("tools"), "native", 1),
        ("anthropic", refusing("tools"), "native", 1),
        ("own server", ignoring("response_format"), "tool", 2),  # the ignored ones cost something, too
        ("own server", ignoring("response_format", "tools"), "prompted", 3),
        ("openai", ignoring("tools"), "native", 2),
        ("anthropic", ignoring("tools", "output_config"), "prompted", 3),
    ],
)
def test_first_mode_that_the_server_heeds_is_used(
    chat_server: ChatServer,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    wire: str,
    answer: Any,
    used: str,
    n_asked: int,
) -> None:
    chat_server.answer = answer
    seen: list[Progress] = []
    result = run(proposer(wire, chat_server, monkeypatch), tmp_path / "run", seen=seen)
    assert [trial.source for trial in result.trials[4:]] == ["llm", "bbo", "bbo", "llm"]
    assert result.summary["proposer"]["output_mode"] == used
    assert n_asked == 1 or any(f"this run uses output {used}" in progress.note for progress in seen)
    check, *others = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    assert (check.output_mode, check.requests, check.input_tokens) == (used, n_asked, 100 * n_asked)
    assert [call.requests for call in others] == [1] * 4


def test_check_stays_within_the_budget(chat_server: ChatServer) -> None:
    chat_server.answer = ignoring(*STRUCTURED)
    with pytest.raises(ModelError):
        run(llm_proposer(chat_server.url, max_calls=2), None)
    assert len(chat_server.requests) == 2


@pytest.mark.parametrize("output", ["auto", "native", "tool", "prompted"])
def test_model_without_json_in_the_check_is_used_and_reported(
    chat_server: ChatServer, tmp_path: Path, output: str
) -> None:
    chat_server.answer = lambda request: "ready" if is_check(request) else designer(request)
    seen: list[Progress] = []
    result = run(llm_proposer(chat_server.url, output=output), tmp_path / "run", n_total=1, seen=seen)
    used = "prompted" if output == "auto" else output
    told = (
        "test-model answered the check in another form than its JSON schema; its proposals may fail; "
        f"this run uses output {used}"
    )
    assert told in [progress.note for progress in seen]
    assert (result.trials[4].source, result.summary["proposer"]["output_mode"]) == ("llm", used)
    assert len(chat_server.requests) == (3 if output == "auto" else 1) + 2


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


def test_question_without_a_check_finds_the_mode_once(chat_server: ChatServer) -> None:
    """As of drafts and of Optuna studies."""
    chat_server.answer = refusing(*STRUCTURED)
    asked = llm_proposer(chat_server.url)
    asking = AskOptions(asked.output_format(PROBLEM))
    for number in (4, 7):
        reply = asked.backend.ask(Question(f"llm-{number:04d}", "answer", "Which?"), asking)
        assert (reply.output_mode, reply.requests) == ("prompted", 1)
    assert len(chat_server.requests) == 3 + 1


@pytest.mark.parametrize("most_requests", [None, 3])
def test_question_without_a_check_leaves_an_ignored_mode(chat_server: ChatServer, most_requests: int | None) -> None:
    """Within the requests of a question, if need be over several of them."""
    chat_server.answer = ignoring(*STRUCTURED)
    asked = llm_proposer(chat_server.url)
    question = Question("llm-0004", "answer", "Which?")
    asking = AskOptions(asked.output_format(PROBLEM), most_requests)
    spent: list[int] = []
    while not chat_server.requests or chat_server.requests[-1].keys() & set(STRUCTURED):
        try:
            reply = asked.backend.ask(question, asking)
        except CallError as fault:
            reply = fault.reply
        spent.append(reply.requests)
    assert spent == ([7] if most_requests is None else [3, 3, 1])  # an answer is asked for three times in a mode
    assert reply.output_mode == "prompted"
    assert asked.backend.ask(question, asking).requests == 1


@pytest.mark.parametrize("wrong", ["link_1", "joint_1"])
def test_invalid_design_is_no_reason_to_leave_a_mode(chat_server: ChatServer, wrong: str) -> None:
    chat_server.answer = lambda request: json.dumps({**GOOD_DESIGN, wrong: "7"})
    asked = llm_proposer(chat_server.url)
    with pytest.raises(CallError, match=wrong):
        asked.backend.ask(Question("llm-0004", "answer", "Which?"), AskOptions(asked.output_format(PROBLEM)))
    assert all("response_format" in request for request in chat_server.requests)
    assert len(chat_server.requests) == 3
