"""Targets inside obstacles or too close to them, and tools and payloads deeper in obstacles there than they may be."""

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.problem.arm_quantities import COMFORTABLE
from armwright.problem.checks.finding import PROVEN, SUSPECTED, Finding, describe_point, describe_targets
from armwright.problem.checks.reach import ROUNDING, allowed_errors
from armwright.problem.problem import Problem
from armwright.tasks.obstacles import Obstacle, Solid

NEGLIGIBLE = 1e-6  # [m]
SHIFTS = 50  # at most, of a target until its body is free
UPRIGHT = 1.0 - 1e-9  # cosine of a body's angle from the tool's axis
SHARES = np.linspace(-1.0, 1.0, 9)  # of half a body, at which its points are


def check_obstacles(problem: Problem) -> Iterator[Finding]:
    """Find targets in obstacles.

    The end of the last link is within the tool's length of the tip, and the tip of an arm that reaches a target is
    within its tolerance. Clearances ignore the tool. If the constraints demand both to reach a target and a clearance
    that the end of the last link cannot have there, it is proven that no design is feasible.
    """
    task = problem.task
    error, clearance = allowed_errors(problem), required_clearance(problem)
    slack = ROUNDING * (1.0 + np.abs(task.target_positions).max())
    # A first link stands on what it is mounted on, and is measured from above its foot.
    has_other_links = problem.space.min_joints > 1
    for obstacle, allowed in zip(task.obstacles, task.tip_rules.allowed.T, strict=True):
        distance = obstacle.solid.signed_distance(task.target_positions)
        nearest = distance + error + task.tool.length - min(problem.space.tube_values("radius"))  # of the last link
        impossible = nearest + slack < clearance if has_other_links else np.zeros(len(distance), dtype=np.bool_)
        inside = (distance < -np.maximum(task.target_arrays.tolerance, allowed)) & ~impossible
        for found, evidence in ((impossible, PROVEN), (inside, SUSPECTED)):
            if found.any():
                yield _finding(problem, obstacle, distance, found, evidence)


def required_clearance(problem: Problem) -> float:
    """Return the clearance that the constraints demand of every posture at a target [m]; -inf for none."""
    required = -math.inf
    for constraint in problem.constraints:
        match constraint.quantity.name, constraint.relation:
            case "clearance" | "obstacle_clearance", ">=":
                required = max(required, constraint.bound)
            case "collision", "<=":
                required = max(required, -constraint.bound)
            case "clearance_shortfall", "<=":
                required = max(required, COMFORTABLE - constraint.bound)
            case _:
                pass
    return required


def _finding(problem: Problem, obstacle: Obstacle, distance: Array, found: NDArray[np.bool_], evidence: str) -> Finding:
    task, numbers = problem.task, np.flatnonzero(found)
    deepest = numbers[np.argmin(distance[numbers])]
    who, point = (
        describe_targets([task.target_names[i] for i in numbers], len(distance)),
        task.target_positions[deepest],
    )
    who += f" {describe_point(point)} is" if len(numbers) == 1 else f", the deepest at {describe_point(point)}, are"
    depth = -1e3 * float(distance[deepest])
    where = f"{depth:.3g} mm inside" if depth > 0.0 else f"{-depth:.3g} mm from"
    why = "an arm that reaches it passes through its surface"
    if evidence == PROVEN:
        radius, tool = 1e3 * min(problem.space.tube_values("radius")), 1e3 * task.tool.length
        longer = "" if depth > 0.0 else ", or state a longer tool"
        why = (
            f"the last link, of radius {radius:g} mm and with a tool of {tool:g} mm, cannot keep the clearance that "
            f"the constraints demand; move the target or the obstacle{longer}"
        )
    return Finding(f"{who} {where} an obstacle: {obstacle.describe()}; {why}", evidence)


def check_tip_bodies(problem: Problem) -> Iterator[Finding]:
    """Find targets at which tool or payload are deeper in an obstacle than they may be, and where these should be.

    Points of a body at the stated pose stand for it, within the circle that it fills at every angle about the tool's
    axis, so it is at least as deep.
    """
    task, carried = problem.task, problem.scenes[0].payload > 0.0
    arrays, allowed = task.target_arrays, np.maximum(task.tip_rules.allowed, 0.0)
    for i, (name, solid) in product(np.flatnonzero(arrays.n_angular).tolist(), task.tip_solids.items()):
        points, back = _points(solid), arrays.rotation[i, :, 2]
        body = task.target_positions[i] + points @ arrays.rotation[i].T
        slack = allowed_errors(problem)[i] + arrays.angle_tolerance[i] * np.linalg.norm(points, axis=1).max(initial=0.0)
        for obstacle, limit in zip(task.obstacles, allowed[i].tolist(), strict=True):
            deep, shift = -float(obstacle.solid.signed_distance(body).min(initial=np.inf)), 0.0
            if deep <= limit + NEGLIGIBLE or (name == "payload" and not carried[i]):
                continue
            for _ in range(SHIFTS):
                shift += max(0.0, -float(obstacle.solid.signed_distance(body - shift * back).min()))
            right = describe_point((task.target_positions[i] - shift * back).round(4))
            yield Finding(
                f"target {task.target_names[i]}: the {name} is {1e3 * deep:.3g} mm inside an obstacle: "
                f"{obstacle.describe()}; at most {1e3 * limit:g} mm are allowed; move the target to {right}, "
                "or name what it may enter as into",
                PROVEN if required_clearance(problem) >= 0.0 and deep > limit + slack else SUSPECTED,
            )


def _points(solid: Solid) -> Array:
    """Return (P, 3) points that a body has at every angle about the z axis of the tip frame [m]."""
    half, middle = np.array(solid.half), np.array(solid.centre)
    radius = (half - np.abs(middle))[:2].min()
    angle, height = np.tile(np.pi * SHARES, len(SHARES)), np.repeat(middle[2] + half[2] * SHARES, len(SHARES))
    circles = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return circles if radius >= 0.0 and abs(solid.rotation[2, 2]) > UPRIGHT else circles[:0]
