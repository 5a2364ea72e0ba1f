"""Why an arm misses a target: out of its reach, joints at their limits, or no better posture found."""

import math

import numpy as np

from armwright.arrays import Array
from armwright.problem.evaluation import Evaluation
from armwright.robot.arm import Arm

AT_LIMIT = 1e-3  # [rad] or [m] from a limit, from which a joint counts as standing at it


def unreached_reason(arm: Arm, evaluation: Evaluation, row: int, target: int) -> str:
    """By how much and why; empty where the target is reached."""
    if not evaluation.unreached[row, target]:
        return ""
    by = miss_words(evaluation, row, target)
    beyond = float(np.linalg.norm(evaluation.targets[target] - np.array(arm.base))) - arm.reach
    reasons = [f"out of reach by {beyond:.3f} m"] if beyond > 0.0 else []
    reasons += limit_words(arm, evaluation.q[row, target])
    return f"{by}: {', '.join(reasons) or 'no better posture was found'}"


def miss_words(evaluation: Evaluation, row: int, target: int) -> str:
    """By how much: the distance, and the angle where the target asks for one."""
    distance = f"{1e3 * evaluation.position_error[row, target]:.1f} mm"
    if not evaluation.target_arrays.n_angular[target]:
        return distance
    return f"{distance} and {math.degrees(evaluation.angle_error[row, target]):.1f}°"


def limit_words(arm: Arm, q: Array) -> list[str]:
    """Which joints stand at which limit; q: (J,) or longer [rad] or [m]."""
    limits: list[str] = []
    for number, (joint, value) in enumerate(zip(arm.joints, q, strict=False), start=1):
        if joint.kind == "fixed":
            continue
        if value > joint.upper - AT_LIMIT:
            limits.append(f"joint {number} at its upper limit")
        elif value < joint.lower + AT_LIMIT:
            limits.append(f"joint {number} at its lower limit")
    return limits
