"""Best known fronts of the tasks with cycles, in their own spaces."""

import numpy as np
import pytest

from armwright.problem.problem import Problem
from armwright.runs.front_gap import best_known_hypervolume, front_gap, known_front
from armwright.spaces.design_space import builtin_spaces, default_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.payload import Payload

CYCLES = [name for name in builtin_names() if name in builtin_spaces()]


def problem_of(name: str) -> Problem:
    return Problem(load_task(name), default_space(name))


@pytest.mark.parametrize("name", CYCLES)
def test_best_known_fronts_are_feasible_and_as_good_as_stated(name: str) -> None:
    problem = problem_of(name)
    known = known_front(problem)
    assert known is not None
    outcomes = problem.evaluate(known.designs)
    close = (np.abs(outcomes.values - known.values) <= 5e-3 * known.values).all(axis=1)
    holds = (outcomes.violations <= 1e-3).all(axis=1)
    assert np.mean(close & holds) >= 0.8  # on another processor, a few designs may take other postures
    reference = problem.reference_point
    assert reference is not None
    gap = front_gap(problem, known.values, reference)
    assert gap is not None
    assert (gap.share, gap.beyond) == (pytest.approx(1.0), 0)
    half = front_gap(problem, known.values[::2], reference)
    assert half is not None
    assert half.share <= 1.0
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
    points = known_front(Problem(load_task("target-1"), paper_space()))
    assert points is not None
    assert points.values.shape[1] == 2
