"""The gap between the front of a run and the best known front of a built-in task.

The best known fronts are in best_known_fronts/, one CSV file per task, made by benchmarks/reference_fronts.py. The
first lines of a file say how.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from armwright.arrays import Array
from armwright.pareto import front_mask, hypervolume
from armwright.problem.objectives import PAPER_OBJECTIVES
from armwright.problem.problem import Problem
from armwright.runs.trial import Count
from armwright.spaces.design_space import paper_space
from armwright.spaces.parameters import Design, FloatParameter
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.task import Task
from armwright.tasks.tool import NO_TOOL

MIN_GAIN = 5e-4  # of the best known hypervolume; any other front fills the gaps of a finite one by less


@dataclass(frozen=True)
class KnownFront:
    """A front: designs and their (K, M) values, by increasing first objective."""

    designs: tuple[Design, ...]
    values: Array


@dataclass(frozen=True)
class FrontGap:
    """A front compared with the best known one, within the same reference point.

    Attributes:
        hypervolume: Hypervolume of the best known front.
        share: Hypervolume of the front divided by it; above 1 if the front is better.
        beyond: Number of designs that the best known front does not dominate.
        gain: What these add to the best known hypervolume, relative. If it is less than 0.05 %, both are 0.
    """

    hypervolume: float
    share: float
    beyond: Count
    gain: float


def known_front(problem: Problem) -> KnownFront | None:
    """Return the best known front of a problem, if it has a built-in task's targets and the paper's space."""
    paper = paper_space()
    is_known = (
        problem.space.model_copy(update={"name": paper.name}) == paper
        and not problem.tolerance
        and problem.objectives == PAPER_OBJECTIVES
        and not problem.task.payloads.any()
        and problem.task.tool == NO_TOOL
        and not problem.constraints
        and problem.task.is_plain
    )
    if not is_known:
        return None
    for name in sorted(builtin_names(), key=lambda name: name != problem.task.name):  # nearly always the first
        if load_task(name).targets == problem.task.targets:
            return _read(name)
    return None


def best_known_hypervolume(task: Task) -> float | None:
    """Return the best known hypervolume of a task in the paper's design space; None if no front is known."""
    known = None if task.cycle else known_front(Problem(task))
    if known is None or task.reference_point is None:
        return None
    return hypervolume(known.values, task.reference_point)


def front_gap(problem: Problem, values: Array, reference_point: Sequence[float]) -> FrontGap | None:
    """Compare the front of `values` (N, M) with the best known; None if none is known within the reference point."""
    known = known_front(problem)
    if known is None:
        return None
    best = hypervolume(known.values, reference_point)
    if best == 0.0:
        return None
    inside = values[np.all(values < np.asarray(reference_point), axis=1)]
    together = np.vstack([known.values, inside])
    beyond = int(front_mask(together)[len(known.values) :].sum())
    gain = hypervolume(together, reference_point) / best - 1.0
    if gain < MIN_GAIN:
        beyond, gain = 0, 0.0
    return FrontGap(best, hypervolume(inside, reference_point) / best, beyond, gain)


@cache
def _read(task: str) -> KnownFront | None:
    file = resources.files("armwright.runs") / "best_known_fronts" / f"{task}.csv"
    if not file.is_file():
        return None
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    space = paper_space()
    real = {parameter.name for parameter in space.parameters if isinstance(parameter, FloatParameter)}
    designs = [
        space.design({p.name: float(row[p.name]) if p.name in real else row[p.name] for p in space.parameters})
        for row in rows
    ]
    values = [[float(row[objective.name]) for objective in PAPER_OBJECTIVES] for row in rows]
    return KnownFront(tuple(designs), np.array(values))
