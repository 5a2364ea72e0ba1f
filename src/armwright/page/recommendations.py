"""What the page says first about a run: the designs to build, or why there is none."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.problem.over_reach import reach_lines
from armwright.proof.cycle_export import trajectory_of
from armwright.proof.infeasibility import describe_infeasibility
from armwright.robot.arm import Joint
from armwright.runs.history import History

# What an engineer asks of an arm, in this order; each is left out where the run cannot know it.
ASKED = (
    "price",
    "mass",
    "payload_capacity",
    "cycle_time",
    "deflection",
    "backlash_error",
    "dynamic_utilisation",
    "thermal_utilisation",
    "mean_current",
)
INSTANTS = 160  # of a cycle, between which the largest value of each joint counts
DIGITS = 4  # of torques and speeds


def recommended_designs(history: History, recommended: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the recommended designs, each once.

    Args:
        history: The trials.
        recommended: The recommendations of a summary, several of which may be of one design.

    Returns:
        design, status and survival as in the summary; roles: all its roles; reach: of its data sheet [m];
        payload_at_full_reach: what its actuators hold there [kg], None if unknown; quantities: what else it can do, by
        name; loads: what its joints do along the cycle, None if that is not known.
    """
    numbers = list(dict.fromkeys(one["design"] for one in recommended))
    if not numbers:
        return []
    evaluation = history.evaluation(numbers)
    quantities = {name: _values(evaluation, name) for name in ASKED}
    found: list[dict[str, Any]] = []
    for row, number in enumerate(numbers):
        entries = [one for one in recommended if one["design"] == number]
        farthest = reach_lines(history.member(number).arm, float(evaluation.payload.max()))[-1]
        found.append(
            {
                "design": number,
                "roles": [one["role"] for one in entries],
                "status": entries[0]["status"],
                "survival": entries[0]["survival"],
                "reach": farthest.distance,
                "payload_at_full_reach": farthest.payload,
                "quantities": {name: float(each[row]) for name, each in quantities.items() if each is not None},
                "loads": _loads(history, evaluation, row, number),
            }
        )
    return found


def explained() -> dict[str, dict[str, str]]:
    """Return label, unit and description of each quantity, by name."""
    return {
        quantity.name: {"label": quantity.label, "unit": quantity.unit, "description": _sentences(quantity)}
        for quantity in QUANTITIES.values()
    }


def why_nothing(history: History, summary: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return why no design of a run with constraints is feasible, and the nearest one; None if one is feasible."""
    if not history.problem.constraints or not len(history) or history.feasible.any():
        return None
    feasibility: Mapping[str, Any] = (summary or {}).get("feasibility") or {}
    (number,) = history.nearest(1)
    return {"nearest": number, "description": describe_infeasibility(history, feasibility.get("conflict"))}


def _values(evaluation: Evaluation, name: str) -> Array | None:
    """Return (N,) the values of a quantity; None where the task or the space leaves it open."""
    try:
        values = QUANTITIES[name](evaluation)
    except SettingsError:
        return None
    return values if np.isfinite(values).all() else None


_OVER = {
    "sum": " Summed over the targets.",
    "max": " The worst target counts.",
    "min": " The target where it is smallest counts.",
    "rms": " The root mean square over the targets.",
    "arm": "",
}


def _sentences(quantity: Objective) -> str:
    """Return what a quantity is, and how the targets count."""
    return f"{quantity.description[0].upper()}{quantity.description[1:]}.{_OVER[quantity.over]}"


def _loads(history: History, evaluation: Evaluation, row: int, number: int) -> dict[str, Any] | None:
    """Return torques and speeds of the moving joints along the cycle, and their limits.

    Returns:
        seconds: duration of the cycle; torque, speed: of each joint, at most INSTANTS values, torques with the safety
        factor; slides: whether it slides; peak, continuous, no_load: its limits, None where unknown.
    """
    arm = history.member(number).arm
    joints = [joint for joint in arm.joints if joint.kind != "fixed"]
    if evaluation.plan is None or any(joint.actuator is None for joint in joints):
        return None
    try:
        trajectory = trajectory_of(arm, evaluation, row)
    except SettingsError:  # a step of unknown duration
        return None
    return {
        "seconds": float(trajectory.time[-1]),
        "torque": _thinned(trajectory.tau * arm.safety_factor),
        "speed": _thinned(trajectory.qd),
        "slides": [joint.kind == "prismatic" for joint in joints],
        "peak": [joint.effort for joint in joints],
        "continuous": [_continuous(joint) for joint in joints],
        "no_load": [joint.speed for joint in joints],
    }


def _continuous(joint: Joint) -> float | None:
    """Return the torque [N m] or force [N] that a joint can hold forever; None if unknown."""
    torque = None if joint.actuator is None else joint.actuator.continuous_torque
    return None if torque is None else torque / joint.travel


def _thinned(rows: Array) -> list[list[float]]:
    """Return for each joint the value of largest size in each of INSTANTS parts of a trajectory (R, D)."""
    parts = np.array_split(rows, min(INSTANTS, len(rows)))
    largest = np.array([np.take_along_axis(p, np.abs(p).argmax(axis=0)[None], axis=0)[0] for p in parts])
    return [[float(f"{value:.{DIGITS}g}") for value in column] for column in largest.T.tolist()]
