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
from armwright.tasks.targets import REACHED

N_DIRECTIONS, N_STARTS = 16, 16  # horizontal directions, and random starts, that are searched for the reach
FAR = 100.0  # times the reach: a point towards which an arm stretches


@dataclass(frozen=True)
class ReachPayloads:
    """Payloads of an arm at fractions of its horizontal reach.

    Attributes:
        reach: The largest horizontal distance of the tip from the first joint [m].
        payloads: The largest payload held at each fraction [kg]; NaN where no posture was found.
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

    The reach is that of the widest posture found. For each fraction, the tip is in the direction and at the height of
    that posture, and the best posture found counts. The payload is a point at the tip.

    Args:
        arm: An arm with actuators.
        fractions: Of the reach, each above 0 and at most 1.
    """
    arms = stack_arms([arm])
    # From the first joint at the origin, so that far points keep their precision.
    arms = replace(arms, base=np.zeros_like(arms.base))
    assert arms.actuation is not None, "expected an arm with actuators"
    angles = 2.0 * np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    far = FAR * arm.reach * np.stack([np.cos(angles), np.sin(angles), np.zeros(N_DIRECTIONS)], axis=1)
    starts: list[Array] = [np.zeros((1, 1, arms.dof)), *random_starts(arms, N_STARTS)]
    stretched = [solve_postures(arms, far, initial_q=start, precision=arms.precision) for start in starts]
    tips = np.concatenate([found.reached[0] for found in stretched]).astype(np.float64)
    widest = int(np.hypot(tips[:, 0], tips[:, 1]).argmax())
    starts.append(np.concatenate([found.q[0] for found in stretched])[widest][None, None].astype(np.float64))
    targets = tips[widest] * np.array([[fraction, fraction, 1.0] for fraction in fractions])
    best = np.full(len(fractions), np.nan)
    for start in starts:
        found = solve_postures(arms, targets, initial_q=start, precision=arms.precision)
        frames = forward_kinematics(arms, found.q.astype(np.float64))
        peak = arms.actuation.peak / arms.actuation.safety_factor[:, None]
        held = payload_limits(arms, frames, found.torque.astype(np.float64), peak)[0]
        reached = np.linalg.norm(found.reached[0] - targets, axis=1) < REACHED
        best = np.fmax(best, np.where(reached, held, np.nan))
    return ReachPayloads(float(np.hypot(*tips[widest, :2])), tuple(best.tolist()))
