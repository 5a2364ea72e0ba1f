"""Explain why an arm misses a target: out of its reach, joints at their limits, or no better posture found."""

import math

import numpy as np

from armwright.arrays import Array
from armwright.problem.evaluation import Evaluation
from armwright.robot.arm import Arm

AT_LIMIT = 1e-3  # [rad] or [m] from a limit, within which a joint counts as at its limit


def unreached_reason(arm: Arm, evaluation: Evaluation, row: int, target: int) -> str:
    """Return by how much and why an arm misses a target; empty if it reaches it."""
    if not evaluation.unreached[row, target]:
        return ""
    by = describe_miss(evaluation, row, target)
    beyond = float(np.linalg.norm(evaluation.targets[target] - np.array(arm.base))) - arm.reach
    reasons = [f"out of reach by {beyond:.3f} m"] if beyond > 0.0 else []
    reasons += joints_at_limits(arm, evaluation.q[row, target])
    return f"{by}: {', '.join(reasons) or 'no better posture was found'}"


def describe_miss(evaluation: Evaluation, row: int, target: int) -> str:
    """Return the distance, and the angle if the target has one."""
    distance = f"{1e3 * evaluation.position_error[row, target]:.1f} mm"
    if not evaluation.target_arrays.n_angular[target]:
        return distance
    return f"{distance} and {math.degrees(evaluation.angle_error[row, target]):.1f}°"


def joints_at_limits(arm: Arm, q: Array) -> list[str]:
    """Return the joints at their limits; q: (J,) or longer [rad] or [m]."""
    limits: list[str] = []
    for number, (joint, value) in enumerate(zip(arm.joints, q, strict=False), start=1):
        if joint.kind == "fixed":
            continue
        if value > joint.upper - AT_LIMIT:
            limits.append(f"joint {number} at its upper limit")
        elif value < joint.lower + AT_LIMIT:
            limits.append(f"joint {number} at its lower limit")
    return limits
