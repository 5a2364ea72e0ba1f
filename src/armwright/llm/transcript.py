"""The transcript of a run: every call with its prompt, answer and cost, as one JSON line."""

import errno
import json
import os
import threading
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from io import FileIO
from pathlib import Path

from pydantic import TypeAdapter

from armwright.files import naming_write_errors, open_to_append, read_log
from armwright.llm.backend import Question, Reply

TRANSCRIPTS = "transcripts.jsonl"  # in a run folder
FIRST_STEPS = ("reasoning", "answer")  # steps whose prompts show the history
LAST_STEPS = ("parameters", "answer")  # steps whose answers are designs


@dataclass(frozen=True)
class Call(Reply, Question):
    """One call: the question, the reply, and who answered."""

    origin: str = field(kw_only=True)  # what answered: `model`, `manual` (a person) or `scripted` (a stand-in)
    model: str = field(kw_only=True)
    fault: str | None = None  # kind of fault, if there was one; then the answer may be empty
    error: str | None = None  # its message


CALL = TypeAdapter(Call)  # reads a line


class Transcript:
    """The calls of one run, recorded in a file, or kept in memory without a path; several threads may add to it.

    If it is `read_only`, a last line that a crash cut short stays in the file.
    """

    def __init__(self, path: Path | None, read_only: bool = False) -> None:
        self._path = path
        self._calls = _read(path, mend=not read_only) if path is not None else []
        self._lock = threading.Lock()

    @property
    def calls(self) -> tuple[Call, ...]:
        """All calls, earlier sessions included."""
        return tuple(self._calls)

    def add(self, call: Call) -> None:
        """Record a call on disk before returning, because its answer was paid for."""
        with self._lock:
            self._calls.append(call)
            if self._path is None:
                return
            with naming_write_errors(self._path), open_to_append(self._path) as file:
                stated = {name: value for name, value in asdict(call).items() if value or name != "output_mode"}
                _append(file, (json.dumps(stated) + "\n").encode())

    def answered(self, proposal: str, step: str) -> Call | None:
        """Return the call that answered this step of a proposal, if any."""
        return last_call([call for call in self._calls if call.fault is None], proposal, step)


def n_requests(calls: Iterable[Call]) -> int:
    """Return the number of requests, at least one per call."""
    return sum(max(1, call.requests) for call in calls)


def total_cost(calls: Iterable[Call]) -> float | None:
    """Return the cost of all answers [USD]; None if a price is unknown."""
    costs = [call.cost_usd for call in calls if call.requests]
    return None if None in costs else sum(cost for cost in costs if cost is not None)


def last_call(calls: Sequence[Call], proposal: str, *steps: str) -> Call | None:
    """Return the last call for these steps of a proposal: an interrupted run may have repeated a question."""
    return next((call for call in reversed(calls) if call.proposal == proposal and call.step in steps), None)


def _append(file: FileIO, line: bytes) -> None:
    """Append a whole line or nothing: a partial line would corrupt the next one, perhaps of another thread."""
    before = os.fstat(file.fileno()).st_size
    try:
        if file.write(line) != len(line):
            raise OSError(errno.ENOSPC, "No space left on device")
        os.fsync(file.fileno())
    except OSError:
        file.truncate(before)
        raise


def _read(path: Path, mend: bool) -> list[Call]:
    """Read the calls of a file; `mend` removes a last line that a crash cut short."""
    calls, end = read_log(path, lambda line, _: CALL.validate_json(line), "restore the file or delete the line")
    if mend and path.is_file() and path.stat().st_size > end:
        with naming_write_errors(path):
            os.truncate(path, end)
    return calls
