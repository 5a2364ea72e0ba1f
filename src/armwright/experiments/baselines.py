"""Stored results of the usual methods on the built-in tasks, to compare a run with.

They are in baselines.csv, written by benchmarks/baselines.py from `armwright experiment suite`.
"""

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

from pydantic import TypeAdapter

BASELINES = "baselines.csv"


@dataclass(frozen=True)
class Baseline:
    """A method on a task, with 10 random and 200 counted trials per run in the paper's design space.

    runs: number of runs. e_hv, sigma_hv: as in the paper's table. final: mean hypervolume at the end.
    share: of the best known hypervolume.
    """

    task: str
    method: str
    runs: int
    e_hv: float
    sigma_hv: float
    final: float
    share: float


@cache
def baselines() -> tuple[Baseline, ...]:
    """Return all baselines by task and method."""
    text = (resources.files("armwright.experiments") / BASELINES).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return TypeAdapter(tuple[Baseline, ...]).validate_python(tuple(csv.DictReader(lines)))


def baselines_of(task: str) -> list[Baseline]:
    """Return the baselines of a task; empty if it is not built in."""
    return [baseline for baseline in baselines() if baseline.task == task]
