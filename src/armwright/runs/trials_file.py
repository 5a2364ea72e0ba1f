"""Read trials.jsonl: one line per finished trial, written before the next begins."""

from pathlib import Path

from armwright.files import read_log
from armwright.runs.config import RunConfig
from armwright.runs.trial import FinishedTrial, parse_trial

TRIALS = "trials.jsonl"


def read_trials(path: Path, config: RunConfig) -> tuple[list[FinishedTrial], int]:
    """Read the trials of a file, and its length [bytes] without a truncated last line."""
    return read_log(
        path,
        lambda line, number: parse_trial(line, number, config),
        "restore the file, or delete this line and all after it: the same command resumes from there",
    )


def count_trials(path: Path) -> int:
    """Return the number of lines of a file, which are not read as trials; 0 without a file."""
    return len(read_log(path, lambda line, _: line, "")[0])
