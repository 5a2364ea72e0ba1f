"""The line that says what a command is doing."""

import io
import sys

import pytest

from armwright.cli.streams import activity


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_only_terminals_show_what_is_being_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for stream, is_shown in ((Screen(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        with pytest.raises(ValueError, match="broken"), activity("drawing [figures]"):
            raise ValueError("broken")
        assert ("drawing [figures]" in stream.getvalue()) == is_shown
        assert stream.getvalue().endswith("\x1b[2K" if is_shown else "")  # the line is gone in the end
