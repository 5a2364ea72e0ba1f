"""Every call to a language model, one JSON line each: what was asked, what came back, what it cost."""

import errno
import json
import os
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from io import FileIO
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from armwright.exceptions import RunFolderError
from armwright.runs.control import Hint

TRANSCRIPTS = "transcripts.jsonl"  # in a run folder
FIRST_STEPS = ("reasoning", "answer")  # the steps whose questions are made from the history, and go with hints
READ = (None, "answer", "limit", "refused", "rejected", "context")  # how calls end whose question was read

Count = Annotated[int, Field(ge=0, lt=2**53)]


@dataclass(frozen=True)
class Call:
    """One call.

    proposal: the id of the proposal that it belongs to, its asker and its trial's number; empty for a check.
    step: check (may the model be used at all), reasoning (the free answer), parameters (that answer as values), or
        answer (both at once), draft (a task and a space from words).
    known: how many finished trials the question was made from.
    origin: who answered: `model`, `manual` (people) or `scripted` (a stand-in, in tests and examples).
    requests: requests sent to the server; above 1 where an answer was refused and asked for again.
    fault, error: the fault's kind and words, where there was one; then the answer may be empty.
    hints: of the engineer who watches the run, that stand in the prompt.
    """

    proposal: Annotated[str, Field(pattern=r"^(.*-\d{1,9})?$")]
    step: str
    known: Count
    origin: str
    model: str
    prompt: str
    answer: str
    requests: Count
    input_tokens: Count
    output_tokens: Count
    cost_usd: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None
    seconds: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    fault: str | None = None
    error: str | None = None
    hints: tuple[Hint, ...] = ()


class Transcript:
    """The calls of one run, kept in a file where the run has a folder; several threads may add to it.

    read_only: for a record that is none of this run's; a last line that a crash cut short stays in its file.
    """

    def __init__(self, path: Path | None, read_only: bool = False) -> None:
        self._path = path
        self._calls = list(_read(path, mend=not read_only)) if path is not None else []
        self._lock = threading.Lock()

    @property
    def calls(self) -> tuple[Call, ...]:
        """All calls so far, those of earlier sessions of the run included."""
        return tuple(self._calls)

    def add(self, call: Call) -> None:
        """Record a call on disk before returning, because its answer was paid for."""
        with self._lock:
            self._calls.append(call)
            if self._path is None:
                return
            try:
                with open(self._path, "ab", buffering=0) as file:
                    _append(file, (json.dumps(_record(call)) + "\n").encode())
            except OSError as fault:
                raise RunFolderError(f"cannot write {self._path}: {fault.strerror or fault}") from fault

    def answered(self, proposal: str, step: str) -> Call | None:
        """Return the call that answered this step of a proposal, if any."""
        found = [c for c in self._calls if (c.proposal, c.step) == (proposal, step) and c.fault is None]
        return found[-1] if found else None


def used_hints(calls: Iterable[Call]) -> dict[Hint, str]:
    """Return the used hints and their proposals.

    A hint is used by the call that carried it to the model, whatever came back. Where nothing was read (no connection,
    no answer in time, Ctrl-C), it goes with the next question.
    """
    return {hint: call.proposal for call in calls if call.fault in READ for hint in call.hints}


def hints_of(calls: Sequence[Call], proposal: str) -> tuple[Hint, ...]:
    """Return the hints in the latest prompt for a proposal."""
    asked = (call for call in reversed(calls) if call.proposal == proposal and call.step in FIRST_STEPS)
    return next((call.hints for call in asked), ())


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


def _record(call: Call) -> dict[str, Any]:
    record = asdict(call)
    if not call.hints:
        del record["hints"]
    return record


def _read(path: Path, mend: bool) -> Iterator[Call]:
    """Read the calls of a file; `mend` removes a last line that a crash cut short."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault
    end = content.rfind(b"\n") + 1
    if mend and end < len(content):
        try:
            os.truncate(path, end)
        except OSError as fault:
            raise RunFolderError(f"cannot write {path}: {fault.strerror or fault}") from fault
    for number, line in enumerate(content[:end].split(b"\n")[:-1], start=1):
        try:
            yield _CALL.validate_json(line)
        except ValidationError as fault:
            raise RunFolderError(f"{path}, line {number} is damaged; restore the file or delete the line") from fault


_CALL = TypeAdapter(Call)
