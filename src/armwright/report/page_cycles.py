"""The motion of designs through the cycle of their task, as the page plays it."""

from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.evaluation import Evaluation
from armwright.tasks.task import Task

LINE_POINTS = 9  # of a line; the page interpolates between them
DIGITS = 4  # of joint values [rad] or [m] and of durations [s]
UNTIMED = 1.0  # [s] of each motion if durations are not known


def cycle_motions(task: Task) -> list[dict[str, Any]]:
    """Return step, target and rest [s] of each motion of the cycle; empty without a cycle."""
    if task.cycle is None:
        return []
    plan = task.plan(task.target_positions)
    return [
        {"step": motion.step + 1, "target": plan.targets[motion.step], "rest": rest}
        for motion, rest in zip(plan.motions, plan.dwells, strict=True)
    ]


def cycle_of_design(evaluation: Evaluation, row: int, joints: int) -> dict[str, Any]:
    """Return how an arm moves through the cycle.

    Args:
        evaluation: Of N arms.
        row: The arm.
        joints: Its number of joints.

    Returns:
        seconds: the duration of each motion; q: its joint values at equal shares, two for a joint motion.
    """
    _, paths = evaluation.paths.of_arm(row)
    shares = [np.linspace(0.0, 1.0, 2 if path.motion.by == "joint" else LINE_POINTS) for path in paths]
    q = [path.at(share)[0, :, :joints] for path, share in zip(paths, shares, strict=True)]
    return {"seconds": _rounded(_durations(evaluation)[row]), "q": [_rounded(values) for values in q]}


def _durations(evaluation: Evaluation) -> Array:
    """Return the (N, M) durations of motions [s]; UNTIMED if they are not known."""
    try:
        return evaluation.loads.durations
    except SettingsError:
        return np.full(evaluation.paths.jumps.shape, UNTIMED)


def _rounded(values: Array) -> Any:
    return np.round(values, DIGITS).tolist()
