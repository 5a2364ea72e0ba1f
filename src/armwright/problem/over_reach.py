"""Payload, deflection and backlash of an arm over its reach."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array, finite_or_none
from armwright.kinematics.reach.compliance import Stiffness, backlash_over_reach, deflections_over_reach
from armwright.kinematics.reach.payload_limits import held_payloads
from armwright.kinematics.reach.reach_postures import ReachPostures, postures_over_reach
from armwright.robot.arm import Arm

FRACTIONS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # of the reach


@dataclass(frozen=True)
class ReachLine:
    """An arm with its tip at a distance from its base axis."""

    fraction: float  # the share of the horizontal reach
    distance: float  # the horizontal distance from the first joint
    payload: float | None  # what the actuators hold there in every posture that was found
    deflection: float | None  # how far weight and the payload of the task move the tip there at most
    backlash_error: float | None  # how far half of the backlash moves the tip there at most


def reach_lines(arm: Arm, payload: float) -> tuple[ReachLine, ...]:
    """Return a line for each fraction of the reach, the largest last; payload: what moves the tip [kg]."""
    postures = postures_over_reach(arm, FRACTIONS)
    nothing = np.full(len(FRACTIONS), np.nan)
    drives = postures.arms.actuation
    unknown = drives is None or arm.no_mass or np.isnan(drives.peak).any()
    held = nothing if unknown else np.array(held_payloads(postures).payloads)
    play = nothing if drives is None else backlash_over_reach(postures, drives.backlash)
    columns = zip(FRACTIONS, held, _deflections(postures, payload), play, strict=True)
    return tuple(
        ReachLine(fraction, fraction * postures.reach, finite_or_none(most), finite_or_none(sag), finite_or_none(error))
        for fraction, most, sag, error in columns
    )


def _deflections(postures: ReachPostures, payload: float) -> Array:
    """Return (F,) the deflection at fractions of the reach [m]; NaN if a stiffness is not known."""
    arms, drives = postures.arms, postures.arms.actuation
    if drives is None:
        return np.full(postures.fractions, np.nan)
    stiffness = Stiffness(arms.bending_stiffness, arms.torsional_stiffness, drives.joint_stiffness)
    return deflections_over_reach(postures, stiffness, payload)
