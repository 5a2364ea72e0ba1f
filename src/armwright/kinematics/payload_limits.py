"""Payloads that motors hold at rest, in known postures and over the reach of an arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.forward import Frames, forward_kinematics
from armwright.kinematics.ik import solve_postures
from armwright.kinematics.restarts import random_starts
from armwright.robot.arm import GRAVITY, Arm
from armwright.tasks.moments import MAX_MASS

N_DIRECTIONS, N_STARTS = 16, 16  # horizontal directions, and random starts, that are searched for postures
FAR = 100.0  # times the reach: a point towards which an arm stretches
WIDE = 0.9  # of the largest reach: directions in which an arm reaches less do not count
NEAR = 0.01  # of the reach: the tip is where it should be


@dataclass(frozen=True)
class ReachPayloads:
    """Payloads of an arm at fractions of its horizontal reach.

    Attributes:
        reach: The largest horizontal distance of the tip from the first joint [m].
        payloads: The payload held in all postures found at each fraction [kg]; NaN where none was found.
    """

    reach: float
    payloads: tuple[float, ...]


def payload_limits(arms: ArmArrays, frames: Frames, torques: Array, peak: Array) -> Array:
    """Return the (N, K) largest payloads that all motors hold at rest [kg], at most MAX_MASS.

    Torques are linear in the mass of the payload, so each motor holds up to a limit of its own. An arm that does not
    hold itself holds nothing.

    Args:
        arms: N arms.
        frames: Their frames in K postures.
        torques: (N, K, D) that hold the arms without payload [N m], or forces [N].
        peak: (N, D) torques [N m], or forces [N], that may be used at rest.
    """
    by_mass, allowed = torques_by_payload(arms, frames), peak[:, None]
    loaded = by_mass != 0.0
    room = (allowed - np.sign(by_mass) * torques) / np.where(loaded, np.abs(by_mass), 1.0)
    limits = np.where(loaded, room, np.inf).min(axis=-1)
    holds_itself = (np.abs(torques) <= allowed).all(axis=-1)
    return np.where(holds_itself, np.clip(limits, 0.0, MAX_MASS), 0.0)


def torques_by_payload(arms: ArmArrays, frames: Frames) -> Array:
    """Return the (N, K, D) torques that hold a payload, by its mass [N m/kg], or forces [N/kg]."""
    center = frames.tip + (frames.rotation[:, :, -1] @ arms.payload_center.astype(np.float64)[:, None, :, None])[..., 0]
    rises = np.cross(frames.axis, center[:, :, None] - frames.position)[..., 2]
    return GRAVITY * np.where(arms.prismatic[:, None], frames.axis[..., 2], rises)


def payloads_over_reach(arm: Arm, fractions: Sequence[float] = (0.5, 1.0)) -> ReachPayloads:
    """Return the payloads that an arm holds at fractions of its horizontal reach, with its safety factor.

    The reach in a direction is that of the widest posture found, and the tip stays at the height of that posture.
    Directions in which the arm reaches nearly as far as in any count, and in them all postures found: the least payload
    is the one that the arm holds however it gets there. The payload is a point at the tip.

    Args:
        arm: An arm with actuators.
        fractions: Of the reach, each above 0 and at most 1.
    """
    arms = stack_arms([arm])
    # From the first joint at the origin, so that far points keep their precision.
    arms = replace(arms, base=np.zeros_like(arms.base))
    assert arms.actuation is not None, "expected an arm with actuators"
    allowed = arms.actuation.peak / arms.actuation.safety_factor[:, None]
    starts = [np.zeros((1, 1, arms.dof)), *random_starts(arms, N_STARTS)]
    widest, stretched = _stretched(arms, FAR * arm.reach, starts)
    reach = np.hypot(widest[:, 0], widest[:, 1])
    counts = reach >= WIDE * reach.max()
    scale = np.stack([fractions, fractions, np.ones(len(fractions))], axis=1)[:, None]  # (F, 1, 3)
    targets = (scale * widest[counts]).reshape(-1, 3)  # (F W, 3)
    starts += [np.tile(q[:, counts], (1, len(fractions), 1)) for q in stretched]
    least = np.full(len(targets), np.nan)
    for start in starts:
        found = solve_postures(arms, targets, initial_q=start, precision=arms.precision)
        frames = forward_kinematics(arms, found.q.astype(np.float64))
        held = payload_limits(arms, frames, found.torque.astype(np.float64), allowed)[0]
        is_there = np.linalg.norm(found.reached[0] - targets, axis=1) < NEAR * reach.max()
        least = np.fmin(least, np.where(is_there, held, np.nan))
    payloads = np.fmin.reduce(least.reshape(len(fractions), -1), axis=1)
    return ReachPayloads(float(reach.max()), tuple(payloads.tolist()))


def _stretched(arms: ArmArrays, distance: float, starts: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Stretch an arm in horizontal directions, towards points at a distance [m].

    Returns:
        (W, 3) tip of the widest posture in each direction [m], and the (1, W, D) postures from each start.
    """
    angles = 2.0 * np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(N_DIRECTIONS)], axis=1)
    found = [solve_postures(arms, distance * directions, initial_q=q, precision=arms.precision) for q in starts]
    tips = np.concatenate([postures.reached for postures in found]).astype(np.float64)  # (S, W, 3)
    best = (tips * directions).sum(axis=-1).argmax(axis=0)
    return tips[best, np.arange(N_DIRECTIONS)], [postures.q.astype(np.float64) for postures in found]
