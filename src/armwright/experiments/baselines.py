"""What the usual methods come to on the built-in tasks: something to compare a run with, without running it.

Shipped in baselines.csv, made by benchmarks/baselines.py from `armwright experiment suite`.
"""

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

BASELINES = "baselines.csv"


@dataclass(frozen=True)
class Baseline:
    """A method on a task: so many runs of 10 random and 200 counted trials in the paper's design space.

    e_hv, sigma_hv: as the paper's table. final: the mean hypervolume at the end. share: of the best known one.
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
    """All of them, by task and method."""
    text = (resources.files("armwright.experiments") / BASELINES).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return tuple(
        Baseline(
            task=row["task"],
            method=row["method"],
            runs=int(row["runs"]),
            e_hv=float(row["e_hv"]),
            sigma_hv=float(row["sigma_hv"]),
            final=float(row["final"]),
            share=float(row["share"]),
        )
        for row in csv.DictReader(lines)
    )


def baselines_of(task: str) -> list[Baseline]:
    """Those of one task; none for a task that is not built in."""
    return [baseline for baseline in baselines() if baseline.task == task]
