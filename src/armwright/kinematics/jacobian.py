"""Position Jacobians of postures, in numpy and float64."""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import PRISMATIC, ArmArrays
from armwright.kinematics.forward import Frames, forward_kinematics


def jacobians(arms: ArmArrays, q: Array) -> Array:
    """Return the (N, K, 3, D) derivative of the tip position by the joints [m/rad] or [m/m]; q: (N, K, D)."""
    return jacobian_of(arms, forward_kinematics(arms, q))


def jacobian_of(arms: ArmArrays, frames: Frames) -> Array:
    """Return the (N, K, 3, D) derivative of the tip position by the joints, from known frames."""
    turning = np.cross(frames.axis, frames.tip[:, :, None] - frames.position)
    return np.where(_translates(arms), frames.axis, turning).swapaxes(-1, -2)


def jacobian_rate(arms: ArmArrays, frames: Frames, velocity: Array) -> Array:
    """Return the (N, K, 3, D) rate of the Jacobian while the joints move at `velocity` (N, K, D)."""
    translates = _translates(arms)
    along = frames.axis * velocity[..., None]
    turning = np.cumsum(np.where(translates, 0.0, along), axis=2)  # (N, K, D, 3) angular velocity of each link
    spin = np.zeros(turning.shape)  # of the link that each joint stands on
    spin[:, :, 1:] = turning[:, :, :-1]
    lever = frames.tip[:, :, None] - frames.position
    share = np.where(translates, along, np.cross(along, lever))  # of each joint in the tip's velocity
    # The tip's velocity relative to a joint: from the spin of the joint's link and from the joints after it.
    after = np.cumsum(share[:, :, ::-1], axis=2)[:, :, ::-1] - share
    moving = np.cross(turning, lever) + after
    rotated = np.cross(spin, frames.axis)
    rate = np.where(translates, rotated, np.cross(rotated, lever) + np.cross(frames.axis, moving))
    return rate.swapaxes(-1, -2)


def _translates(arms: ArmArrays) -> NDArray[np.bool_]:
    """Return (N, 1, D, 1) True for joints that do not rotate; the axes of fixed joints are 0."""
    return (arms.motion >= PRISMATIC)[:, None, :, None]
