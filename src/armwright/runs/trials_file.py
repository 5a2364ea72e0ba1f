"""Read trials.jsonl: one line per finished trial, written before the next begins."""

import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from pydantic import ValidationError

from armwright.exceptions import DesignError, RunFolderError
from armwright.files import read_records
from armwright.runs.config import RunConfig
from armwright.runs.trial import FinishedTrial, parse_trial

TRIALS = "trials.jsonl"


def read_trials(path: Path, config: RunConfig) -> tuple[list[FinishedTrial], int]:
    """Read the trials of a file, and its length [bytes] without a truncated last line."""
    try:
        with path.open("rb") as file:
            return _parse_trials(file, 0, path, config)
    except FileNotFoundError:
        return [], 0
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault


def count_trials(path: Path) -> int:
    """Return the number of lines of a file, which are not read as trials; 0 without a file."""
    if not path.is_file():
        return 0
    with path.open("rb") as file:
        return sum(1 for _ in read_records(file, path))


class TrialsReader:
    """Reader of a growing trials file that reads each line once."""

    def __init__(self, folder: Path, config: RunConfig) -> None:
        self._path = folder / TRIALS
        self._config = config
        self.trials: list[FinishedTrial] = []
        self._length = 0  # [bytes] read
        self._inode = 0

    def read_on(self) -> bool:
        """Read new trials; return whether those read before were replaced, as by a longer direct search."""
        with suppress(OSError, RunFolderError), self._path.open("rb") as file:  # read_trials raises them again
            status = os.fstat(file.fileno())
            is_same, self._inode = status.st_ino == self._inode, status.st_ino
            if is_same and status.st_size >= self._length:
                file.seek(self._length)
                new, length = _parse_trials(file, len(self.trials), self._path, self._config)
                self.trials = [*self.trials, *new]
                self._length += length
                return False
        had_trials = bool(self.trials)
        self.trials, self._length = read_trials(self._path, self._config)
        return had_trials


def _parse_trials(file: BinaryIO, first: int, path: Path, config: RunConfig) -> tuple[list[FinishedTrial], int]:
    """Parse the trials from number `first` on, and the length [bytes] without a truncated last line."""
    end = 0
    trials: list[FinishedTrial] = []
    for number, line in enumerate(read_records(file, path), start=first):
        end += len(line) + 1
        try:
            trials.append(parse_trial(line, number, config))
        except (ValueError, DesignError) as fault:
            raise RunFolderError(
                f"{path}, line {number + 1} is damaged ({_message(fault)}); restore the file, or delete this line and "
                "all after it: the same command resumes from there"
            ) from fault
    return trials, end


def _message(fault: Exception) -> str:
    if not isinstance(fault, ValidationError):
        return str(fault)
    first = fault.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg'].removeprefix('Value error, ')}".removeprefix(": ")
