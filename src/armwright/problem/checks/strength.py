"""Payloads that the motors or the links of a space can hardly hold."""

from collections.abc import Iterator

import numpy as np

from armwright.problem.checks.bounds import intervals_by_modules
from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.checks.reach import base_box
from armwright.problem.problem import Problem
from armwright.robot.arm import GRAVITY
from armwright.spaces.joint_modules import MODULES

HEAVY = 100.0  # times the heaviest arm


def check_strength(problem: Problem) -> Iterator[Finding]:
    """Find payloads that the strongest motor cannot hold at half reach, or that dwarf the arm itself.

    Half reach is half of what the targets require of any base, at most half of the longest arm. The motor turns about a
    horizontal axis; arms whose axes are all vertical would hold more.
    """
    space, actuators, payload = problem.space, problem.space.arm_actuators, float(problem.task.payloads.max())
    turns = any(MODULES[letter].is_revolute for letter in space.joint_types)
    lever = min(problem.max_reach, _needed_reach(problem)) / 2
    if payload > 0.0 and actuators and turns and lever > 0.0:
        strongest = max(actuators, key=lambda actuator: actuator.peak_torque)
        allowed = strongest.peak_torque / space.safety_factor
        needed = GRAVITY * (payload + problem.task.tool.mass) * lever
        if needed > allowed:
            yield Finding(
                f"payload: {payload:g} kg take {needed:.3g} N m about a horizontal axis at {lever:.3g} m, half of the "
                f"reach that the targets require; the strongest motor, {strongest.name}, has "
                f"{strongest.peak_torque:g} N m, with the safety factor {allowed:.3g} N m; name stronger actuators, or "
                "check that the payload is in kilograms",
                SUSPECTED,
            )
    heaviest = max(known["mass"].high for known in intervals_by_modules(problem).values())
    if payload > HEAVY * heaviest > 0.0:
        toy = "; the links are a toy" if space.is_toy else ""
        yield Finding(
            f"payload: {payload:g} kg are {payload / heaviest:,.0f} times the mass of the heaviest arm of the space, "
            f"{heaviest:.3g} kg{toy}; state mass and actuators of a real arm in the space, or check that the payload "
            "is in kilograms",
            SUSPECTED,
        )


def _needed_reach(problem: Problem) -> float:
    """Return the horizontal distance from the base to a target that every base has to some target at least [m]."""
    task = problem.task
    carried = task.target_positions[task.payloads > 0.0, :2]
    if not len(carried):
        return 0.0
    low, high = (corner[:2] for corner in base_box(problem.space))
    # No base is nearer than this to both ends of the targets along an axis, or to the nearest part of its box.
    spread = float(np.ptp(carried, axis=0).max()) / 2
    return max(spread, float(np.linalg.norm(carried - np.clip(carried, low, high), axis=1).max()))
