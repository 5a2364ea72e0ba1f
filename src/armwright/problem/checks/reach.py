"""Targets beyond the longest arm of a space."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.problem.checks.finding import PROVEN, Finding, describe_point, describe_targets
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import MODULES
from armwright.spaces.parameters import CategoricalParameter, FloatParameter

ROUNDING = 1e-5  # of a distance relative to the reach, from single precision
MILLIMETRES = 1e-3  # [m]


def check_reach(problem: Problem) -> Iterator[Finding]:
    """Find targets that no arm reaches from any base.

    It may miss a target by as much as the constraints allow, or without such constraints by the target's tolerance.
    """
    task, allowed = problem.task, allowed_errors(problem)
    positions, error = task.target_positions, np.where(np.isfinite(allowed), allowed, task.target_arrays.tolerance)
    reach, distance = longest_reach(problem), distance_to_bases(problem.space, positions)
    beyond = np.flatnonzero(distance - error > reach * (1.0 + ROUNDING))
    if not len(beyond):
        yield from _check_approaches(problem, reach)
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


def _check_approaches(problem: Problem, reach: float) -> Iterator[Finding]:
    """Find a point of approach that no arm reaches as nearly as path_error has to be."""
    plan, n_targets = problem.scenes[0].plan, len(problem.task.targets)
    bounds = [c.bound for c in problem.constraints if (c.quantity.name, c.relation) == ("path_error", "<=")]
    if plan is None or not bounds:
        return
    distance = distance_to_bases(problem.space, plan.poses.position)
    for motion in plan.motions:
        if motion.end >= n_targets > motion.start and distance[motion.end] - bounds[0] > reach * (1.0 + ROUNDING):
            name, point = problem.task.target_names[motion.start], describe_point(plan.poses.position[motion.end])
            yield Finding(
                f"cycle: the approach of target {name} begins at {point}, {distance[motion.end]:.3g} m from the "
                f"nearest allowed base, but the longest arm with its tool reaches {reach:.3g} m; shorten approach, "
                f"{plan.cycle.approach:g} m",
                PROVEN,
            )
            return


def longest_reach(problem: Problem) -> float:
    """Return the length of the longest arm with its tool and all slides extended [m]."""
    return sum(longest_modules(problem.space)) + problem.task.tool.length


def longest_modules(space: DesignSpace) -> list[float]:
    """Return the largest length of each module [m]: of its link, and of its stroke if it may be a slide."""
    known = {parameter.name: parameter for parameter in space.parameters}
    lengths: list[float] = []
    for module in range(1, space.max_joints + 1):
        link, joint, stroke = (known.get(f"{kind}_{module}") for kind in ("link", "joint", "stroke"))
        assert isinstance(link, FloatParameter)
        assert isinstance(joint, CategoricalParameter)
        may_slide = any(MODULES[letter].is_prismatic for letter in joint.choices)  # pyright: ignore[reportArgumentType]
        longest = stroke.high if isinstance(stroke, FloatParameter) else space.min_stroke
        lengths.append(link.high + (longest if may_slide else 0.0))
    return lengths


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
    if np.abs(points).max(axis=1).min() >= 10.0 and scaled.max() <= longest_reach(problem):
        return "coordinates are in metres: write 0.45 for 450 mm (armwright init --from FILE --unit mm converts)"
    commas = [comma for point in points.tolist() if (comma := decimal_comma(point))]
    if commas:
        return f"if {commas[0].replace('.', ',')} was meant as one number, write {commas[0]}"
    return "move it, or widen origin_x, origin_y, origin_z or link in the space"


def decimal_comma(point: list[float]) -> str:
    """Return the number that two whole coordinates in turn may have been, with a decimal point; "" for none."""
    if all(value.is_integer() for value in point):
        return ""
    for first, second in pairwise(point):
        if first.is_integer() and second.is_integer() and second >= 1.0:
            return f"{math.trunc(first)}.{math.trunc(second)}"
    return ""
