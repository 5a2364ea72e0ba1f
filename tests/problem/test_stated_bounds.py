"""Bounds of objectives that the constraints of a task imply, against what random designs measure."""

import numpy as np
import pytest

from armwright.pareto import feasible_mask
from armwright.problem.problem import Problem
from armwright.problem.stated_bounds import stated_bounds
from armwright.spaces.design_space import paper_space
from armwright.study.study import optimize
from armwright.tasks.task import Task

ERRORS = ("worst_error", "position_error", "worst_angle", "orientation_error")
TARGETS = (
    {"position": [0.3, 0.1, 0.2], "axis": [0, 0, -1], "tolerance": 0.5, "angle_tolerance": 1.5, "weight": 2.0},
    {"position": [0.2, 0.3, 0.1], "tolerance": 0.6},
)


def problem(*constraints: str, objectives: tuple[str, ...] = ERRORS) -> Problem:
    content = {"name": "bounded", "targets": TARGETS, "objectives": objectives, "constraints": constraints}
    return Problem(Task.model_validate(content), paper_space())


def values(bounded: Problem) -> list[float | None]:
    return [None if bound is None else bound.value for bound in stated_bounds(bounded)]


def test_tolerances_bound_errors_if_all_targets_must_be_reached() -> None:
    assert values(problem("unreached_targets <= 0")) == pytest.approx([0.6, 1.6, 1.5, 3.0])
    assert values(problem("unreached_targets <= 1")) == [None] * 4
    assert values(problem()) == [None] * 4


def test_the_tightest_bound_counts() -> None:
    assert values(problem("worst_error <= 0.2", "unreached_targets <= 0"))[:2] == pytest.approx([0.2, 0.6])
    assert values(problem("worst_error <= 2", "unreached_targets <= 0"))[:2] == pytest.approx([0.6, 1.6])
    assert values(problem("worst_angle <= 0.1", "position_error <= 0.3")) == pytest.approx([None, 0.3, 0.1, 0.2])


def test_lower_bounds_and_bounds_of_zero_give_no_coordinate() -> None:
    names = ("length", "collision")
    assert values(problem("length >= 0.5", "collision <= 0", objectives=names)) == [None, None]


def test_feasible_designs_keep_the_bounds() -> None:
    bounded = problem("unreached_targets <= 0", "position_error <= 0.9")
    outcomes = bounded.evaluate(bounded.space.sample(2000, 0))
    feasible = outcomes.values[feasible_mask(outcomes.violations)]
    assert len(feasible) > 10
    assert np.all(feasible <= np.array(values(bounded)))


def test_study_takes_its_reference_point_from_the_bounds() -> None:
    open_ = problem("worst_error <= 0.3", objectives=("worst_error", "torque"))
    run = optimize(open_, proposer="none", sampler="random", n_total=1, seed=0)
    assert run.history.reference_point is not None
    assert run.history.reference_point[0] == pytest.approx(0.33)
    assert run.history.reference_point == run.history.found_reference_point()
