"""The line that says what a command is doing."""

import io
import sys
import threading

import pytest

from armwright.cli.activity import activity
from tests.support.command_line import PATIENCE


class Screen(io.StringIO):
    """A terminal that notices when something is written."""

    def __init__(self) -> None:
        super().__init__()
        self.written = threading.Event()

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if "drawing" in text:
            self.written.set()
        return super().write(text)


def test_terminals_show_what_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    for quiet, delay in ((Screen(), PATIENCE), (io.StringIO(), 0.0)):  # of short work, and of a pipe
        monkeypatch.setattr(sys, "stderr", quiet)
        with activity("drawing", delay=delay):
            pass
        assert "drawing" not in quiet.getvalue()
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with activity("drawing [figures]", delay=0.0):
        assert screen.written.wait(PATIENCE)
    assert "drawing [figures]" in screen.getvalue()
    assert screen.getvalue().endswith("\x1b[2K")  # the line is gone in the end


def test_errors_end_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Screen())
    with pytest.raises(ValueError, match="broken"), activity("drawing", delay=PATIENCE):
        raise ValueError("broken")
    assert not [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]
