"""Best known fronts of the built-in tasks, each in the space that it is meant for."""

import dataclasses

import numpy as np
import pytest

from armwright.pareto import front_mask, hypervolume
from armwright.problem.arm_quantities import position_error, torque
from armwright.problem.problem import Problem
from armwright.proof.front_gap import best_known_hypervolume, front_gap, known_front
from armwright.spaces.design_space import builtin_spaces, default_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.payload import Payload

PAPER = Problem(load_task("target-1"))
CYCLES = [name for name in builtin_names() if name in builtin_spaces()]
POINTS = [name for name in builtin_names() if name not in builtin_spaces()]
# Hypervolumes of the fronts with all designs that were found, before some were chosen for the package.
WHOLE = {
    "target-1": 10.384170197633225,
    "target-2": 21.263034174852393,
    "welding-seam": 56.19225118012125,
    "desk-sorting": 12186.391446125599,
    "casting-inspection": 2016.0358475076594,
    "screwing": 111568.78075558163,
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
    task, space, payload = problem.task, problem.space, problem.task.payload
    assert known_front(Problem(task.model_copy(update={"name": "mine"}), space.model_copy(update={"name": "mine"})))
    assert isinstance(payload, Payload)
    heavier = task.model_copy(update={"payload": payload.model_copy(update={"mass": 0.2})})
    effort = (position_error, dataclasses.replace(torque, name="effort"))
    for other in (
        Problem(heavier, space),
        Problem(task, space, tolerance=1e-3),
        Problem(task, default_space("screwing")),
        Problem(task.model_copy(update={"constraints": ("price <= 1000",)}), space),
        Problem(PAPER.task, paper_space(5)),
        Problem(PAPER.task, paper_space().model_copy(update={"link": (0.03, 0.31)})),
        Problem(PAPER.task, objectives=effort),
    ):
        assert known_front(other) is None


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
