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
    rotational = np.cross(frames.axis, frames.tip[:, :, None] - frames.position)
    return np.where(_translates(arms), frames.axis, rotational).swapaxes(-1, -2)


def jacobian_rate(arms: ArmArrays, frames: Frames, velocity: Array) -> Array:
    """Return the (N, K, 3, D) rate of the Jacobian while the joints move at `velocity` (N, K, D)."""
    translates = _translates(arms)
    along = frames.axis * velocity[..., None]
    omega = np.cumsum(np.where(translates, 0.0, along), axis=2)  # (N, K, D, 3) angular velocity of each link
    parent_omega = np.zeros(omega.shape)  # of the link before each joint
    parent_omega[:, :, 1:] = omega[:, :, :-1]
    lever = frames.tip[:, :, None] - frames.position
    tip_velocity = np.where(translates, along, np.cross(along, lever))  # that each joint contributes
    later_joints = np.cumsum(tip_velocity[:, :, ::-1], axis=2)[:, :, ::-1] - tip_velocity
    relative_velocity = np.cross(omega, lever) + later_joints  # of the tip relative to the joint
    axis_rate = np.cross(parent_omega, frames.axis)
    rate = np.where(translates, axis_rate, np.cross(axis_rate, lever) + np.cross(frames.axis, relative_velocity))
    return rate.swapaxes(-1, -2)


def _translates(arms: ArmArrays) -> NDArray[np.bool_]:
    """Return (N, 1, D, 1) True for joints that do not rotate; the axes of fixed joints are 0."""
    return (arms.motion >= PRISMATIC)[:, None, :, None]
