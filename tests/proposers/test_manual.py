"""Manual proposals through files."""

import json
import queue
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from armwright import ManualProposer, Problem, PromptOptions, ReplayProposer, StudyResult, load_task, optimize
from armwright.exceptions import FailureError, SettingsError
from armwright.llm.transcript import Transcript
from armwright.proposers import manual as people
from tests.support.chat_server import GOOD_DESIGN
from tests.support.manual_answers import impatient

PROBLEM = Problem(load_task("target-1"))
LINES = """\
I would put the shoulder into the middle.

ORIGIN: (0, 0.01, -0.1)
JOINTS: (Y, P, R, P)
LINKS: (0.2, 0.2, 0.2, 0.2)
REASON: a shoulder in the middle
"""
JSON = json.dumps({**GOOD_DESIGN, "link_1": 0.25})
Answering = Callable[[dict[str, tuple[str, str]]], None]


def run(proposer: ManualProposer | ReplayProposer, out: Path | None, n_total: int = 6, **settings: Any) -> StudyResult:
    return optimize(PROBLEM, proposer=proposer, n_init=4, n_step=3, n_total=n_total, seed=2, out=out, **settings)


def pending(folder: Path, out: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(impatient(folder), out)


@pytest.fixture
def answering(monkeypatch: pytest.MonkeyPatch) -> Iterator[Answering]:
    """Answers in a thread of its own: for each file that is written for people, the name and text of an answer."""
    written: queue.SimpleQueue[Path] = queue.SimpleQueue()
    write, threads = people.ManualBackend._write, list[threading.Thread]()

    def note(self: people.ManualBackend, file: Path, text: str) -> None:
        write(self, file, text)
        written.put(file)

    def answer(answers: dict[str, tuple[str, str]]) -> None:
        for _ in answers:
            file = written.get()
            name, text = answers[file.name]
            (file.parent / name).write_text(text, encoding="utf-8")

    def start(answers: dict[str, tuple[str, str]]) -> None:
        threads.append(threading.Thread(target=answer, args=(answers,), daemon=True))
        threads[-1].start()

    monkeypatch.setattr(people.ManualBackend, "_write", note)
    monkeypatch.setattr(people, "LOOK_EVERY", 0.01)
    yield start
    for thread in threads:
        thread.join()


def test_waiting_and_resuming_give_the_same_run(tmp_path: Path, answering: Answering) -> None:
    answering({"004-prompt.md": ("004-answer.md", LINES), "007-prompt.md": ("007-answer.json", JSON)})
    waited = run(ManualProposer(tmp_path / "a"), tmp_path / "waited")

    for number, text in (("004", LINES), ("007", JSON)):
        pending(tmp_path / "b", tmp_path / "once")
        # Windows' Notepad begins a file so.
        (tmp_path / "b" / f"{number}-answer.md").write_text("\ufeff" + text, encoding="utf-8")
    once = run(ManualProposer(tmp_path / "b"), tmp_path / "once")

    played = run(ReplayProposer(tmp_path / "waited"), None)
    assert played.summary["proposer"]["differing_prompts"] == 0
    for other in (once, played):
        assert [trial.values for trial in other.trials] == [trial.values for trial in waited.trials]
        assert [trial.reason for trial in other.trials] == [trial.reason for trial in waited.trials]
    for name in ("004-prompt.md", "007-prompt.md"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_refused_manual_answers_are_recorded(tmp_path: Path) -> None:
    pending(tmp_path / "ask", tmp_path / "run")
    for n in (1, 2):
        (tmp_path / "ask" / "004-answer.md").write_text(f"{n}", encoding="utf-8")
        pending(tmp_path / "ask", tmp_path / "run")
        assert "no design found" in (tmp_path / "ask" / "004-refused.md").read_text(encoding="utf-8")
        assert (tmp_path / "ask" / f"004-refused-{n}.md").read_text(encoding="utf-8") == f"{n}"
    # Where several files hold answers, a good one is found behind a bad one.
    (tmp_path / "ask" / "004-answer.md").write_text("bad", encoding="utf-8")
    (tmp_path / "ask" / "004-answer.json").write_text(JSON, encoding="utf-8")
    pending(tmp_path / "ask", tmp_path / "run")
    assert (tmp_path / "ask" / "007-prompt.md").exists()


@pytest.mark.parametrize("memory", ["none", "chat"])
def test_manual_proposer_refuses_overlap(tmp_path: Path, memory: str) -> None:
    with pytest.raises(SettingsError, match="in_flight does not go with the proposer manual"):
        run(ManualProposer(tmp_path / "ask", PromptOptions(memory=memory)), None, in_flight=1)


def test_folder_with_files_of_another_run_is_refused(tmp_path: Path) -> None:
    pending(tmp_path / "ask", tmp_path / "run")
    with pytest.raises(FailureError, match=r"004-prompt\.md is a question of another run"):
        run(ManualProposer(tmp_path / "ask", PromptOptions(prompt="minus")), tmp_path / "other")
    (tmp_path / "ask" / "004-answer.md").write_text(LINES, encoding="utf-8")
    (tmp_path / "ask" / "007-answer.md").write_text(LINES, encoding="utf-8")
    with pytest.raises(FailureError, match=r"007-answer\.md exists before its question"):
        run(ManualProposer(tmp_path / "ask"), tmp_path / "run")
    assert not (tmp_path / "ask" / "007-prompt.md").exists()


def test_invalid_answer_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(SettingsError, match="file is a file; manual needs a folder"):
        ManualProposer(tmp_path / "file")


def test_manual_answers_are_attributed_to_people(tmp_path: Path) -> None:
    pending(tmp_path / "ask", tmp_path / "run")
    (tmp_path / "ask" / "004-answer.md").write_text(LINES, encoding="utf-8")
    pending(tmp_path / "ask", tmp_path / "run")
    (call,) = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    assert (call.proposal, call.step, call.origin, call.model, call.fault) == (
        "manual-0004", "answer", "manual", "people", None,
    )  # fmt: skip
    assert call.prompt == (tmp_path / "ask" / "004-prompt.md").read_text(encoding="utf-8")
