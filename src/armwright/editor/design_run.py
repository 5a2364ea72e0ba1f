"""`armwright design` in a process of its own, started by the page."""

import subprocess
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from armwright.child_process import start_module

MAX_LINES = 200  # of output that are kept
MAX_LINE = 2_000  # characters
PATIENCE = 20.0  # [s] in which an interrupted search ends by itself


class DesignRun:
    """A search for designs. It goes on while the page is closed, and ends with the editor.

    `seconds` is the time that the whole command takes [s].
    """

    def __init__(self, task: Path, space: Path, seconds: float, folder: Path) -> None:
        self.folder = folder
        self.seconds = seconds
        self._began = time.monotonic()
        self._lines: deque[str] = deque(maxlen=MAX_LINES)
        options = ["--space", str(space), "--budget", f"{seconds:g}s", "--out", str(folder)]
        # Ctrl-C in the terminal reaches the editor, which then ends the search in order.
        self._process = start_module(
            "armwright", "design", *options, "--", task, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, encoding="utf-8", errors="replace",
            env={"PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8"},
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def is_running(self) -> bool:
        """Whether the search has not ended."""
        return self._process.poll() is None

    def status(self) -> dict[str, Any]:
        """Return the state of the search, in JSON types."""
        return {
            "running": self.is_running,
            "exit_code": self._process.poll(),
            "folder": str(self.folder),
            "seconds": self.seconds,
            "elapsed": time.monotonic() - self._began,
            "lines": list(self._lines),
        }

    def stop(self) -> None:
        """End the search; what it found so far stays in its folder."""
        if self.is_running:
            self._process.terminate()  # not SIGINT, which the processes of a shell's background job ignore

    def close(self) -> None:
        """End the search and wait for its end."""
        self.stop()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as output:
            for line in output:
                self._lines.append(line.rstrip()[:MAX_LINE])


def next_folder(name: str) -> Path:
    """Return the first folder runs/NAME-1, runs/NAME-2, ... that does not exist."""
    number = 1
    while (folder := Path("runs") / f"{name}-{number}").exists():
        number += 1
    return folder
