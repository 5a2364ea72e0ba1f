"""Closed pipes, missing terminals and closed standard streams."""

import json
import subprocess
from pathlib import Path

import pytest

from tests.torture.short import armwright, command, is_resumed, is_same_run, run, study


def test_closed_output_pipe_ends_the_command(tmp_path: Path, whole: Path) -> None:
    """As with `| head -1`."""
    process = subprocess.Popen(
        command(study(tmp_path / "run")),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
    )  # fmt: skip
    with process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline().startswith("proposer: rules")
        process.stdout.close()
        said = process.stderr.read()
    assert process.returncode == 1
    assert said == "armwright: output pipe closed; rerun the same command to resume an unfinished run\n"
    is_resumed(tmp_path / "run", whole)


def test_closed_standard_streams_and_no_terminal(tmp_path: Path, whole: Path) -> None:
    """Nor does any file of the run take their numbers."""
    shell = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *command(study(tmp_path / "run"))]
    nothing = {"TERM": None, "COLUMNS": "0", "LINES": None}
    done = run(shell, environment=nothing, start_new_session=True)
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(tmp_path / "run", whole)


CHATTY = """
import atexit, ctypes, os, subprocess, sys
import armwright as aw

C = ctypes.CDLL(None)

def chat():
    print("print")
    sys.stdout.write("buffered until the end")
    os.write(1, b"write\\n")
    C.printf(b"printf, flushed at exit\\n")
    subprocess.run(["echo", "child"], check=True)

print("import")
atexit.register(chat)

@aw.evaluator("size [m]")
def chats(arm, task):
    chat()
    return arm.length

@aw.evaluator("size [m]")
def closes(arm, task):
    sys.stdout.close()
    sys.stderr.close()
    os.closerange(0, 3)
    return arm.length

"""


@pytest.mark.parametrize("function", ["chats", "closes"])
def test_output_is_ours_alone_whatever_an_evaluator_does(in_folder: Path, function: str) -> None:
    Path("chatty.py").write_text(CHATTY, encoding="utf-8")
    done = armwright(
        "optimize", "target-1", "--evaluator", f"chatty.py:{function}", "--proposer", "none", "--no-figures",
        "--n-init", "2", "--n-total", "8", "--out", "run", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["n_trials"] == 10
    said = ("print", "write", "printf", "child", "until the end") if function == "chats" else ()
    assert all(word in done.stderr for word in ("proposer: none", "import", *said))
