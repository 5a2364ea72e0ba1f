"""Closed pipes, missing terminals and closed standard streams."""

import os
import pty
import subprocess
from pathlib import Path

import pytest

from tests.torture.lives import is_beginning, is_same_run, n_lines
from tests.torture.short import armwright, command, one_line, run, study


def test_closed_output_pipe_ends_the_command(tmp_path: Path, whole: Path) -> None:
    """As with `| head -1`."""
    folder = tmp_path / "run"
    process = subprocess.Popen(
        command(folder, "--no-figures"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().startswith("proposer: rules")
        process.stdout.close()
        said = process.stderr.read()
    assert process.returncode == 1
    assert said == "armwright: output pipe closed; rerun the same command to resume an unfinished run\n"
    is_beginning(folder, whole)
    assert study(folder).returncode == 0
    is_same_run(folder, whole)


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_closed_standard_streams(tmp_path: Path, whole: Path, closed: str) -> None:
    """Nor does any file of the run take their numbers."""
    folder = tmp_path / "run"
    done = run(["sh", "-c", f'exec "$@" {closed}', "sh", *command(folder, "--no-figures")], start_new_session=True)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(folder, whole)


def test_error_without_a_stderr(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    done = run(["sh", "-c", 'exec "$@" 2>&-', "sh", *command(tmp_path / "run")])
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.parametrize("terminal", [None, "no-such-terminal"])
def test_command_without_a_terminal(tmp_path: Path, whole: Path, terminal: str | None) -> None:
    folder = tmp_path / "run"
    done = study(folder, environment={"TERM": terminal, "COLUMNS": "0", "LINES": None}, start_new_session=True)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(folder, whole)


def test_terminal_that_disappears(tmp_path: Path, whole: Path) -> None:
    folder = tmp_path / "run"
    master, slave = pty.openpty()
    process = subprocess.Popen(
        command(folder, "--no-figures"), stdin=slave, stdout=slave, stderr=subprocess.PIPE, start_new_session=True
    )
    os.close(slave)
    while n_lines(folder / "trials.jsonl") < 3:
        os.read(master, 1000)
    os.close(master)
    _, said = process.communicate()
    assert process.returncode in (0, 1)  # it ends before it says anything more, perhaps
    assert b"Traceback" not in said
    is_beginning(folder, whole)
    assert study(folder).returncode == 0
    is_same_run(folder, whole)


def test_error_is_one_line_on_any_stream(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    assert "cannot write" in one_line(armwright("optimize", "target-1", "--out", tmp_path / "run"))
