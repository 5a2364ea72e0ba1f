"""Model faults over HTTP, against a local server that produces each of them."""

import json
import random
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from armwright import Problem, load_task, optimize
from armwright.exceptions import ModelError
from armwright.llm import client as chat
from armwright.llm.backend import FINAL, AskOptions, CallError, Question
from armwright.llm.transcript import Transcript
from armwright.study.progress import Progress, StudyResult
from tests.fuzz.mutation import changed
from tests.support.chat_server import (
    GOOD_DESIGN,
    Answer,
    ChatServer,
    Request,
    Response,
    completion,
    designer,
    message,
    sent_events,
    streamed_events,
)
from tests.support.model_faults import FAULTS, anthropic_error, openai_error, rate_limit
from tests.support.wire_formats import WIRES, llm_proposer, proposer

PROBLEM = Problem(load_task("target-1"))
ENDLESS = ("slow first byte", "dripping body")
EVERY_FAULT = [
    pytest.param(wire, kind, name, id=f"{wire}-{name}")
    for wire in ("openai", "anthropic")
    for kind, faults in FAULTS.items()
    for name in faults
]

both_formats = pytest.mark.parametrize("wire", ["openai", "anthropic"])
every_fault = pytest.mark.parametrize(("wire", "kind", "name"), EVERY_FAULT)


Ask = Callable[..., tuple[StudyResult, list[Progress]]]


@pytest.fixture
def ask(chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Ask:
    """A short run in tmp_path/run, and all that it reported."""

    def run(
        wire: str, slow_at: int | None = None, timeout: float = 120.0, watch: Any = None, **how: Any
    ) -> tuple[StudyResult, list[Progress]]:
        shown: list[Progress] = []
        asked = proposer(wire, chat_server, monkeypatch, timeout=timeout)

        def watching(progress: Progress) -> None:
            shown.append(progress)
            if watch is not None:
                watch(progress)
            if progress.number == slow_at and isinstance(asked.backend, chat.ModelClient):
                asked.backend.timeout = 0.2

        settings = {"n_init": 4, "n_step": 3, "n_total": 6, "out": tmp_path / "run", "verify": False, **how}
        return optimize(PROBLEM, proposer=asked, watch=watching, **settings), shown

    return run


def after(n: int, fault: Answer, last: int | None = None) -> Callable[[Request], Answer]:
    """Good answers to the first n requests, then the fault: for good, or up to the last-th request."""
    count = iter(range(1, 1_000_000))

    def answer(request: Request) -> Answer:
        number = next(count)
        return designer(request) if number <= n or (last is not None and number > last) else fault

    return answer


def sources(run: StudyResult) -> Sequence[str]:
    return [trial.source for trial in run.trials[4:]]


@every_fault
@pytest.mark.fast_cases(3)
def test_fault_before_the_first_trial_is_a_one_line_error(
    chat_server: ChatServer, ask: Ask, tmp_path: Path, wire: str, kind: str, name: str
) -> None:
    chat_server.answer = lambda request: FAULTS[kind][name]
    with pytest.raises(ModelError) as caught:
        ask(wire, timeout=0.2 if name in ENDLESS else 120.0)
    words = str(caught.value)
    assert words.startswith(f"{WIRES[wire] or 'test-model'}: ")
    assert "\n" not in words
    assert "model_name" not in words  # the server's words, not a dictionary
    assert (tmp_path / "run" / "trials.jsonl").read_text(encoding="utf-8") == ""
    (call,) = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    assert (call.step, call.fault) == ("check", kind)


@every_fault
@pytest.mark.fast_cases(3)
def test_later_fault_becomes_a_counted_black_box_trial(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, ask: Ask, tmp_path: Path, wire: str, kind: str, name: str
) -> None:
    chat_server.answer = after(3, FAULTS[kind][name])
    run, shown = ask(wire, slow_at=7 if name in ENDLESS else None)
    assert sources(run) == ["llm", "bbo", "bbo"] + ["bbo"] * 3
    assert [trial.fault for trial in run.trials[4:]] == [None, None, None, kind, None, None]
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["proposer"]
    assert (summary["failures"], summary["call_failures"]) == ({kind: 1}, {kind: 1})
    assert (summary["fallback_share"], summary["flagged"]) == (0.5, True)
    assert (shown[-1].faults, shown[-1].fault) == ({kind: 1}, None)
    (told,) = [progress for progress in shown if progress.fault]
    assert (told.number, told.fault) == (7, kind)
    assert "\n" not in told.note
    assert ("no more requests are made" in told.note) == (kind in FINAL)
    failed = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert (failed.proposal, failed.step, failed.fault) == ("llm-0007", "reasoning", kind)
    assert failed.error
    assert told.note.startswith(failed.error)


@pytest.mark.parametrize(
    ("wire", "name"), [("own server", "wrong key"), ("openai", "quota gone"), ("anthropic", "unknown model")]
)
def test_permanent_fault_is_reported_once_and_ends_proposals(
    chat_server: ChatServer, ask: Ask, wire: str, name: str
) -> None:
    kind = next(kind for kind, faults in FAULTS.items() if name in faults)
    chat_server.answer = after(3, FAULTS[kind][name])
    run, shown = ask(wire, n_total=12)
    assert len(chat_server.requests) == 4  # the check, two for the first proposal, the fault
    assert [trial.fault for trial in run.trials[4:] if trial.fault] == [kind] * 3
    assert sources(run) == ["llm"] + ["bbo"] * 11
    assert run.summary["proposer"]["failures"] == {kind: 3}
    assert run.summary["proposer"]["call_failures"] == {kind: 1}
    assert sum("no more requests are made in this session" in progress.note for progress in shown) == 1


@pytest.mark.parametrize(
    ("fault", "own_pause"),
    [
        (rate_limit(retry_after="0"), 1000.0),  # the server's word counts, not ours
        (rate_limit(retry_after_ms="5"), 1000.0),
        (FAULTS["server"]["overloaded"], 0.0),
    ],
    ids=["retry-after", "retry-after-ms", "overloaded"],
)
@both_formats
def test_transient_faults_are_retried_twice(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, ask: Ask, wire: str, fault: Answer, own_pause: float
) -> None:
    monkeypatch.setattr(chat, "RETRY_SECONDS", own_pause)
    chat_server.answer = after(3, fault, last=5)
    run, _ = ask(wire)
    assert sources(run) == ["llm", "bbo", "bbo"] * 2
    assert len(chat_server.requests) == 5 + 2
    assert run.summary["proposer"]["call_failures"] == {}


@pytest.mark.parametrize(
    ("wire", "retry_after"), [("openai", "100"), ("anthropic", "61"), ("openai", "Fri, 01 Jan 2100 00:00:00 GMT")]
)
def test_retry_after_beyond_the_deadline_fails_at_once(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, ask: Ask, wire: str, retry_after: str
) -> None:
    chat_server.answer = after(3, rate_limit(retry_after=retry_after))
    run, _ = ask(wire, timeout=60.0)  # a test that waited for it would be seen
    assert run.trials[7].fault == "rate_limit"
    assert len(chat_server.requests) == 4


def test_model_is_used_again_after_an_outage(chat_server: ChatServer, ask: Ask) -> None:
    def watch(progress: Progress) -> None:
        if (progress.doing, progress.number) == ("proposing", 7):
            chat_server.stop()
        if (progress.doing, progress.number) == ("finished", 7):
            chat_server.start()

    run, _ = ask("openai", n_total=9, watch=watch)
    assert sources(run) == ["llm", "bbo", "bbo", "bbo", "bbo", "bbo", "llm", "bbo", "bbo"]
    assert run.summary["proposer"]["failures"] == {"connection": 1}


@pytest.mark.parametrize("key", ["sk-planted-key\n", "sk-planted\nkey-in-two", "sk-planted-ключ"])
def test_key_invalid_in_a_header_is_reported(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setenv("ARMWRIGHT_API_KEY", key)
    with pytest.raises(ModelError, match="its key cannot be sent") as caught:
        optimize(PROBLEM, proposer=llm_proposer(chat_server.url, model="m"), n_total=1)
    assert "planted" not in str(caught.value)


# Servers that say anything at all.


def stream(events: Any) -> str:
    if not isinstance(events, list):
        return json.dumps(events)
    return sent_events(e if isinstance(e, dict) and isinstance(e.get("type"), str) else {"type": "x"} for e in events)


TOOL_CALL = {"model": "m", "tools": [{"name": "final_result", "function": {"name": "final_result"}}]}
TEXT = json.dumps(GOOD_DESIGN)
DOCUMENTS = (
    completion(TEXT, TOOL_CALL),
    completion(TEXT, {}),
    message(TEXT, TOOL_CALL),
    streamed_events(message(TEXT, TOOL_CALL)),
    streamed_events(message(TEXT, {})),
    *(json.loads(error.body) for error in (openai_error(429, "a", "b"), anthropic_error(400, "a", "b"))),
)


def damaged(document: Any, seed: int) -> bytes | str:
    """A document with a part changed, or its bytes; a list of events as a stream."""
    data = changed(json.dumps(document).encode(), "json", random.Random(seed))
    if isinstance(document, list):
        with suppress(ValueError, RecursionError):
            return stream(json.loads(data))
    return data


BODIES = (
    st.builds(damaged, st.sampled_from(DOCUMENTS), st.integers(0, 2**32))
    | st.binary(max_size=60)
    | st.sampled_from(["[" * 9000, '{"a":' * 9000])
)
STATUSES = st.just(200) | st.sampled_from([100, 204, 206, 302, 307, 400, 401, 404, 408, 413, 422, 429, 500, 529, 999])
HEADERS = st.dictionaries(
    st.sampled_from(["retry-after", "retry-after-ms", "content-encoding", "location", "transfer-encoding"]),
    st.sampled_from(["0", "-1", "nan", "1e999", "9" * 30, "gzip", "br", "chunked", "/v1/messages", "http://[::", "ÿ"]),
    max_size=2,
)
TYPES = st.sampled_from(["application/json", "text/event-stream", "text/html", "text/plain; charset=utf-16", "ÿ", ""])


@pytest.mark.filterwarnings("ignore:Failed to extract usage")
# The vendor's client leaves the stream of a broken answer to the garbage collector, which may come at a bad time.
@pytest.mark.filterwarnings("ignore:.*async_generator:pytest.PytestUnraisableExceptionWarning")
@both_formats
@pytest.mark.slow
def test_arbitrary_responses_are_answers_or_faults(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, wire: str
) -> None:
    asked = proposer(wire, chat_server, monkeypatch)

    nameless = [dict(event) for event in streamed_events(message(TEXT, TOOL_CALL))]
    nameless[0]["message"] = {**nameless[0]["message"], "model": True}

    @settings(max_examples=30)
    @given(st.builds(Response, BODIES, STATUSES, HEADERS, TYPES), st.sampled_from(["reasoning", "answer"]))
    @example(Response(stream(nameless), 200, {}, "text/event-stream"), "answer")
    def check(response: Response, step: str) -> None:
        chat_server.answer = lambda request: response
        question = Question("llm-0004", step, "Which?")
        with suppress(CallError):
            if step == "answer":
                asked.backend.ask(question, AskOptions(asked.output_format(PROBLEM)))
            else:
                asked.backend.ask(question)

    check()
