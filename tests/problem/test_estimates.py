"""Bounds and estimates of outcomes, against evaluations."""

from typing import Any

import numpy as np
import pytest

from armwright.problem.estimates import estimates, lower_bounds
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.spaces.design_space import DesignSpace, default_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.task import Task
from tests.support.arms import LIGHT

N = {False: 150, True: 20}  # random designs without and with a cycle


def sampled(problem: Problem, n: int, seed: int = 0) -> Any:
    return problem.space.matrix(problem.space.sample(n, seed))


def assert_bounded(problem: Problem, n: int) -> None:
    matrix = sampled(problem, n)
    bounds, outcomes = lower_bounds(problem, matrix), problem.evaluate(matrix)
    assert np.all(bounds.values <= outcomes.values)
    assert np.all(bounds.violations <= outcomes.violations)


@pytest.mark.parametrize("name", sorted(builtin_names()))
def test_no_evaluation_of_a_builtin_task_falls_below_its_bounds(name: str) -> None:
    task = load_task(name)
    assert_bounded(Problem(task, default_space(name)), N[task.cycle is not None])


def test_targets_beyond_reach_bound_errors() -> None:
    targets = ({"position": [0.9, 0.3, 0.2], "weight": 2.0}, {"position": [-0.5, 0.4, 0.8], "tolerance": 0.3})
    content = {
        "name": "far",
        "targets": targets,
        "objectives": ["position_error", "worst_error", "unreached_targets", "torque"],
        "constraints": ["worst_error <= 0.1", "unreached_targets >= 1", "clearance >= 0", "joints >= 3"],
    }
    problem = Problem(Task.model_validate(content), paper_space())
    assert_bounded(problem, 500)
    matrix = sampled(problem, 500)
    bounds, outcomes = lower_bounds(problem, matrix), problem.evaluate(matrix)
    assert np.all(np.mean(bounds.values[:, :3] > 0.0, axis=0) > 0.5)
    # Some arms stretch straight at both targets, so no larger bound would hold.
    assert np.max(bounds.values[:, 1] / outcomes.values[:, 1]) > 0.9
    assert np.array_equal(bounds.violations[:, 3], outcomes.violations[:, 3])
    assert np.all(np.isneginf(bounds.violations[:, 1:3]))


def test_quantities_of_an_arm_at_rest_are_exact() -> None:
    content = {
        "name": "bought",
        "targets": [[0.3, 0.0, 0.2]],
        "objectives": ["price", "mass", "length", "joints", "worst_error"],
        "constraints": ["price <= 900", "mass >= 1.5", "voltages <= 1"],
    }
    space = {
        "name": "mixed",
        "joints": [3, 5],
        **LIGHT,
        "actuators": ["XM540-W270", "RobStride-00"],
        "motor_bodies": False,
    }
    problem = Problem(Task.model_validate(content), DesignSpace.model_validate(space))
    matrix = sampled(problem, 200)
    bounds, outcomes = lower_bounds(problem, matrix), problem.evaluate(matrix)
    assert np.array_equal(bounds.values[:, :4], outcomes.values[:, :4])
    assert np.array_equal(bounds.violations, outcomes.violations)


@pytest.mark.parametrize("name", ["desk-sorting", "dispensing"])
def test_estimates_from_an_arms_own_postures_are_near_its_evaluation(name: str) -> None:
    problem = Problem(load_task(name), default_space(name))
    known = known_front(problem)
    assert known is not None
    matrix = problem.space.matrix(known.designs)
    outcomes = problem.evaluate(matrix)
    assert outcomes.entry is not None
    found = estimates(problem, matrix, outcomes.entry)
    assert found.values == pytest.approx(outcomes.values, rel=0.15)
    timed = [c.quantity.name not in ("unreached_targets", "jumps") for c in problem.constraints]
    assert np.median(np.abs(found.violations - outcomes.violations)[:, timed]) < 0.02
