"""End commands in order on Ctrl-C and SIGTERM."""

import signal
import sys
import threading

INTERRUPTED = 130  # exit code of a shell for Ctrl-C
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def install_handlers() -> None:
    """Turn SIGINT and SIGTERM into KeyboardInterrupt, unless the shell ignores them for background jobs."""
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = _repeat_dropped_interrupt


def _interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt; a second signal ends the process at once, as kill -9 may at any moment."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt


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
