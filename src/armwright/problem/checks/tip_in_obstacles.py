"""Tools and payloads that are in an obstacle at a target, deeper than they may be."""

from collections.abc import Iterator

import numpy as np

from armwright.arrays import Array
from armwright.problem.checks.finding import PROVEN, SUSPECTED, Finding, describe_point
from armwright.problem.checks.inside_obstacles import required_clearance
from armwright.problem.checks.reach import allowed_errors
from armwright.problem.problem import Problem
from armwright.tasks.obstacles import Obstacle, Solid
from armwright.tasks.targets import ORIENTATION

ROUNDING = 1e-6  # [m]
UPRIGHT = 1.0 - 1e-9  # cosine of a body's angle from the tool's axis
SHIFTS = 50  # at most, of a target until its body is free
SHARES = np.linspace(-1.0, 1.0, 9)  # of half a body, at which its points are


def check_tip_bodies(problem: Problem) -> Iterator[Finding]:
    """Find targets at which tool or payload are deeper in an obstacle than they may be, and where these should be.

    Points of a body at the stated pose stand for it, so it is at least as deep. If the tool may rotate about its axis,
    they are within the circle that the body fills at every angle.
    """
    task, strict = problem.task, required_clearance(problem) >= 0.0
    arrays, allowed = task.target_arrays, np.maximum(task.tip_rules.allowed, 0.0)
    for i in np.flatnonzero(arrays.n_angular).tolist():
        for name, solid in task.tip_solids.items():
            points = _points(solid, bool(arrays.n_angular[i] == ORIENTATION))
            body = task.target_positions[i] + points @ arrays.rotation[i].T
            reach = np.linalg.norm(points, axis=1).max(initial=0.0)
            slack = allowed_errors(problem)[i] + arrays.angle_tolerance[i] * reach
            for obstacle, limit in zip(task.obstacles, allowed[i].tolist(), strict=True):
                deep = _depth(obstacle, body)
                if deep <= limit + ROUNDING or (name == "payload" and not problem.scenes[0].payload[i]):
                    continue
                back = np.zeros(3)  # along the tool's axis, until the body is free
                for _ in range(SHIFTS):
                    back -= max(0.0, _depth(obstacle, body + back)) * arrays.rotation[i, :, 2]
                yield Finding(
                    f"target {task.target_names[i]}: the {name} is {1e3 * deep:.3g} mm inside an obstacle: "
                    f"{obstacle.describe()}; at most {1e3 * limit:g} mm are allowed; move the target to "
                    f"{describe_point((task.target_positions[i] + back).round(4))}, or name what it may enter as into",
                    PROVEN if strict and deep > limit + slack else SUSPECTED,
                )


def _depth(obstacle: Obstacle, points: Array) -> float:
    """Return how deep the deepest of points (P, 3) is in an obstacle [m]; below 0 outside."""
    return -float(obstacle.solid.signed_distance(points).min(initial=np.inf))


def _points(solid: Solid, is_turned: bool) -> Array:
    """Return (P, 3) points of a body in the tip frame [m]: those of every angle about its z, unless one is stated."""
    half, middle = np.array(solid.half), np.array(solid.centre)
    if is_turned and solid.shape == "box":
        return middle + half * np.stack(np.meshgrid(SHARES, SHARES, SHARES), axis=-1).reshape(-1, 3)
    radius = (half - np.abs(middle))[:2].min()
    angle, height = np.meshgrid(np.pi * SHARES, middle[2] + half[2] * SHARES)
    circles = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1).reshape(-1, 3)
    return circles if radius >= 0.0 and abs(solid.rotation[2, 2]) > UPRIGHT else circles[:0]
