# ruff: noqa: D205, D401 (a docstring here is the description that users and models read)
"""Quantities of arms that yield under load, have backlash, and can hold only so much."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.reach.compliance import (
    Stiffness,
    backlash_errors,
    own_loads,
    tip_displacements,
    tip_errors,
    unit_payload,
)
from armwright.kinematics.reach.payload_limits import payload_limits, torques_by_payload
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import quantity
from armwright.tasks.moments import MAX_MASS


@quantity("m", over="max", needs=("sections", "masses"), ratings=("joint_stiffness",))
def deflection(e: Evaluation) -> Array:
    """How far the arm's own weight and the payload move the tip in the kept posture, because links bend and twist and
    joints yield.
    """
    own = tip_displacements(e.arms, e.frames, own_loads(e.arms, e.frames), _stiffness(e))
    return np.linalg.norm(own + _payload_displacement(e), axis=-1)


@quantity("m", over="max", needs=("sections",), ratings=("joint_stiffness",), symbol="E_payload")
def payload_deflection(e: Evaluation) -> Array:
    """How far the payload alone moves the tip in the kept posture, because links bend and twist and joints yield."""
    return np.linalg.norm(_payload_displacement(e), axis=-1)


@quantity("m", over="max", ratings=("backlash",), symbol="E_backlash")
def backlash_error(e: Evaluation) -> Array:
    """How far half of the backlash of all actuators together moves the tip in the kept posture at most."""
    return backlash_errors(e.arms, e.frames, e.drives.backlash)


@quantity("m", "max", needs=("masses",), ratings=("coulomb", "load_friction", "position_gain"), symbol="E_friction")
def friction_error(e: Evaluation) -> Array:
    """How far the friction of all actuators together may stop the tip at most from where their position control and
    gravity compensation send it in the kept posture, on arrival from below; above it, less.
    """
    friction = e.drives.coulomb[:, None] + e.drives.load_friction[:, None] * np.abs(e.joint_torques)
    return tip_errors(e.arms, e.frames, friction / e.drives.position_gain[:, None])


@quantity("kg", over="min", needs=("masses",), ratings=("peak",), symbol="payload_capacity", more_is_better=True)
def payload_capacity(e: Evaluation) -> Array:
    """The largest payload that all actuators hold in the kept posture, with the safety factor, and that tilts no joint
    beyond what the maker of its actuator allows, or beyond the strongest actuator's torque if none is stated.
    """
    held = e.payload[:, None] * torques_by_payload(e.arms, e.frames)
    peak = e.drives.peak / e.drives.safety_factor[:, None]
    limits = payload_limits(e.arms, e.frames, e.joint_torques - held, peak)
    return limits if e.plan is None else np.where(e.plan.holds_payload(len(e.targets)), limits, MAX_MASS)


def _payload_displacement(e: Evaluation) -> Array:
    """Return the (N, T, 3) displacements of the tip by the payload [m]."""
    return e.payload[:, None] * tip_displacements(e.arms, e.frames, unit_payload(e.arms, e.frames), _stiffness(e))


def _stiffness(e: Evaluation) -> Stiffness:
    return Stiffness(e.arms.bending_stiffness, e.arms.torsional_stiffness, e.drives.joint_stiffness)
