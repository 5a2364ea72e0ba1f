"""The line that says what a command is doing."""

import io
import sys
import threading

import pytest

from armwright.cli.activity import activity
from tests.support.command_line import PATIENCE


class Screen(io.StringIO):
    """A terminal, or a pipe, that notices when something is written."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__()
        self.is_terminal = is_terminal
        self.written = threading.Event()

    def isatty(self) -> bool:
        return self.is_terminal

    def write(self, text: str) -> int:
        if "drawing" in text:
            self.written.set()
        return super().write(text)


def test_terminal_shows_what_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(is_terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with activity("drawing [figures]", delay=0.0):
        assert screen.written.wait(PATIENCE)
    assert "drawing [figures]" in screen.getvalue()
    assert screen.getvalue().endswith("\x1b[2K")  # the line is gone in the end


def test_short_work_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(is_terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    with activity("drawing", delay=PATIENCE):
        pass
    assert "drawing" not in screen.getvalue()


def test_pipes_get_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(is_terminal=False)
    monkeypatch.setattr(sys, "stderr", screen)
    with activity("drawing", delay=0.0):
        pass
    assert screen.getvalue() == ""


def test_errors_end_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Screen(is_terminal=True))
    with pytest.raises(ValueError, match="broken"), activity("drawing", delay=PATIENCE):
        raise ValueError("broken")
    assert not [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]
