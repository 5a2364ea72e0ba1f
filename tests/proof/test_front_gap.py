"""Best known fronts of the built-in tasks, each in the space that it is meant for."""

import dataclasses
import runpy
from typing import Any

import numpy as np
import pytest

from armwright.pareto import front_mask, hypervolume
from armwright.problem.objectives import POSITION_ERROR, TORQUE
from armwright.problem.problem import Problem
from armwright.proof.front_gap import best_known_hypervolume, front_gap, known_front
from armwright.spaces.design_space import builtin_spaces, default_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.payload import Payload
from armwright.tasks.task import Task
from tests import ROOT

PAPER = Problem(load_task("target-1"))
OPEN = Task(name="open", targets=((0.3, 0.0, 0.3), (0.2, 0.1, 0.4)))
EFFORT = (POSITION_ERROR, dataclasses.replace(TORQUE, name="effort"))
CYCLES = [name for name in builtin_names() if name in builtin_spaces()]
POINTS = [name for name in builtin_names() if name not in builtin_spaces()]
# Hypervolumes of the fronts with all designs that were found, before some were chosen for the package.
WHOLE = {
    "target-1": 10.384170197633225,
    "target-2": 21.263034174852393,
    "welding-seam": 56.19225118012125,
    "desk-sorting": 12518.233793986003,
    "casting-inspection": 2403.4579320081752,
    "screwing": 117675.82001471263,
}


def problem_of(name: str) -> Problem:
    return Problem(load_task(name), default_space(name))


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.fast_cases(3)
def test_best_known_fronts_of_points_are_reproducible(name: str) -> None:
    """None of their designs dominates another, and most give their values on this machine, too.

    Not all: the solver is chaotic in places, and another processor may round otherwise.
    """
    problem = problem_of(name)
    known = known_front(problem)
    assert known is not None
    assert front_mask(known.values).all()
    values = problem.evaluate(known.designs).values
    differs = np.abs(values - known.values).max(axis=1) >= 1e-3
    assert differs.sum() <= max(1.0, 0.3 * len(differs))


@pytest.mark.parametrize("name", CYCLES)
def test_best_known_fronts_are_feasible_and_as_good_as_stated(name: str) -> None:
    problem = problem_of(name)
    known = known_front(problem)
    assert known is not None
    outcomes = problem.evaluate(known.designs)
    close = (np.abs(outcomes.values - known.values) <= 5e-3 * known.values).all(axis=1)
    holds = (outcomes.violations <= 1e-3).all(axis=1)
    # On another processor, a few designs may take other postures.
    assert (~(close & holds)).sum() <= max(1.0, 0.2 * len(close))
    reference = problem.reference_point
    assert reference is not None
    gap = front_gap(problem, known.values, reference)
    assert gap is not None
    assert 0.999 <= gap.share <= 1.0
    assert gap.gain == 0.0
    half = front_gap(problem, known.values[::2], reference)
    assert half is not None
    assert half.share <= gap.share
    assert best_known_hypervolume(problem.task) == gap.hypervolume > 0.0


def test_other_problems_have_no_such_front() -> None:
    problem = problem_of("desk-sorting")
    task = problem.task
    assert known_front(Problem(task.model_copy(update={"name": "mine"}), problem.space)) is not None
    payload = task.payload
    assert isinstance(payload, Payload)
    heavier = task.model_copy(update={"payload": payload.model_copy(update={"mass": 0.2})})
    assert known_front(Problem(heavier, problem.space)) is None
    assert known_front(Problem(task, problem.space, tolerance=1e-3)) is None
    assert known_front(Problem(task, default_space("screwing"))) is None
    bounded = task.model_copy(update={"constraints": ("price <= 1000",)})
    assert known_front(Problem(bounded, problem.space)) is None
    points = known_front(PAPER)
    assert points is not None
    assert points.values.shape[1] == 2


def test_front_gap_to_the_best_known_front() -> None:
    known = known_front(PAPER)
    assert known is not None
    same = front_gap(PAPER, known.values, (5.0, 5.0))
    assert same is not None
    assert 0.999 <= same.share < 1.0
    assert same.gain == 0.0
    half = front_gap(PAPER, known.values[::2], (5.0, 5.0))
    assert half is not None
    assert half.share < same.share
    better = front_gap(PAPER, known.values[::2] * 0.9, (5.0, 5.0))
    assert better is not None
    union = hypervolume(np.vstack([known.values, known.values[::2] * 0.9]), (5.0, 5.0))
    assert better.gain == pytest.approx(union / better.hypervolume - 1.0)
    elsewhere = front_gap(PAPER, known.values, (4.0, 4.0))  # the file states no hypervolume within this point
    assert elsewhere is not None
    assert (elsewhere.share, elsewhere.gain) == (1.0, 0.0)


@pytest.mark.parametrize("name", WHOLE)
def test_shares_count_the_designs_that_are_not_kept(name: str) -> None:
    """A share of a front is that of the hypervolume of all designs that were found; the kept ones hold 99.9 % of it."""
    problem = problem_of(name)
    reference = problem.reference_point
    known = known_front(problem)
    assert known is not None
    assert reference is not None
    found = 0.9 * np.array([reference, reference]) * (1.0 - 0.5 * np.eye(2, len(reference)))
    gap = front_gap(problem, found, reference)
    assert gap is not None
    assert gap.share == pytest.approx(hypervolume(found, reference) / WHOLE[name], rel=1e-12, abs=0.0)
    kept = hypervolume(known.values, reference) / WHOLE[name]
    assert 0.999 <= kept <= 1.0


def test_fronts_are_reduced_by_the_designs_that_cost_least(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    reduced = runpy.run_path(str(ROOT / "benchmarks" / "reference_fronts.py"))["reduced"]
    angles = np.linspace(0.01, 0.49, 200) * np.pi
    front = 1.0 - np.column_stack([np.sin(angles), np.cos(angles)])
    kept = reduced(front, (1.0, 1.0))
    least = 0.999 * hypervolume(front, (1.0, 1.0))
    assert hypervolume(front[kept], (1.0, 1.0)) >= least
    assert (kept[0], kept[-1]) == (0, 199)
    assert all(hypervolume(front[np.delete(kept, i)], (1.0, 1.0)) < least for i in range(1, len(kept) - 1))
    assert reduced(front[:2], (1.0, 1.0)).tolist() == [0, 1]


@pytest.mark.parametrize(
    "problem",
    [
        Problem(OPEN),
        Problem(PAPER.task, paper_space(5)),
        Problem(PAPER.task, paper_space().model_copy(update={"link": (0.03, 0.31)})),
        Problem(PAPER.task, tolerance=1e-3),
        Problem(PAPER.task, objectives=EFFORT),
    ],
)
def test_changed_problems_have_no_best_known_front(problem: Problem) -> None:
    assert known_front(problem) is None


def test_renamed_space_keeps_its_best_known_front() -> None:
    renamed: Any = paper_space().model_copy(update={"name": "mine"})
    assert known_front(Problem(PAPER.task.model_copy(update={"name": "mine"}), renamed)) is not None
