"""Read and write trials.jsonl: one line a finished trial, written before the next begins."""

import os
from pathlib import Path

from pydantic import ValidationError

from armwright.exceptions import DesignError, RunFolderError
from armwright.runs.config import RunConfig
from armwright.runs.trial import FinishedTrial, parse_trial
from armwright.spaces.design_space import DesignSpace

TRIALS = "trials.jsonl"


def read_trials(
    path: Path, space: DesignSpace, n_objectives: int, n_constraints: int
) -> tuple[list[FinishedTrial], int]:
    """Read the trials of a file, and its length [bytes] without a truncated last line."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return [], 0
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault
    return parse_trials(content, 0, path, space, n_objectives, n_constraints)


def parse_trials(
    content: bytes, first: int, path: Path, space: DesignSpace, n_objectives: int, n_constraints: int
) -> tuple[list[FinishedTrial], int]:
    """Parse the trials from number `first` on, and the length [bytes] without a truncated last line."""
    end = content.rfind(b"\n") + 1
    trials: list[FinishedTrial] = []
    for number, line in enumerate(content[:end].split(b"\n")[:-1], start=first):
        try:
            trials.append(parse_trial(line, number, space, n_objectives, n_constraints))
        except (ValueError, DesignError) as fault:
            raise RunFolderError(
                f"{path}, line {number + 1} is damaged ({_message(fault)}); restore the file, or delete this line and "
                "all after it: the same command then goes on from there"
            ) from fault
    return trials, end


class TrialsReader:
    """Reader of a growing trials file that reads each line once."""

    def __init__(self, folder: Path, config: RunConfig) -> None:
        self._path = folder / TRIALS
        self._config = config
        self.trials: list[FinishedTrial] = []
        self._at = 0  # [bytes] read
        self._file = 0  # which file it was

    def read_on(self) -> bool:
        """Read new trials; return whether the file was replaced, as by a refinement, and read from its start."""
        try:
            with self._path.open("rb") as file:
                there = os.fstat(file.fileno())
                is_other = there.st_ino != self._file or there.st_size < self._at
                file.seek(0 if is_other else self._at)
                content = file.read()
        except FileNotFoundError:
            there, is_other, content = None, bool(self.trials), b""
        except OSError as fault:
            raise RunFolderError(f"cannot read {self._path}: {fault.strerror or fault}") from fault
        if is_other:
            self.trials, self._at = [], 0
            self._file = 0 if there is None else there.st_ino
        try:
            new, length = self._parsed(content)
        except RunFolderError:
            if self._at == 0:
                raise
            self.trials, self._at = [], 0  # written anew in place, perhaps, and longer than what was read
            is_other = True
            new, length = self._parsed(self._path.read_bytes())
        self.trials = [*self.trials, *new]
        self._at += length
        return is_other

    def _parsed(self, content: bytes) -> tuple[list[FinishedTrial], int]:
        config = self._config
        n_objectives, n_constraints = len(config.objectives), len(config.task.constraints)
        return parse_trials(content, len(self.trials), self._path, config.space, n_objectives, n_constraints)


def _message(fault: Exception) -> str:
    if not isinstance(fault, ValidationError):
        return str(fault)
    first = fault.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}".removeprefix(": ")
