"""Read trials.jsonl: one line per finished trial, written before the next begins."""

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
            return _parse_trials(file, path, config)
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


def _parse_trials(file: BinaryIO, path: Path, config: RunConfig) -> tuple[list[FinishedTrial], int]:
    """Parse all trials, and the length [bytes] without a truncated last line."""
    end = 0
    trials: list[FinishedTrial] = []
    for number, line in enumerate(read_records(file, path)):
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
