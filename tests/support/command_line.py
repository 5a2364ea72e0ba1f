"""Run armwright's command line in this process or in another one."""

import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from armwright.cli import app as cli

WIDTH = "80"
PATIENCE = 600  # [s] for what takes moments; only a test that hangs waits so long
PROGRAM = str(Path(cli.__file__).with_name("__main__.py"))  # as `python -m armwright` has it


def armwright(*arguments: object, encoding: str = "utf-8", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command as in a shell without a terminal.

    Args:
        arguments: of the command, without the program's name.
        encoding: of standard output and standard error.
        environment: variables to set, besides those of the test.
    """
    given = [str(argument) for argument in arguments]
    output, errors = (io.TextIOWrapper(io.BytesIO(), encoding) for _ in range(2))
    with (
        _process_state(),
        patch.dict(os.environ, {"COLUMNS": WIDTH, **environment}),
        patch.object(sys, "argv", [PROGRAM, *given]),
        patch.object(sys, "stdin", io.StringIO()),
        redirect_stdout(output),
        redirect_stderr(errors),
        pytest.raises(SystemExit) as end,
    ):
        cli.main()
    code = int(end.value.code or 0)
    return subprocess.CompletedProcess(given, code, _text(output), _text(errors))


def refused(code: int, *arguments: object, **environment: str) -> str:
    """The one line of an error, without a traceback."""
    done = armwright(*arguments, **environment)
    assert done.returncode == code, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("armwright: ")
    return line


def start(*arguments: object, **how: Any) -> subprocess.Popen[str]:
    """Start a command in a process of its own, its output in pipes."""
    return subprocess.Popen(
        [sys.executable, "-m", "armwright", *map(str, arguments)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8", **how,
    )  # fmt: skip


def wait_until(there: Callable[[], bool]) -> None:
    """Wait for something that other threads or processes do."""
    gone = threading.Event()
    for _ in range(int(PATIENCE / 0.005)):
        if there():
            return
        gone.wait(0.005)
    raise AssertionError("it did not come to that")


def press_ctrl_c() -> None:
    """Interrupt this process: its main thread, whichever thread asks for it."""
    os.kill(os.getpid(), signal.SIGINT)


def _text(stream: io.TextIOWrapper) -> str:
    stream.flush()
    stream.seek(0)
    return stream.read()


@contextmanager
def _process_state() -> Iterator[None]:
    """Restore what the program sets for its own process: signal handlers and the hook for unraisable exceptions."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.getsignal(number) for number in numbers]
    hook = sys.unraisablehook
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)
