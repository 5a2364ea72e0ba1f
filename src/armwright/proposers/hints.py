"""Hints that wait for a question to go with."""

import threading
from collections.abc import Iterable
from pathlib import Path

from armwright.llm.transcript import Transcript, used_hints
from armwright.runs.control import ControlFile, Hint


class Hints:
    """The hints of a run, each for one question; several threads may ask at a time."""

    def __init__(self, folder: Path | None) -> None:
        self._control = ControlFile(folder)
        self._under_way: set[Hint] = set()
        self._lock = threading.Lock()

    def take(self, transcript: Transcript) -> tuple[Hint, ...]:
        """Those that no call has used; as long as they are not given back, no other question gets them."""
        with self._lock:
            gone = self._under_way | used_hints(transcript.calls).keys()
            taken = tuple(hint for hint in self._control.read().hints if hint not in gone)
            self._under_way.update(taken)
        return taken

    def give_back(self, hints: Iterable[Hint]) -> None:
        """The question that they went with has ended; the transcript says whether it used them."""
        with self._lock:
            self._under_way.difference_update(hints)
