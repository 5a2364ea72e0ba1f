"""Targets beyond the longest arm of a space."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.problem.checks.finding import PROVEN, Finding, describe_point, describe_targets
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import FloatParameter

ROUNDING = 1e-5  # of a distance relative to the reach, from single precision
MILLIMETRES = 1e-3  # [m]


def check_reach(problem: Problem) -> Iterator[Finding]:
    """Find targets that no arm reaches from any base.

    It may miss a target by as much as the constraints allow, or without such constraints by the target's tolerance.
    """
    task, allowed = problem.task, allowed_errors(problem)
    positions, error = task.target_positions, np.where(np.isfinite(allowed), allowed, task.target_arrays.tolerance)
    reach, distance = problem.max_reach, distance_to_bases(problem.space, positions)
    beyond = np.flatnonzero(distance - error > reach * (1.0 + ROUNDING))
    if not len(beyond):
        return
    worst = beyond[np.argmax(distance[beyond])]
    who = describe_targets([task.target_names[i] for i in beyond], len(positions))
    point = describe_point(positions[worst])
    where = (
        f"{point} is {distance[worst]:.3g} m from the nearest allowed base"
        if len(beyond) == 1
        else f"are out of reach: the farthest, {point}, is {distance[worst]:.3g} m from the nearest allowed base"
    )
    yield Finding(
        f"{who} {where}, but the longest arm with its tool reaches {reach:.3g} m; {_remedy(problem, beyond)}",
        PROVEN,
    )


def distance_to_bases(space: DesignSpace, points: Array) -> Array:
    """Return the (T,) distances of points (T, 3) from the box of allowed bases [m]."""
    low, high = base_box(space)
    return np.linalg.norm(points - np.clip(points, low, high), axis=1)


def base_box(space: DesignSpace) -> tuple[Array, Array]:
    """Return the (3,) smallest and largest coordinates of the base [m]."""
    ranges = {p.name: (p.low, p.high) for p in space.parameters if isinstance(p, FloatParameter)}
    low, high = np.array([ranges[f"origin_{axis}"] for axis in "xyz"]).T
    return low, high


def allowed_errors(problem: Problem) -> Array:
    """Return the (T,) largest distances of the tip from the targets that the constraints allow [m]; inf for any."""
    arrays = problem.task.target_arrays
    allowed = np.full(len(arrays), np.inf)
    for constraint in problem.constraints:
        if constraint.relation != "<=":
            continue
        match constraint.quantity.name:
            case "unreached_targets" if constraint.bound < 1.0:
                allowed = np.minimum(allowed, arrays.tolerance)
            case "worst_error":
                allowed = np.minimum(allowed, constraint.bound)
            case "position_error":
                allowed = np.minimum(allowed, constraint.bound / arrays.weight)
            case _:
                pass
    return np.maximum(allowed, 0.0)


def _remedy(problem: Problem, beyond: NDArray[np.intp]) -> str:
    """Return what to do about targets of these indices."""
    positions = problem.task.target_positions
    points = positions[beyond]
    scaled = distance_to_bases(problem.space, MILLIMETRES * positions)
    if np.abs(points).max(axis=1).min() >= 10.0 and scaled.max() <= problem.max_reach:
        return "coordinates are in metres: write 0.45 for 450 mm (armwright init --from FILE --unit mm converts)"
    return "move it, or widen origin_x, origin_y, origin_z or link in the space"
