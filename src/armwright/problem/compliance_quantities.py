"""Quantities of arms that yield under load, have backlash, and can hold only so much."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.reach.compliance import (
    Stiffness,
    backlash_errors,
    own_loads,
    tip_displacements,
    unit_payload,
)
from armwright.kinematics.reach.payload_limits import payload_limits, torques_by_payload
from armwright.problem.evaluation import Evaluation
from armwright.tasks.moments import MAX_MASS


def deflection(evaluation: Evaluation) -> Array:
    """Return (N, T) how far its own weight and the payload move the tip [m]."""
    arms, frames, stiffness = evaluation.arms, evaluation.frames, _stiffness(evaluation)
    own = tip_displacements(arms, frames, own_loads(arms, frames), stiffness)
    return np.linalg.norm(own + _payload_displacement(evaluation, stiffness), axis=-1)


def payload_deflection(evaluation: Evaluation) -> Array:
    """Return (N, T) how far the payload moves the tip [m]."""
    return np.linalg.norm(_payload_displacement(evaluation, _stiffness(evaluation)), axis=-1)


def backlash_error(evaluation: Evaluation) -> Array:
    """Return (N, T) how far half of the backlash of all joints moves the tip at most [m]."""
    return backlash_errors(evaluation.arms, evaluation.frames, evaluation.drives.backlash)


def payload_capacity(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest payload that all motors hold [kg]; MAX_MASS where a cycle carries none."""
    arms, frames, drives = evaluation.arms, evaluation.frames, evaluation.drives
    held = evaluation.payload[:, None] * torques_by_payload(arms, frames)
    peak = drives.peak / drives.safety_factor[:, None]
    limits = payload_limits(arms, frames, evaluation.joint_torques - held, peak)
    if evaluation.plan is None:
        return limits
    return np.where(evaluation.plan.holds_payload(len(evaluation.targets)), limits, MAX_MASS)


def _payload_displacement(evaluation: Evaluation, stiffness: Stiffness) -> Array:
    """Return the (N, T, 3) displacements of the tip by the payload [m]."""
    arms, frames = evaluation.arms, evaluation.frames
    return evaluation.payload[:, None] * tip_displacements(arms, frames, unit_payload(arms, frames), stiffness)


def _stiffness(evaluation: Evaluation) -> Stiffness:
    arms = evaluation.arms
    return Stiffness(arms.bending_stiffness, arms.torsional_stiffness, evaluation.drives.joint_stiffness)
