"""Numbers of a size that was hardly meant: millimetres, degrees, grams."""

import math
from collections.abc import Iterator

import numpy as np

from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.checks.reach import base_box
from armwright.problem.problem import Problem
from armwright.tasks.payload import Payload

FAR_REACH = 100.0  # times what the targets need
WIDE_ANGLE = math.radians(90.0)  # [rad] of a tolerance


def check_magnitudes(problem: Problem) -> Iterator[Finding]:
    """Find numbers that are probably in another unit, or mistyped."""
    for messages in (_angles, _lengths, _reach):
        yield from (Finding(message, SUSPECTED) for message in messages(problem))


def _angles(problem: Problem) -> Iterator[str]:
    """Yield a message for an angle that any arm meets."""
    arrays = problem.task.target_arrays
    widest = int(np.argmax(np.where(arrays.n_angular > 0, arrays.angle_tolerance, 0.0)))
    angle = arrays.angle_tolerance[widest]
    if arrays.n_angular[widest] and angle > WIDE_ANGLE:
        yield (
            f"target {problem.task.target_names[widest]}: its angle_tolerance of {angle:g} rad is "
            f"{math.degrees(angle):.0f}°; angles are in radians: write {math.radians(angle):.4f} for {angle:g}°"
        )


def _lengths(problem: Problem) -> Iterator[str]:
    """Yield a message for each length of the task that is far beyond any arm."""
    task, tolerance = problem.task, problem.task.target_arrays.tolerance
    widest = int(np.argmax(tolerance))
    payload = task.payload.size if isinstance(task.payload, Payload) else None
    lengths = [  # what is so long, its length [m], and how many times the longest arm it may be
        (f"target {task.target_names[widest]}: tolerance", float(tolerance[widest]), 1.0),
        ("tool: the distance of its tip from the flange", task.tool.length, 3.0),
        ("cycle: approach", (task.cycle and task.cycle.approach) or 0.0, 1.0),
        ("payload: the longest side", max(payload or (0.0,)), 3.0),
        *((f"obstacle {o.name or i}: size", 2.0 * max(o.solid.half), 100.0) for i, o in enumerate(task.obstacles, 1)),
    ]
    arm = problem.space.max_reach
    for what, size, factor in lengths:
        if size > factor * arm:
            yield (
                f"{what} = {size:g} m is {size / arm:.3g} times the length of the longest arm without its tool, "
                f"{arm:.3g} m; lengths are in metres: write {size / 1e3:g} for {size:g} mm"
            )


def _reach(problem: Problem) -> Iterator[str]:
    """Yield a message for arms that are far longer than the task."""
    task, arm = problem.task, problem.space.max_reach
    low, high = base_box(problem.space)
    points = np.vstack([task.target_positions, *([corner] for region in task.workspace for corner in region.corners)])
    needed = float(np.linalg.norm(points - (low + high) / 2, axis=1).max())
    if needed > 0.0 and arm > FAR_REACH * needed:
        yield (
            f"space: the longest arm reaches {arm:.3g} m, {arm / needed:.0f} times what the targets need; link and "
            "stroke are in metres: write 0.3 for 300 mm"
        )
