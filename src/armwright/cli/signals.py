"""End commands on Ctrl-C and SIGTERM: in order, or at once if that takes too long or on a second signal."""

import ctypes
import os
import select
import signal
import sys
import threading
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from functools import cache

INTERRUPTED = 130  # exit code of a shell for Ctrl-C
REPORT_SECONDS = 2.0  # after which a command that has not ended says what it waits for
END_SECONDS = 10.0  # after which it ends
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SHOW_CURSOR = "\x1b[?25h"  # progress lines hide it

_installed = 0  # how often handlers were installed in this process: once, but in tests


def install_handlers() -> None:
    """Turn SIGINT and SIGTERM into KeyboardInterrupt, unless the shell ignores them for background jobs."""
    global _installed
    _installed += 1
    signal.set_wakeup_fd(_watch_signals(), warn_on_full_buffer=False)
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
            _reset_on_delivery(number)
    sys.unraisablehook = _repeat_dropped_interrupt


@contextmanager
def interruptible() -> Generator[None]:
    """Raise KeyboardInterrupt again where code in C made another exception of it, as comparisons in numpy do."""
    try:
        yield
    except Exception as fault:
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:  # which `_interrupt` sets
            raise KeyboardInterrupt from fault
        raise


def _interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt; a second signal ends the process at once, as kill -9 may at any moment."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt


def _reset_on_delivery(number: int) -> None:
    """Let the system itself end the process on a second signal: code in C may keep Python from handling the first."""
    libc = ctypes.CDLL(None)
    if hasattr(libc, "sysv_signal"):
        libc.signal.restype = ctypes.c_void_p
        libc.sysv_signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        libc.sysv_signal(number, libc.signal(number, ctypes.c_void_p(int(signal.SIG_IGN))))


@cache
def _watch_signals() -> int:
    """Start the thread that ends commands which do not end in order; return where Python writes signals for it."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    threading.Thread(target=_end_late, args=(reader,), name="armwright-signals", daemon=True).start()
    return writer


def _end_late(reader: int) -> None:
    while True:
        number, installed = os.read(reader, 1)[0], _installed
        if number not in _SIGNALS or not _is_ending(installed):  # a server that handles signals gets this one
            continue
        for stream in (1, 2):
            if os.isatty(stream):
                _write(stream, _SHOW_CURSOR)
        if _stays_quiet(reader, REPORT_SECONDS) and _is_ending(installed):
            _write(2, f"\narmwright: waiting for {_what_is_awaited()}; Ctrl-C again ends at once\n")
            if _stays_quiet(reader, END_SECONDS - REPORT_SECONDS) and _is_ending(installed):
                _write(2, f"armwright: ended without {_what_is_awaited()}\n")
        if _is_ending(installed):
            os._exit(INTERRUPTED)


def _stays_quiet(reader: int, seconds: float) -> bool:
    """Wait for another signal; return whether there was none."""
    return not select.select([reader], [], [], seconds)[0]


def _is_ending(installed: int) -> bool:
    """Return whether the program that was interrupted has still to end: nobody else has taken its signals since."""
    handler = signal.getsignal(signal.SIGINT)
    return installed == _installed and handler in (_interrupt, signal.SIG_DFL, signal.SIG_IGN)


def _what_is_awaited() -> str:
    """Return the module outside the standard library that the main thread is in, such as an evaluator's."""
    frames = sys._current_frames()  # pyright: ignore[reportPrivateUsage] (documented)
    frame = frames.get(threading.main_thread().ident or 0)
    modules = (str(at.f_globals.get("__name__")) for at, _ in traceback.walk_stack(frame))
    found = next((name for name in modules if name.partition(".")[0] not in sys.stdlib_module_names), "Python")
    return found.replace("armwright_evaluator_", "the evaluator ")  # a file that --evaluator names


def _write(stream: int, text: str) -> None:
    try:
        os.write(stream, text.encode())
    except OSError:  # closed, or nobody reads it
        return


def _repeat_dropped_interrupt(unraisable: "sys.UnraisableHookArgs") -> None:
    """Send an interrupt again that Python dropped, as in finalisers and callbacks."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    for number in _SIGNALS:
        signal.signal(number, _interrupt)
    again = threading.Timer(0.01, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
    again.daemon = True
    again.start()
