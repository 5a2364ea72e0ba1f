"""Stop and status of a running study."""

import os
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from armwright import History, Proposal, Proposer
from armwright.exceptions import ModelError, ProposalError, RunFolderError, StoppedError
from armwright.runs.control import (
    CONTROL,
    MAX_FILE_SIZE,
    STATUS,
    Control,
    read_control,
    read_status,
    stop_study,
)
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.command_line import armwright
from tests.support.controlled_runs import after, asks, lines, run, status
from tests.support.wire_formats import model_options

# Stop.


@pytest.mark.parametrize(("proposer", "number"), [("rules", 0), ("none", 3), ("rules", 11)])
def test_stopped_study_resumes_identically(tmp_path: Path, proposer: str, number: int) -> None:
    out = tmp_path / "run"
    with pytest.raises(StoppedError, match=r"stopped on request; every finished trial is in .*run/, and the same com"):
        run(out, proposer, watch=after(number, lambda: stop_study(out)))
    assert len(lines(out)) == number + 1
    assert (status(out).doing, status(out).number, status(out).fault) == ("stopped", number + 1, "")
    assert run(out, proposer).resumed == number + 1
    assert status(out).doing == "finished"
    run(tmp_path / "whole", proposer)
    assert lines(out) == lines(tmp_path / "whole")


def test_no_request_survives_an_earlier_session(tmp_path: Path) -> None:
    """This holds even if that session had no trial."""
    out = tmp_path / "run"
    out.mkdir()
    stop_study(out)
    assert read_control(out) == Control(stop=True)
    assert len(run(out).trials) == 13
    assert read_control(out) == Control()


def test_stopped_command_exits_as_after_ctrl_c(chat_server: ChatServer, in_folder: Path) -> None:
    out = in_folder / "run"

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) == 2:
            stop_study(out)
        return designer(request)

    chat_server.answer = answer
    settings = ["optimize", "target-1", "--model", "m", *model_options(base_url=chat_server.url)]
    settings += ["--n-total", "6", "--no-figures", "--out", "run"]
    done = armwright(*settings)
    assert (done.returncode, done.stderr) == (130, "")
    assert f"Resume with:\n  python -m armwright {shlex.join(settings)}" in done.stdout
    assert len(lines(out)) == 11  # the present design was evaluated
    done = armwright(*settings)
    assert (done.returncode, done.stderr) == (0, "")
    assert "resumed at trial 11 of 16" in done.stdout


# control.json and status.json.


HOSTILE: Mapping[str, bytes] = {
    "empty": b"",
    "cut": b'{"stop": tr',
    "no text": b"\xff\xfe\x00{",
    "a list": b"[true]",
    "words": b'{"stop": "yes"}',
    "more": b'{"stop": true, "speed": 2}',
    "deep": b'{"stop": ' + b"[" * 100_000,
    "huge": b'{"stop": true' + b" " * MAX_FILE_SIZE + b"}",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_damaged_control_file_is_ignored(tmp_path: Path, name: str) -> None:
    (tmp_path / CONTROL).write_bytes(HOSTILE[name])
    assert read_control(tmp_path) == Control()
    stop_study(tmp_path)
    assert read_control(tmp_path) == Control(stop=True)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders here")
@pytest.mark.parametrize("make", [os.mkdir, getattr(os, "mkfifo", None), lambda path: os.symlink(path, path)])
def test_control_path_that_is_not_a_file_is_ignored(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / CONTROL)
    assert read_control(tmp_path) == Control()
    make(tmp_path / STATUS)
    assert read_status(tmp_path) is None


def test_request_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunFolderError, match="cannot write"):
        stop_study(tmp_path / "file")


def test_status_goes_from_evaluating_through_asking_to_finished(chat_server: ChatServer, tmp_path: Path) -> None:
    out = tmp_path / "run"
    said: list[tuple[str, int]] = []

    def note() -> None:
        said.append((status(out).doing, status(out).number))

    def answer(request: Request) -> Answer:
        note()
        return designer(request)

    chat_server.answer = answer
    run(out, asks(chat_server, answer="one-step"), n_total=6, watch=lambda progress: note())
    assert said[:3] == [("evaluating", 0), ("asking", 0), ("evaluating", 0)]  # the forecast, the check, trial 0
    assert said[3:6] == [("evaluating", 0)] * 3
    assert said[6:] == [("asking", 4)] * 2 + [("evaluating", 4)] * 3 + [("asking", 7)] * 2 + [("evaluating", 7)] * 3
    assert (status(out).doing, status(out).number, status(out).pid) == ("finished", 10, os.getpid())
    before = (out / STATUS).read_bytes()
    run(out, asks(chat_server, answer="one-step"), n_total=6)  # shown again
    assert (out / STATUS).read_bytes() == before


class Faulty(Proposer):
    """Fails at its first question."""

    name = "faulty"

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        if number == 4:
            raise ProposalError("timeout", "it did not answer \udcff")
        return Proposal(history.problem.space.sample(1, seed)[0], f"faulty-{number:04d}")


def test_status_shows_the_last_fault_until_the_next_answer(tmp_path: Path) -> None:
    faults: list[str] = []
    run(tmp_path / "run", Faulty(), watch=lambda progress: faults.append(status(tmp_path / "run").fault))
    assert faults == [""] * 5 + [r"it did not answer \udcff"] * 4 + [""] * (len(faults) - 9)
    assert len(faults) == 16  # 13 trials, 3 questions


def test_status_of_a_failed_study_names_the_error(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = lambda request: (401, '{"error": {"message": "no such key"}}')
    with pytest.raises(ModelError, match="no such key"):
        run(tmp_path / "run", asks(chat_server))
    assert status(tmp_path / "run").doing == "stopped"
    assert "no such key" in status(tmp_path / "run").fault


def test_unwritable_status_does_not_stop_the_study(tmp_path: Path) -> None:
    out = tmp_path / "run"
    (out / STATUS).mkdir(parents=True)
    assert len(run(out).trials) == 13
    assert (out / STATUS).is_dir()
