"""Errors that objectives ignore: those below the tolerances that a task states."""

import numpy as np

from armwright.arrays import Array
from armwright.problem.objective import Objective
from armwright.problem.problem import Problem
from armwright.tasks.task import Task

POSITIONS = ("position_error", "worst_error")
ANGLES = ("orientation_error", "worst_angle")
LINES = ("path_error", "path_angle")


def stated_tolerance(task: Task, objective: Objective) -> Array:
    """Return the stated tolerances that an objective ignores, 0 where none is stated.

    Returns:
        (T,) of the targets, (1,) of the lines of a cycle, (0,) of objectives that are no errors [m] or [rad].
    """
    arrays, name = task.target_arrays, objective.name
    if name in POSITIONS:
        return arrays.stated_tolerance
    if name in ANGLES:
        return arrays.stated_angle_tolerance
    if name in LINES and task.cycle is not None:
        along = task.cycle.tolerance
        return np.array([(along.path if name == "path_error" else along.angle) or 0.0])
    return np.empty(0)


def describe_ignored_errors(problem: Problem) -> str:
    """Return which objectives ignore errors below stated tolerances, on one line; empty if none does."""
    names = [o.name for o in problem.objectives if stated_tolerance(problem.task, o).any()]
    return f"errors below the stated tolerances count as 0 in {' and '.join(names)}" if names else ""
