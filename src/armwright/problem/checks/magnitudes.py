"""Numbers of a size that was hardly meant: millimetres, degrees, grams, one coordinate far off."""

import math
from collections.abc import Iterator

import numpy as np

from armwright.problem.checks.finding import SUSPECTED, Finding, describe_point
from armwright.problem.checks.reach import base_box, distance_to_bases, longest_reach
from armwright.problem.problem import Problem
from armwright.tasks.obstacles import Box, Cylinder, Sphere
from armwright.tasks.payload import Payload

OUTLIER = 10.0  # times the largest other coordinate of all targets
FEW = 6  # coordinates, below which none is an outlier
LONG_TOOL = 3.0  # times the longest arm
FAR_REACH = 100.0  # times what the targets need
HUGE_SOLID = 100.0  # times the reach
WIDE_ANGLE = math.radians(90.0)  # [rad] of a tolerance


def check_magnitudes(problem: Problem) -> Iterator[Finding]:
    """Find numbers that are probably in another unit, or mistyped."""
    for messages in (_coordinates, _tolerances, _lengths, _sizes):
        yield from (Finding(message, SUSPECTED) for message in messages(problem))


def _coordinates(problem: Problem) -> Iterator[str]:
    """Yield a message for a coordinate ten times as large as all others of all targets."""
    positions = problem.task.target_positions
    flat = np.abs(positions).ravel()
    if len(flat) < FEW:
        return
    index = int(np.argmax(flat))
    others = float(np.delete(flat, index).max())
    if others > 0.0 and flat[index] >= OUTLIER * others:
        target, axis = divmod(index, 3)
        yield (
            f"target {problem.task.target_names[target]} {describe_point(positions[target])}: its {'xyz'[axis]} = "
            f"{positions[target, axis]:g} m is {flat[index] / others:.3g} times the largest other coordinate of all "
            "targets; a misplaced decimal point, or another unit?"
        )


def _tolerances(problem: Problem) -> Iterator[str]:
    """Yield a message for tolerances that any arm meets."""
    arrays, names, reach = problem.task.target_arrays, problem.task.target_names, longest_reach(problem)
    widest = int(np.argmax(arrays.tolerance))
    if arrays.tolerance[widest] >= reach:
        yield (
            f"target {names[widest]}: its tolerance of {arrays.tolerance[widest]:g} m exceeds the reach of the longest "
            f"arm, {reach:.3g} m; tolerances are in metres: write 0.002 for 2 mm"
        )
    widest = int(np.argmax(np.where(arrays.n_angular > 0, arrays.angle_tolerance, 0.0)))
    angle = arrays.angle_tolerance[widest]
    if arrays.n_angular[widest] and angle > WIDE_ANGLE:
        yield (
            f"target {names[widest]}: its angle_tolerance of {angle:g} rad is {math.degrees(angle):.0f}°; angles are "
            f"in radians: write {math.radians(angle):.4f} for {angle:g}°"
        )


def _lengths(problem: Problem) -> Iterator[str]:
    """Yield a message for a tool, an approach or links that are far longer than the task."""
    task, reach = problem.task, longest_reach(problem)
    arm, tool = reach - task.tool.length, task.tool.length
    if tool > LONG_TOOL * arm:
        yield (
            f"tool: its tip is {tool:g} m from the flange, and the longest arm without it {arm:.3g} m; lengths are in "
            "metres: write 0.1 for 100 mm"
        )
    approach = None if task.cycle is None else task.cycle.approach
    if approach is not None and approach > reach:
        yield (
            f"cycle: approach = {approach:g} m exceeds the reach of the longest arm, {reach:.3g} m; lengths are in "
            "metres: write 0.05 for 50 mm"
        )
    low, high = base_box(problem.space)
    points = np.vstack([task.target_positions, *([corner] for region in task.workspace for corner in region.corners)])
    needed = max(float(np.ptp(points, axis=0).max()), float(distance_to_bases(problem.space, points).max()))
    # A single target within the bases needs no length at all; its distance from their centre has the right size.
    needed = max(needed, float(np.linalg.norm(points - (low + high) / 2, axis=1).max()))
    if needed > 0.0 and arm > FAR_REACH * needed:
        yield (
            f"space: the longest arm reaches {arm:.3g} m, {arm / needed:.0f} times what the targets need; link and "
            "stroke are in metres: write 0.3 for 300 mm"
        )


def _sizes(problem: Problem) -> Iterator[str]:
    """Yield a message for solids that are far larger than any arm."""
    reach = longest_reach(problem)
    for number, obstacle in enumerate(problem.task.obstacles, start=1):
        match obstacle:
            case Box():
                size = max(obstacle.size)
            case Sphere():
                size = 2 * obstacle.radius
            case Cylinder():
                size = max(2 * obstacle.radius, obstacle.height)
            case _:
                continue
        if size > HUGE_SOLID * reach:
            yield (
                f"obstacle {obstacle.name or number} is {size:g} m long, {size / reach:.0f} times the reach of the "
                "longest arm; sizes are in metres: write 0.4 for 400 mm"
            )
    payload = problem.task.payload
    if isinstance(payload, Payload) and payload.size is not None and max(payload.size) > LONG_TOOL * reach:
        yield f"payload: a side of {max(payload.size):g} m exceeds any arm; sizes are in metres: write 0.06 for 60 mm"
