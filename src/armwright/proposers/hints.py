"""Hints of the user that wait for the next question to a model."""

import threading
from collections.abc import Iterable
from pathlib import Path

from armwright.llm.transcript import Transcript, used_hints
from armwright.runs.control import Hint, read_control


class Hints:
    """The hints of a run, each for one question; safe to use from several threads."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._under_way: set[Hint] = set()
        self._lock = threading.Lock()

    def take(self, transcript: Transcript) -> tuple[Hint, ...]:
        """Take the unused hints; no other question gets them until they are given back."""
        with self._lock:
            used = self._under_way | used_hints(transcript.calls).keys()
            taken = tuple(hint for hint in read_control(self._folder).hints if hint not in used)
            self._under_way.update(taken)
        return taken

    def give_back(self, hints: Iterable[Hint]) -> None:
        """Return hints after their question has ended; the transcript shows whether they were used."""
        with self._lock:
            self._under_way.difference_update(hints)
