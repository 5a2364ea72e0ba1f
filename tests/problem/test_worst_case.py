"""Worst case over payloads and displaced targets, against each case as its own task."""

import numpy as np

from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.proof.verification import verify
from armwright.tasks.task import Task

NAMES = ["position_error", "torque", "worst_error"]
PLAIN = Task(name="plain", targets=((0.4, 0.1, 0.3), (0.2, -0.3, 0.5), (-0.1, 0.4, 0.2)), payload=(0.1, 0.2, 0.0))
ROBUST = PLAIN.model_copy(
    update={"payload_factors": (0.0, 1.5), "target_noise": 0.004, "constraints": ("peak_torque <= 2",)}
)


def alone() -> list[Task]:
    """Return each case as its own task."""
    shifts = [sign * 0.004 * axis for axis in np.eye(3) for sign in (-1.0, 1.0)]
    moved = [tuple(map(tuple, (PLAIN.target_positions + shift).tolist())) for shift in shifts]
    heavier = [tuple((factor * PLAIN.payloads).tolist()) for factor in (0.0, 1.5)]
    tasks = [PLAIN, *(PLAIN.model_copy(update={"payload": load}) for load in heavier)]
    tasks += [PLAIN.model_copy(update={"targets": targets}) for targets in moved]
    return [task.model_copy(update={"constraints": ROBUST.constraints}) for task in tasks]


def test_objectives_are_the_worst_over_all_cases() -> None:
    problem = Problem(ROBUST, objectives=named_objectives(NAMES))
    rows = problem.space.matrix(problem.space.sample(60, 1))
    each = [Problem(task, objectives=named_objectives(NAMES)).evaluate(rows) for task in alone()]
    outcomes = problem.evaluate(rows)
    values = outcomes.values
    assert np.array_equal(values, np.max([case.values for case in each], axis=0))
    assert np.array_equal(outcomes.violations, np.max([case.violations for case in each], axis=0))
    designs = problem.space.designs(rows)
    assert np.array_equal(problem.evaluate(designs).values, values)
    assert np.any(values > each[0].values)
    exact = verify(problem, problem.space.matrix(designs[:5]), values[:5], (5.0, 5.0, 1.0)).exact
    assert np.all(np.abs(np.median(exact / values[:5]) - 1.0) < 0.05)  # float64 takes other ways at times
