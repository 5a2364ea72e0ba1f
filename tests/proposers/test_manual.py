"""Manual proposals through files."""

import json
import os
import queue
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from armwright import ManualProposer, Problem, PromptOptions, ReplayProposer, StudyResult, load_task, optimize
from armwright.exceptions import AnswerPendingError, FailureError, SettingsError
from armwright.llm.transcript import Transcript
from armwright.proposers import manual as people
from tests.support.chat_server import GOOD_DESIGN
from tests.support.command_line import armwright
from tests.support.wire_formats import model_options

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


def pending(folder: Path, out: Path, **how: str) -> AnswerPendingError:
    with pytest.raises(AnswerPendingError) as waits:
        run(ManualProposer(folder, PromptOptions(**how), wait=False), out)
    return waits.value


@pytest.mark.slow
def test_command_line_accepts_answers_one_by_one(in_folder: Path) -> None:
    command = (
        *("optimize", "target-1", "--proposer", "manual:ask", *model_options(wait=False)),
        *("--n-init", "4", "--n-step", "3", "--n-total", "3", "--no-figures", "--out", "run"),
    )

    def go(*more: str) -> subprocess.CompletedProcess[str]:
        done = armwright(*command, *more)
        assert done.returncode == 0, done.stderr
        return done

    first, last = f"ask{os.sep}004-prompt.md", f"ask{os.sep}004-answer.md"
    assert f"{first} waits for your answer in {last}; then resume with:\n  python -m armwright opt" in go().stdout
    (in_folder / last).write_text(LINES.replace("0.2)", "2.5)"), encoding="utf-8")
    refusal = "link_4 = 2.5 m is outside 0.03 <= link_4 <= 0.3 m"
    shown = json.loads(go("--json").stdout)
    assert shown == {"folder": "run", "question": first, "answer": last, "refusal": refusal}
    names = {file.name for file in (in_folder / "ask").iterdir()}
    assert names == {"004-prompt.md", "004-refused-1.md", "004-refused.md"}
    (in_folder / last).write_text(LINES, encoding="utf-8")
    assert json.loads(go("--json").stdout)["proposer"]["origin"] == "manual"


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
        waits = pending(tmp_path / "b", tmp_path / "once")
        assert waits.question == tmp_path / "b" / f"{number}-prompt.md"
        waits.answer.write_text("\ufeff" + text, encoding="utf-8")  # Windows' Notepad begins a file so
    once = run(ManualProposer(tmp_path / "b", wait=False), tmp_path / "once")

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
        assert "no design found" in pending(tmp_path / "ask", tmp_path / "run").refusal
        assert (tmp_path / "ask" / f"004-refused-{n}.md").read_text(encoding="utf-8") == f"{n}"
    # Where several files hold answers, a good one is found behind a bad one.
    (tmp_path / "ask" / "004-answer.md").write_text("bad", encoding="utf-8")
    (tmp_path / "ask" / "004-answer.json").write_text(JSON, encoding="utf-8")
    assert pending(tmp_path / "ask", tmp_path / "run").question.name == "007-prompt.md"


@pytest.mark.parametrize("memory", ["none", "chat"])
def test_manual_proposer_refuses_overlap(tmp_path: Path, memory: str) -> None:
    with pytest.raises(SettingsError, match="in_flight does not go with the proposer manual"):
        run(ManualProposer(tmp_path / "ask", PromptOptions(memory=memory)), None, in_flight=1)


def test_folder_with_files_of_another_run_is_refused(tmp_path: Path) -> None:
    pending(tmp_path / "ask", tmp_path / "run")
    with pytest.raises(FailureError, match=r"004-prompt\.md is a question of another run"):
        run(ManualProposer(tmp_path / "ask", PromptOptions(prompt="minus"), wait=False), tmp_path / "other")
    (tmp_path / "ask" / "004-answer.md").write_text(LINES, encoding="utf-8")
    (tmp_path / "ask" / "007-answer.md").write_text(LINES, encoding="utf-8")
    with pytest.raises(FailureError, match=r"007-answer\.md exists before its question"):
        run(ManualProposer(tmp_path / "ask", wait=False), tmp_path / "run")
    assert not (tmp_path / "ask" / "007-prompt.md").exists()


def test_invalid_answer_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(SettingsError, match="file is a file; manual needs a folder"):
        ManualProposer(tmp_path / "file", wait=False)


def test_manual_answers_are_attributed_to_people(tmp_path: Path) -> None:
    pending(tmp_path / "ask", tmp_path / "run").answer.write_text(LINES, encoding="utf-8")
    pending(tmp_path / "ask", tmp_path / "run")
    (call,) = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    assert (call.proposal, call.step, call.origin, call.model, call.fault) == (
        "manual-0004", "answer", "manual", "people", None,
    )  # fmt: skip
    assert call.prompt == (tmp_path / "ask" / "004-prompt.md").read_text(encoding="utf-8")
