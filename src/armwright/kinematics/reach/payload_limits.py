"""Payloads that motors hold and their bearings carry at rest, in known postures and over the reach of an arm."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import PRISMATIC, ArmArrays
from armwright.kinematics.arms.bearings import across_axis, bearing_limits
from armwright.kinematics.arms.forward import Frames, forward_kinematics
from armwright.kinematics.reach.compliance import joint_loads, own_loads, unit_payload
from armwright.kinematics.reach.reach_postures import ReachPostures
from armwright.robot.arm import GRAVITY
from armwright.tasks.moments import MAX_MASS


@dataclass(frozen=True)
class ReachPayloads:
    """Payloads of an arm at fractions of its horizontal reach."""

    reach: float  # the largest horizontal distance of the tip from the first joint [m]
    payloads: tuple[float, ...]
    """The payload held in all postures found at each fraction [kg]; NaN where none was found."""


def payload_limits(arms: ArmArrays, frames: Frames, torques: Array, peak: Array) -> Array:
    """Return the (N, K) largest payloads that all motors hold at rest [kg], at most MAX_MASS.

    Torques are linear in the mass of the payload, so each motor holds up to a limit of its own. An arm that does not
    hold itself holds nothing.

    torques: (N, K, D) that hold the arms without payload in K postures.  peak: (N, D) that may be used at rest; both
    are torques [N m], or forces [N].
    """
    by_mass, allowed = torques_by_payload(arms, frames), peak[:, None]
    loaded = by_mass != 0.0
    room = (allowed - np.sign(by_mass) * torques) / np.where(loaded, np.abs(by_mass), 1.0)
    limits = np.minimum(np.where(loaded, room, np.inf).min(axis=-1), _carried_by_bearings(arms, frames, peak))
    holds_itself = (np.abs(torques) <= allowed).all(axis=-1)
    return np.where(holds_itself, np.clip(limits, 0.0, MAX_MASS), 0.0)


def _carried_by_bearings(arms: ArmArrays, frames: Frames, peak: Array) -> Array:
    """Return the (N, K) largest payloads that load no joint across its axis more than allowed [kg], infinite if none.

    If a maker states no limit, a joint may be tilted by as much as the strongest motor of the arm can turn (peak).
    """
    drives = arms.actuation
    assert drives is not None, "expected arms with actuators"
    strongest = np.where((arms.motion < PRISMATIC) & (peak < np.inf), peak, 0.0).max(axis=1, keepdims=True)
    limits = bearing_limits(drives)
    limits[..., 0] = np.where(np.isnan(limits[..., 0]), strongest, limits[..., 0])
    limits = np.where(np.isnan(limits), np.inf, limits)[:, None, :, [0, 0, 1, 2]]  # (N, 1, D, 4)
    own, unit = (
        across_axis(arms, frames.axis, *joint_loads(frames, loads))
        for loads in (own_loads(arms, frames), unit_payload(arms, frames))
    )
    # |own + m unit|² = limit² is a quadratic equation a m² + 2 b m + c = 0.
    a, b = (unit**2).sum(axis=-1), (own * unit).sum(axis=-1)
    c = (own**2).sum(axis=-1) - limits**2
    with np.errstate(divide="ignore", invalid="ignore"):
        mass = np.where(a > 0.0, (np.sqrt(np.maximum(b**2 - a * c, 0.0)) - b) / a, np.inf)
    return np.where(c > 0.0, 0.0, mass).min(axis=(-2, -1))


def torques_by_payload(arms: ArmArrays, frames: Frames) -> Array:
    """Return the (N, K, D) torques that hold a payload, by its mass [N m/kg], or forces [N/kg]."""
    center = frames.from_tip(arms.payload_center)
    rises = np.cross(frames.axis, center[:, :, None] - frames.position)[..., 2]
    return GRAVITY * arms.by_independent(np.where(arms.prismatic[:, None], frames.axis[..., 2], rises))


def held_payloads(postures: ReachPostures) -> ReachPayloads:
    """Return the payloads that an arm with actuators holds in postures over its reach, with its safety factor.

    The least payload of all postures found is the one that the arm holds however it gets there. The payload is a point
    at the tip.
    """
    drives = postures.arms.actuation
    assert drives is not None, "expected an arm with actuators"
    allowed = drives.peak / drives.safety_factor[:, None]
    least = np.full(len(postures.targets), np.nan)
    for found, is_there in postures.found():
        frames = forward_kinematics(postures.arms, found.q.astype(np.float64))
        held = payload_limits(postures.arms, frames, found.torque.astype(np.float64), allowed)[0]
        least = np.fmin(least, np.where(is_there, held, np.nan))
    payloads = np.fmin.reduce(postures.by_fraction(least), axis=1)
    return ReachPayloads(postures.reach, tuple(payloads.tolist()))
