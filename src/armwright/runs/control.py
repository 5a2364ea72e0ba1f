"""Between a running study and whoever watches it from another process: two small files in the run folder.

control.json   what is asked of the study: to pause, to stop, hints for its language model; written by the watcher
status.json    what the study does; written by the study when that changes

Neither waits for the other, and a study without a watcher is the same study.
"""

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeVar

from filelock import FileLock
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from armwright.exceptions import RunFolderError, SettingsError
from armwright.files import replace_file, replace_surrogates

CONTROL = "control.json"
STATUS = "status.json"
LOCK = ".control.lock"  # held while control.json is changed, for there may be several watchers
CHANNEL_FILES = (CONTROL, f"{CONTROL}.part", STATUS, f"{STATUS}.part", LOCK)
LONGEST_HINT = 2_000  # characters
MOST_HINTS = 100  # of a run
LARGEST_FILE = 4 * 1024 * 1024  # [bytes]; the most hints, each letter escaped, have some 2.4 MB
LOCK_SECONDS = 5.0  # that a change waits for others

Doing = Literal["evaluating", "asking", "paused", "stopped", "finished"]


@dataclass(frozen=True)
class Hint:
    """A hint to the language model, for its next prompt only."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", strict=True)

    id: Annotated[int, Field(ge=1)]
    text: Annotated[str, Field(min_length=1, max_length=LONGEST_HINT)]


class Control(BaseModel, frozen=True, extra="forbid", strict=True):
    """A request to a study.

    paused: no trial begins.  stop: its session ends before the next trial.
    hints: all of the run, those that were used included, by rising id.
    """

    paused: bool = False
    stop: bool = False
    hints: tuple[Hint, ...] = Field(default=(), max_length=MOST_HINTS)

    @field_validator("hints")
    @classmethod
    def _ids_rise(cls, hints: tuple[Hint, ...]) -> tuple[Hint, ...]:
        ids = [hint.id for hint in hints]
        if ids != sorted(set(ids)):
            raise ValueError("the ids of hints must rise")
        return hints


class Status(BaseModel, frozen=True, extra="forbid", strict=True):
    """The status of a study.

    pid: of its process, which may have been killed since.
    number: the trial that it came to when it began to do so; of a finished study, how many trials there are.
    since: when it began to do so [s since 1970]; by a wrong clock before that.
    fault: why the last question, or the session, failed; empty where it did not.
    """

    pid: int = Field(gt=0, lt=2**31)
    doing: Doing
    number: int = Field(ge=0, lt=2**31)
    since: float = Field(allow_inf_nan=False)
    fault: str = ""


Content = TypeVar("Content", bound=BaseModel)


def read_control(folder: Path) -> Control:
    """Return the request for the study in a run folder; empty if the file is missing or damaged."""
    return _read(folder / CONTROL, Control) or Control()


def read_status(folder: Path) -> Status | None:
    """Return the status of the study in a run folder, if it has written one."""
    return _read(folder / STATUS, Status)


def pause_study(folder: Path) -> None:
    """Begin no new trial until `resume_study`."""
    _change(folder, lambda asked: asked.model_copy(update={"paused": True}))


def resume_study(folder: Path) -> None:
    """Continue a paused study."""
    _change(folder, lambda asked: asked.model_copy(update={"paused": False}))


def stop_study(folder: Path) -> None:
    """End the study's session after the current trial, or at once if it is paused."""
    _change(folder, lambda asked: asked.model_copy(update={"stop": True}))


def add_hint(folder: Path, text: str) -> Hint:
    """Give the language model a hint for its next prompt; SettingsError if the text is empty or too long."""
    message = replace_surrogates(text).strip()
    if not 1 <= len(message) <= LONGEST_HINT:
        raise SettingsError(f"a hint of {len(message):,} characters: from 1 to {LONGEST_HINT:,} are possible")

    def added(asked: Control) -> Control:
        if len(asked.hints) >= MOST_HINTS:
            raise SettingsError(f"{folder} has {MOST_HINTS} hints, and more are not possible")
        hint = Hint(asked.hints[-1].id + 1 if asked.hints else 1, message)
        return asked.model_copy(update={"hints": (*asked.hints, hint)})

    return _change(folder, added).hints[-1]


class ControlFile:
    """control.json of a run folder, parsed again only where it has changed; without a folder nothing is ever asked."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._seen: tuple[int, int, int] | None = None  # the file's time [ns], size [bytes] and place
        self._asked = Control()

    def read(self) -> Control:
        """Return the current request."""
        if self._folder is None:
            return self._asked
        try:
            there = os.stat(self._folder / CONTROL)
        except OSError:
            self._seen, self._asked = None, Control()
            return self._asked
        seen = there.st_mtime_ns, there.st_size, there.st_ino
        if seen != self._seen:
            self._seen, self._asked = seen, read_control(self._folder)
        return self._asked


class Channel:
    """The study's end: what is asked of it, and what it says of itself. Without a folder nobody is at the other end."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._control = ControlFile(folder)
        self._said: Status | None = None  # in this session

    def begin(self, number: int) -> None:
        """Begin a session with this trial; clear earlier requests, but keep hints."""
        earlier = self.asked()
        if self._folder is not None and (earlier.paused or earlier.stop):
            _change(self._folder, lambda asked: Control(hints=asked.hints))
        self.say("evaluating", number)

    def asked(self) -> Control:
        """Return the current request."""
        return self._control.read()

    def say(self, doing: Doing, number: int, fault: str | None = None) -> None:
        """Write the status if it has changed; ignore a file that cannot be written.

        fault: None where there is nothing new to say of it.
        """
        if self._folder is None:
            return
        before = self._said
        message = before.fault if before is not None and fault is None else replace_surrogates(fault or "")
        if before is not None and (doing, message) == (before.doing, before.fault):
            return
        since = before.since if before is not None and doing == before.doing else time.time()
        self._said = Status(pid=os.getpid(), doing=doing, number=number, since=since, fault=message)
        with suppress(OSError):
            replace_file(self._folder / STATUS, self._said.model_dump_json().encode())

    def finish(self, number: int) -> None:
        """Mark the study as finished, unless an earlier session did."""
        there = None if self._folder is None else read_status(self._folder)
        if self._said is not None or there is None or there.doing != "finished":
            self.say("finished", number)


def _change(folder: Path, change: Callable[[Control], Control]) -> Control:
    """Replace the request by the result of `change`."""
    try:
        with FileLock(folder / LOCK, timeout=LOCK_SECONDS):
            asked = change(read_control(folder))
            replace_file(folder / CONTROL, asked.model_dump_json().encode())
    except OSError as fault:
        raise RunFolderError(f"cannot write {folder / CONTROL}: {fault.strerror or fault}") from fault
    return asked


def _read(path: Path, schema: type[Content]) -> Content | None:
    """Return the content of a file that another process wrote; None if it is unusable."""
    try:
        if not path.is_file() or path.stat().st_size > LARGEST_FILE:
            return None
        return schema.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return None
