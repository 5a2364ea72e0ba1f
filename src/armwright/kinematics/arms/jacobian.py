"""Position Jacobians of postures, in numpy and float64."""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import PRISMATIC, ArmArrays
from armwright.kinematics.arms.forward import Frames, forward_kinematics


def jacobians(arms: ArmArrays, q: Array) -> Array:
    """Return the (N, K, 3, D) derivative of the tip position by the joints [m/rad] or [m/m]; q: (N, K, D)."""
    return jacobian_of(arms, forward_kinematics(arms, q))


def jacobian_of(arms: ArmArrays, frames: Frames) -> Array:
    """Return the (N, K, 3, D) derivative of the tip position by the joints, from known frames."""
    rotational = np.cross(frames.axis, frames.tip[:, :, None] - frames.position)
    return np.where(_translates(arms), frames.axis, rotational).swapaxes(-1, -2)


def _translates(arms: ArmArrays) -> NDArray[np.bool_]:
    """Return (N, 1, D, 1) True for joints that do not rotate; the axes of fixed joints are 0."""
    return (arms.motion >= PRISMATIC)[:, None, :, None]
