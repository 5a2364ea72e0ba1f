"""Hints in the prompts of a running study."""

import json
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from armwright import ManualProposer, ReplayProposer, load_task
from armwright.exceptions import AnswerPendingError
from armwright.llm import client as chat
from armwright.llm.prompt import design_prompt
from armwright.llm.transcript import hints_of, used_hints
from armwright.runs.control import Hint, add_hint, read_control
from armwright.study.progress import Progress
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE
from tests.support.controlled_runs import after, asks, calls, cut, interrupt, lines, run, status
from tests.support.fixed_problem import FixedProblem, fixed_history

NOTE = "A note from the engineer who watches this search; take it into account: "
NOTES = "Notes from the engineer who watches this search; take them into account:\n"


def prompts_with_hints(folder: Path) -> dict[str, str]:
    """What stands after the words that lead to the hints, by proposal."""
    return {
        f"{call.proposal} {call.step}": (call.prompt.partition(NOTE)[2] or call.prompt.partition(NOTES)[2])
        for call in calls(folder)
        if NOTE in call.prompt or NOTES in call.prompt
    }


@pytest.mark.parametrize("asking", [{}, {"answer": "one-step"}, {"prompt": "minus"}])
def test_hint_enters_the_next_prompt_once(chat_server: ChatServer, tmp_path: Path, asking: dict[str, Any]) -> None:
    """This holds with and without an interrupt; no other recorded call has hints."""
    out = tmp_path / "run"

    def watch(progress: Progress) -> None:
        after(5, lambda: add_hint(out, " no joint may\nbe a roll joint "))(progress)
        after(8, interrupt)(progress)

    with pytest.raises(KeyboardInterrupt):
        run(out, asks(chat_server, **asking), watch=watch)
    run(out, asks(chat_server, **asking))
    step = "answer" if "answer" in asking else "reasoning"
    told = prompts_with_hints(out)
    assert list(told) == [f"llm-0007 {step}"]
    assert told[f"llm-0007 {step}"].startswith("no joint may be a roll joint\n")
    (hint,) = read_control(out).hints
    assert hint == Hint(1, "no joint may\nbe a roll joint")
    assert used_hints(calls(out)) == {hint: "llm-0007"}
    assert [call.hints for call in calls(out) if (call.proposal, call.step) == ("llm-0007", step)] == [(hint,)]
    written = [json.loads(line) for line in (out / "transcripts.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [call["hints"] for call in written if "hints" in call] == [[asdict(hint)]]
    assert sum(NOTE in prompt for prompt in chat_server.prompts()) == 1


def test_several_hints_form_a_list_and_later_ones_wait(chat_server: ChatServer, tmp_path: Path) -> None:
    out = tmp_path / "run"

    def watch(progress: Progress) -> None:
        after(2, lambda: (add_hint(out, "first"), add_hint(out, "second")))(progress)
        after(7, lambda: add_hint(out, "third"))(progress)

    run(out, asks(chat_server), watch=watch)
    told = prompts_with_hints(out)
    assert list(told) == ["llm-0004 reasoning", "llm-0010 reasoning"]
    assert told["llm-0004 reasoning"].startswith("- first\n- second\n\nEnd your answer with")
    assert told["llm-0010 reasoning"].startswith("third\n\nEnd your answer with")
    assert {hint.id: proposal for hint, proposal in used_hints(calls(out)).items()} == {
        1: "llm-0004", 2: "llm-0004", 3: "llm-0010",
    }  # fmt: skip


def test_hint_lost_with_a_failed_call_enters_the_next_prompt(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hint that the model refused is dropped, or every later prompt would be refused."""
    monkeypatch.setattr(chat, "RETRY_SECONDS", 0.0)
    out = tmp_path / "run"
    answers: dict[int, Answer] = {4: (503, "{}"), 7: (400, "{}")}  # by trial
    asked: list[int] = []

    def answer(request: Request) -> Answer:
        asked.append(status(out).number)
        return answers.get(asked[-1], designer(request))

    chat_server.answer = answer
    run(out, asks(chat_server, answer="one-step"), watch=after(3, lambda: add_hint(out, "first")))
    assert list(prompts_with_hints(out)) == ["llm-0004 answer", "llm-0007 answer"]
    assert used_hints(calls(out)) == {Hint(1, "first"): "llm-0007"}
    assert [call.fault for call in calls(out)] == [None, "server", "rejected", None]


def test_hint_of_an_interrupted_call_is_sent_again(chat_server: ChatServer, tmp_path: Path) -> None:
    """The prompt is the same; after the answer, the second call of the proposal has no hint."""
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run(out, asks(chat_server), watch=after(3, lambda: (add_hint(out, "first"), interrupt())))
    run(out, asks(chat_server))
    (shown,) = (call.prompt for call in calls(out) if call.hints)
    assert NOTE + "first\n" in shown
    cut(out, transcripts=3, trials=4)  # two checks, and the thoughts
    (out / "summary.json").unlink()
    chat_server.requests.clear()
    run(out, asks(chat_server))
    assert not any(NOTE in prompt for prompt in chat_server.prompts())
    assert hints_of(calls(out), "llm-0004") == (Hint(1, "first"),)


def test_concurrent_calls_share_no_hint(chat_server: ChatServer, tmp_path: Path) -> None:
    out = tmp_path / "run"
    out.mkdir()
    add_hint(out, "first")
    together = threading.Barrier(2, timeout=PATIENCE)

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) in (2, 3):
            together.wait()  # both are asked before either is answered
        return designer(request)

    chat_server.answer = answer
    run(out, asks(chat_server), in_flight=2)
    assert len(prompts_with_hints(out)) == 1
    assert len(used_hints(calls(out))) == 1


PAPER = FixedProblem(load_task("target-1"))


def test_prompt_without_visible_hints_is_unchanged() -> None:
    history = fixed_history(PAPER)
    assert design_prompt(history, 3, hints=("\u200b", "\x00")) == design_prompt(history, 3)


def test_run_with_hints_is_replayed_exactly(chat_server: ChatServer, tmp_path: Path) -> None:
    """The replay ignores its own control.json, and can itself be replayed."""

    def answer(request: Request) -> Answer:
        n = len(chat_server.requests)
        return json.dumps({**GOOD_DESIGN, "link_1": 0.1 + 0.001 * n}) if "response_format" in request else f"idea {n}"

    chat_server.answer = answer
    first = tmp_path / "first"
    run(first, asks(chat_server), watch=after(5, lambda: add_hint(first, "first")))
    assert len(used_hints(calls(first))) == 1
    chat_server.requests.clear()
    before = first
    for again in (tmp_path / "again", tmp_path / "third"):
        again.mkdir()
        add_hint(again, "another")
        assert run(again, ReplayProposer(before)).summary["proposer"]["differing_prompts"] == 0
        assert lines(again) == lines(first)
        assert [call.hints for call in calls(again)] == [call.hints for call in calls(first)]
        before = again
    assert not chat_server.requests


def test_manual_proposer_gets_no_hints(tmp_path: Path) -> None:
    """A question must stay the same until it is answered."""
    out, folder = tmp_path / "run", tmp_path / "ask"
    for _ in range(2):
        with pytest.raises(AnswerPendingError):
            run(out, ManualProposer(folder, wait=False))
        add_hint(out, "first")
    assert "engineer" not in (folder / "004-prompt.md").read_text(encoding="utf-8")
    assert status(out).doing == "stopped"
    assert "004-prompt.md waits for" in status(out).fault
