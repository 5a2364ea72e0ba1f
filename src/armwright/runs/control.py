"""Control of a running study from another process, by two small files in the run folder.

control.json   the request to stop; written by the watcher
status.json    activity of the study, written by the study when it changes

Neither process waits for the other, and a study gives the same trials without a watcher.
"""

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, Field

from armwright.files import naming_write_errors, read_bytes, replace_file, replace_surrogates

CONTROL = "control.json"
STATUS = "status.json"
CHANNEL_FILES = (CONTROL, STATUS)
MAX_FILE_SIZE = 1024 * 1024  # [bytes]; the message of a fault may be long

Doing = Literal["evaluating", "asking", "stopped", "finished"]


class Control(BaseModel, frozen=True, extra="forbid", strict=True):
    """A request to a study."""

    stop: bool = False  # the session ends before the next trial


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


def stop_study(folder: Path) -> None:
    """End the study's session after the current trial."""
    _write(folder, Control(stop=True))


class Channel:
    """The study's end of the channel: reads requests and writes the status. Without a folder there is no watcher."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._status: Status | None = None  # written in this session

    def begin(self, number: int) -> None:
        """Begin a session with this trial; clear earlier requests."""
        if self._folder is not None and self.control() != Control():
            _write(self._folder, Control())
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


def _write(folder: Path, control: Control) -> None:
    with naming_write_errors(folder / CONTROL):
        replace_file(folder / CONTROL, control.model_dump_json().encode())


def _read(path: Path, schema: type[Content]) -> Content | None:
    """Return the content of a file that another process wrote; None if it is missing or damaged."""
    try:
        return schema.model_validate_json(read_bytes(path, MAX_FILE_SIZE, ValueError)) if path.is_file() else None
    except ValueError:  # includes pydantic's
        return None
