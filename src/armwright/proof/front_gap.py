"""The gap between the front of a run and the best known front of a built-in task.

The best known fronts are in best_known_fronts/, one CSV file per task, made by benchmarks/reference_fronts.py. The
first lines of a file say how, and state the hypervolume of the whole front; the designs keep 99.9 % of it.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from armwright.arrays import Array
from armwright.pareto import hypervolume
from armwright.problem.objectives import PAPER_OBJECTIVES, named_objectives
from armwright.problem.problem import Problem
from armwright.spaces.design_space import default_space
from armwright.spaces.parameters import Design, FloatParameter
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.task import Task
from armwright.tasks.tool import NO_TOOL

MIN_GAIN = 5e-4  # of the best known hypervolume; any other front fills the gaps of a finite one by less
VOLUME_LINE = "# hypervolume: "  # the beginning of the line of a file that states it


@dataclass(frozen=True)
class KnownFront:
    """A front, of which some designs are kept."""

    designs: tuple[Design, ...]  # the kept designs, by increasing first objective
    values: Array  # (K, M) their values
    reference_point: tuple[float, ...]  # (M,) the task's
    volume: float  # hypervolume of the whole front within it

    def hypervolume(self, reference_point: Sequence[float]) -> float:
        """Return the hypervolume: of the whole front within the task's reference point, else of the kept designs."""
        is_stated = tuple(reference_point) == self.reference_point
        return self.volume if is_stated else hypervolume(self.values, reference_point)


@dataclass(frozen=True)
class FrontGap:
    """A front compared with the best known one, within the same reference point."""

    hypervolume: float  # hypervolume of the best known front
    share: float  # hypervolume of the front divided by it; above 1 if the front is better
    gain: float  # what the front adds to the best known hypervolume at least, relative; 0 if it is less than 0.05 %


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
    return known.hypervolume(task.reference_point)


def front_gap(problem: Problem, values: Array, reference_point: Sequence[float]) -> FrontGap | None:
    """Compare the front of `values` (N, M) with the best known; None if none is known within the reference point."""
    known = known_front(problem)
    if known is None:
        return None
    best = known.hypervolume(reference_point)
    if best == 0.0:
        return None
    gain = hypervolume(np.vstack([known.values, values]), reference_point) / best - 1.0
    return FrontGap(best, hypervolume(values, reference_point) / best, gain if gain >= MIN_GAIN else 0.0)


@cache
def _read(task_name: str) -> KnownFront | None:
    file = resources.files("armwright.proof") / "best_known_fronts" / f"{task_name}.csv"
    if not file.is_file():
        return None
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    volume = next(float(line.split()[2]) for line in lines if line.startswith(VOLUME_LINE))
    space, task = default_space(task_name), load_task(task_name)
    real = {parameter.name for parameter in space.parameters if isinstance(parameter, FloatParameter)}
    present = [{p.name: row[p.name] for p in space.parameters if row[p.name]} for row in rows]
    designs = [
        space.design({name: float(value) if name in real else value for name, value in params.items()})
        for params in present
    ]
    names = [objective.name for objective in Problem(task, space).objectives]
    values = np.array([[float(row[name]) for name in names] for row in rows])
    return KnownFront(tuple(designs), values, task.reference_point or (), volume)
