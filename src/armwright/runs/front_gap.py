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
from armwright.problem.objectives import PAPER_OBJECTIVES, named_objectives
from armwright.problem.problem import Problem
from armwright.runs.trial import Count
from armwright.spaces.design_space import default_space
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
    """Return the best known front of a problem, if it is that of a built-in task in the space that it is meant for."""
    if problem.tolerance or problem.evaluator is not None:
        return None
    for name in sorted(builtin_names(), key=lambda name: name != problem.task.name):  # nearly always the first
        space = default_space(name)
        if problem.space.model_copy(update={"name": space.name}) == space and _is_same(problem, load_task(name)):
            return _read(name)
    return None


def _is_same(problem: Problem, task: Task) -> bool:
    """Return whether a problem has the designs of a built-in task, as good as there."""
    if task.is_plain and not task.cycle:
        plain = not problem.task.payloads.any() and problem.task.tool == NO_TOOL and problem.task.is_plain
        unbounded = problem.objectives == PAPER_OBJECTIVES and not problem.constraints
        return plain and unbounded and problem.task.targets == task.targets
    labels = {
        name: getattr(task, name) for name in ("name", "description", "provenance", "reference_point", "resolution")
    }
    default = named_objectives(task.objectives or [])
    return problem.objectives == default and problem.task.model_copy(update=labels) == task


def best_known_hypervolume(task: Task) -> float | None:
    """Return the best known hypervolume of a task in the space that it is meant for; None if no front is known."""
    known = known_front(Problem(task, default_space(task.name)))
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
def _read(task_name: str) -> KnownFront | None:
    file = resources.files("armwright.runs") / "best_known_fronts" / f"{task_name}.csv"
    if not file.is_file():
        return None
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    space, task = default_space(task_name), load_task(task_name)
    real = {parameter.name for parameter in space.parameters if isinstance(parameter, FloatParameter)}
    present = [{p.name: row[p.name] for p in space.parameters if row[p.name]} for row in rows]
    designs = [
        space.design({name: float(value) if name in real else value for name, value in params.items()})
        for params in present
    ]
    names = [objective.name for objective in Problem(task, space).objectives]
    return KnownFront(tuple(designs), np.array([[float(row[name]) for name in names] for row in rows]))
