"""Frames and Jacobians of posed arms: plain numpy in float64, for what is asked of kept postures alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import FIXED, PRISMATIC, ArmArrays


@dataclass(frozen=True)
class Frames:
    """Where the joints of N arms in K postures are in the world."""

    rotation: Array  # (N, K, D, 3, 3) the frame of what joint j carries, its axes as columns
    place: Array  # (N, K, D, 3) of the joint, after it has slid [m]
    axis: Array  # (N, K, D, 3) that it turns about, or slides along; of a fixed one 0
    tip: Array  # (N, K, 3) [m]


def frames_of(arms: ArmArrays, q: Array) -> Frames:
    """The frames in postures q (N, K, D) [rad] or [m]."""
    n, k, dof = q.shape
    turns, slides = arms.motion < PRISMATIC, (arms.motion >= PRISMATIC) & (arms.motion < FIXED)  # (N, D)
    local = np.where((turns | slides)[..., None], np.eye(3)[arms.motion % PRISMATIC], 0.0)  # (N, D, 3)
    cross = np.cross(local[:, :, None], np.eye(3)).swapaxes(-1, -2)[:, None]  # (N, 1, D, 3, 3): v ↦ local x v
    angle = np.where(turns[:, None], q, 0.0)[..., None, None]
    turned = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    way = np.where(slides[:, None], q, 0.0)[..., None]
    rotation, place, axis = np.empty((n, k, dof, 3, 3)), np.empty((n, k, dof, 3)), np.empty((n, k, dof, 3))
    frame = np.broadcast_to(np.eye(3), (n, k, 3, 3))
    at = np.broadcast_to(arms.base.astype(np.float64)[:, None], (n, k, 3))
    offset = arms.offset.astype(np.float64)
    for j in range(dof):
        axis[:, :, j] = (frame @ local[:, None, j, :, None])[..., 0]
        place[:, :, j] = at + axis[:, :, j] * way[:, :, j]
        frame = rotation[:, :, j] = frame @ turned[:, :, j]
        at = place[:, :, j] + (frame @ offset[:, None, j, :, None])[..., 0]
    return Frames(rotation, place, axis, at)


def jacobians(arms: ArmArrays, q: Array) -> Array:
    """(N, K, 3, D): how the tip moves with each joint [m/rad] or [m/m]; q: (N, K, D)."""
    return jacobian_of(arms, frames_of(arms, q))


def jacobian_of(arms: ArmArrays, frames: Frames) -> Array:
    """The same of postures whose frames are known."""
    turning = np.cross(frames.axis, frames.tip[:, :, None] - frames.place)
    return np.where(_slides(arms), frames.axis, turning).swapaxes(-1, -2)


def jacobian_rate(arms: ArmArrays, frames: Frames, velocity: Array) -> Array:
    """(N, K, 3, D) how the Jacobian changes while joints move at `velocity` (N, K, D)."""
    slides = _slides(arms)
    along = frames.axis * velocity[..., None]
    turning = np.cumsum(np.where(slides, 0.0, along), axis=2)  # (N, K, D, 3) of each link
    spin = np.zeros(turning.shape)  # of the link that each joint stands on
    spin[:, :, 1:] = turning[:, :, :-1]
    arm = frames.tip[:, :, None] - frames.place
    share = np.where(slides, along, np.cross(along, arm))  # of each joint in the tip's velocity
    # The tip's velocity against a joint's place comes of the spin of its own link, and of the joints after it.
    after = np.cumsum(share[:, :, ::-1], axis=2)[:, :, ::-1] - share
    moving = np.cross(turning, arm) + after
    turned = np.cross(spin, frames.axis)
    return np.where(slides, turned, np.cross(turned, arm) + np.cross(frames.axis, moving)).swapaxes(-1, -2)


def _slides(arms: ArmArrays) -> NDArray[np.bool_]:
    """(N, 1, D, 1)"""
    return (arms.motion >= PRISMATIC)[:, None, :, None]
