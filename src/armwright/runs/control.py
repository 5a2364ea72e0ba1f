"""Control of a running study from another process, by two small files in the run folder.

control.json   requests: pause, stop, hints for the language model; written by the watcher
status.json    activity of the study, written by the study when it changes

Neither process waits for the other, and a study gives the same trials without a watcher.
"""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, field_validator

from armwright.exceptions import SettingsError
from armwright.files import naming_write_errors, read_bytes, replace_file, replace_surrogates
from armwright.runs.private_lock import private_lock

CONTROL = "control.json"
STATUS = "status.json"
LOCK = ".control.lock"  # held while control.json is changed; there may be several watchers
CHANNEL_FILES = (CONTROL, STATUS, LOCK)
MAX_HINT_LENGTH = 2_000  # characters
MAX_HINTS = 100  # of a run
MAX_FILE_SIZE = 4 * 1024 * 1024  # [bytes]; the longest allowed hints, each letter escaped, take about 2.4 MB
LOCK_SECONDS = 5.0  # to wait for changes by other watchers

Doing = Literal["evaluating", "asking", "paused", "stopped", "finished"]


@dataclass(frozen=True)
class Hint:
    """A hint to the language model, for its next prompt only."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", strict=True)

    id: Annotated[int, Field(ge=1)]
    text: Annotated[str, Field(min_length=1, max_length=MAX_HINT_LENGTH)]


class Control(BaseModel, frozen=True, extra="forbid", strict=True):
    """A request to a study."""

    paused: bool = False  # no trial begins
    stop: bool = False  # the session ends before the next trial
    hints: tuple[Hint, ...] = Field(default=(), max_length=MAX_HINTS)  # all of the run, used ones too, by increasing id

    @field_validator("hints")
    @classmethod
    def _ids_rise(cls, hints: tuple[Hint, ...]) -> tuple[Hint, ...]:
        ids = [hint.id for hint in hints]
        if ids != sorted(set(ids)):
            raise ValueError("expected increasing ids of hints")
        return hints


class Status(BaseModel, frozen=True, extra="forbid", strict=True):
    """The status of a study."""

    pid: int = Field(gt=0, lt=2**31)  # its process, which may have been killed since
    doing: Doing
    number: int = Field(ge=0, lt=2**31)  # trial at which the activity began; number of trials of a finished study
    since: float = Field(allow_inf_nan=False)  # when the activity began [s since 1970]
    fault: str = ""  # why the last request to the model, or the session, failed; empty if it did not


Content = TypeVar("Content", bound=BaseModel)


def read_control(folder: Path | None) -> Control:
    """Return the request for the study in a run folder; empty if the file is missing or damaged."""
    return (None if folder is None else _read(folder / CONTROL, Control)) or Control()


def read_status(folder: Path) -> Status | None:
    """Return the status of the study in a run folder, if it has written one."""
    return _read(folder / STATUS, Status)


def pause_study(folder: Path) -> None:
    """Begin no new trial until `resume_study`."""
    _change(folder, lambda control: control.model_copy(update={"paused": True}))


def resume_study(folder: Path) -> None:
    """Continue a paused study."""
    _change(folder, lambda control: control.model_copy(update={"paused": False}))


def stop_study(folder: Path) -> None:
    """End the study's session after the current trial, or at once if it is paused."""
    _change(folder, lambda control: control.model_copy(update={"stop": True}))


def add_hint(folder: Path, text: str) -> Hint:
    """Give the language model a hint for its next prompt; SettingsError if the text is empty or too long."""
    message = replace_surrogates(text).strip()
    if not 1 <= len(message) <= MAX_HINT_LENGTH:
        raise SettingsError(f"expected a hint of 1 to {MAX_HINT_LENGTH:,} characters, got {len(message):,}")

    def add(control: Control) -> Control:
        if len(control.hints) >= MAX_HINTS:
            raise SettingsError(f"expected at most {MAX_HINTS} hints for a run; {folder} has as many already")
        hint = Hint(control.hints[-1].id + 1 if control.hints else 1, message)
        return control.model_copy(update={"hints": (*control.hints, hint)})

    return _change(folder, add).hints[-1]


class Channel:
    """The study's end of the channel: reads requests and writes the status. Without a folder there is no watcher."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._status: Status | None = None  # written in this session

    def begin(self, number: int) -> None:
        """Begin a session with this trial; clear earlier requests, but keep hints."""
        earlier = self.control()
        if self._folder is not None and (earlier.paused or earlier.stop):
            _change(self._folder, lambda control: Control(hints=control.hints))
        self.report("evaluating", number)

    def control(self) -> Control:
        """Return the current request."""
        return read_control(self._folder)

    def report(self, doing: Doing, number: int, fault: str | None = None) -> None:
        """Write the status if it has changed; ignore a file that cannot be written.

        `fault` says why the last request to the model failed: empty if it did not, None if nothing has changed.
        """
        if self._folder is None:
            return
        old = self._status
        message = old.fault if old is not None and fault is None else replace_surrogates(fault or "")
        if old is not None and (doing, message) == (old.doing, old.fault):
            return
        since = old.since if old is not None and doing == old.doing else time.time()
        self._status = Status(pid=os.getpid(), doing=doing, number=number, since=since, fault=message)
        with suppress(OSError):
            replace_file(self._folder / STATUS, self._status.model_dump_json().encode())

    def finish(self, number: int) -> None:
        """Mark the study as finished, unless an earlier session did."""
        written = None if self._folder is None else read_status(self._folder)
        if self._status is not None or written is None or written.doing != "finished":
            self.report("finished", number)


def _change(folder: Path, change: Callable[[Control], Control]) -> Control:
    """Replace the request by the result of `change`."""
    with naming_write_errors(folder / CONTROL), private_lock(folder / LOCK, LOCK_SECONDS):
        control = change(read_control(folder))
        replace_file(folder / CONTROL, control.model_dump_json().encode())
    return control


def _read(path: Path, schema: type[Content]) -> Content | None:
    """Return the content of a file that another process wrote; None if it is missing or damaged."""
    try:
        return schema.model_validate_json(read_bytes(path, MAX_FILE_SIZE, ValueError)) if path.is_file() else None
    except ValueError:  # includes pydantic's
        return None
