"""The motion of designs through the cycle of their task, as the page plays it."""

from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.problem.evaluation import Evaluation
from armwright.problem.supply import supply_of
from armwright.tasks.task import Task

LINE_POINTS = (2, 3, 5, 9)  # of a line, between which the page interpolates: as few as are near enough
NEAR = 5e-3  # [rad] or [m]
DIGITS = 3  # of joint values [rad] or [m] and of durations [s]
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
        seconds: the duration of each motion; q: its joint values at equal shares; supply: its currents in words.
    """
    _, paths = evaluation.paths.of_arm(row)
    q = [_rounded(_points(path)[:, :joints]) for path in paths]
    supply = supply_of(evaluation, row)
    currents = "" if supply is None else supply.description
    return {"seconds": _rounded(_durations(evaluation)[row]), "q": q, "supply": currents}


def _points(path: MotionPath) -> Array:
    """Return (F, D) joint values of one arm at equal shares, between which the path is nearly straight."""
    n = next((n for n in LINE_POINTS if _distance(path, n) <= NEAR), LINE_POINTS[-1])
    return path.at(np.linspace(0.0, 1.0, n))[0]


def _distance(path: MotionPath, n: int) -> float:
    """Return the largest distance of a joint [rad] or [m] from straight lines between n points of its path."""
    points, at = path.at(np.linspace(0.0, 1.0, n))[0], path.share * (n - 1)
    before = np.minimum(at.astype(np.intp), n - 2)
    part = (at - before)[:, None]
    straight = (1.0 - part) * points[before] + part * points[before + 1]
    return float(np.abs(straight - path.q[0]).max())


def _durations(evaluation: Evaluation) -> Array:
    """Return the (N, M) durations of motions [s]; UNTIMED if they are not known."""
    try:
        return evaluation.loads.durations
    except SettingsError:
        return np.full(evaluation.paths.jumps.shape, UNTIMED)


def _rounded(values: Array) -> Any:
    return np.round(values, DIGITS).tolist()
