"""Targets inside obstacles, or too close to them."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.problem.checks.finding import PROVEN, SUSPECTED, Finding, describe_point, describe_targets
from armwright.problem.checks.reach import ROUNDING, allowed_errors
from armwright.problem.objectives import COMFORTABLE
from armwright.problem.problem import Problem
from armwright.tasks.obstacles import Obstacle


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
