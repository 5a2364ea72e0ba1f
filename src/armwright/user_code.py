"""Run Python code of users in this process, such as evaluators, without lasting effects on the process."""

import os
import signal
import sys
import threading
import traceback
from collections.abc import Generator, Mapping
from contextlib import chdir, contextmanager
from pathlib import Path
from typing import Any

from armwright.text import one_line

MAX_REASON_LENGTH = 300
MAX_TRACEBACK_LENGTH = 8_000  # an exception may hold megabytes


@contextmanager
def contained() -> Generator[None]:
    """Restore what user code changes in this process; a process that it forks ends with the block.

    The working folder, open standard streams, handlers of Ctrl-C and SIGTERM and the recursion limit are restored.
    """
    process, limit = os.getpid(), sys.getrecursionlimit()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with chdir("."):  # solvers change the working folder, to which the run's folder may be relative
            yield
    finally:
        if os.getpid() != process:
            os._exit(1)  # a second process must not go on with the run
        sys.setrecursionlimit(limit)
        open_closed_streams()
        _restore_handlers(handlers)


def open_closed_streams() -> None:
    """Open stdin, stdout and stderr if they are closed, so that no file of a run gets their number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number


def describe_exception(fault: BaseException) -> str:
    """Return the type and the text of an exception on one line, even if its `__str__` raises."""
    try:
        text = str(fault)
    except KeyboardInterrupt:
        raise
    except BaseException as failure:  # noqa: BLE001 (user code)
        text = f"(its __str__ raises {type(failure).__name__})"
    return one_line(f"{type(fault).__name__}: {text}".removesuffix(": "), MAX_REASON_LENGTH)


def traceback_of(fault: BaseException) -> str:
    """Return the traceback of user code, without the frame that caught the exception."""
    trace = fault.__traceback__
    lines = traceback.format_exception(type(fault), fault, trace and trace.tb_next)
    return "".join(lines)[:MAX_TRACEBACK_LENGTH].rstrip()


def place_of(fault: BaseException, file: str = "") -> str:
    """Return where an exception was raised, or where `file` called what raised it: `file.py, line 12`."""
    if isinstance(fault, SyntaxError):
        return f"{Path(fault.filename or '').name}, line {fault.lineno}"
    frames = traceback.extract_tb(fault.__traceback__)
    frame = next((frame for frame in reversed(frames) if frame.filename == file), frames[-1])
    return f"{Path(frame.filename).name}, line {frame.lineno}"


def _restore_handlers(handlers: Mapping[signal.Signals, Any]) -> None:
    """Restore signal handlers, except for SIG_DFL: our own handler sets that on the first Ctrl-C."""
    if threading.current_thread() is not threading.main_thread():
        return
    for number, handler in handlers.items():
        if handler is not None and signal.getsignal(number) not in (handler, signal.SIG_DFL):
            signal.signal(number, handler)
