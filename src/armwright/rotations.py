"""Rotation matrices, their columns being the rotated axes."""

import math
from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return the (3, 3) rotation about the fixed x, then y, then z axis [rad], as in URDF."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Return the (3, 3) rotation of a quaternion x i + y j + z k + w of any length but 0."""
    x, y, z, w = np.array([x, y, z, w]) / math.hypot(x, y, z, w)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def rotation_about(axis: Array, angle: Array | float) -> Array:
    """Return the (..., 3, 3) rotations about unit vectors (..., 3) by angles (...) [rad], by Rodrigues' formula.

    A vector of zeros stands for no rotation.
    """
    cross = np.cross(axis[..., None, :], np.eye(3)).swapaxes(-1, -2)  # v ↦ axis x v
    sine, cosine = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)


def rpy_from_rotation(rotation: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a (3, 3) rotation, the inverse of `rotation_from_rpy`.

    In gimbal lock (x straight up or down) roll and yaw rotate about the same line: all of it is yaw.
    """
    x, y, z = rotation.T
    level = math.hypot(x[0], x[1])
    pitch = math.atan2(-x[2], level)
    roll, yaw = (math.atan2(y[2], z[2]), math.atan2(x[1], x[0])) if level > 1e-9 else (0.0, math.atan2(-y[0], y[1]))
    return (roll + 0.0, pitch + 0.0, yaw + 0.0)  # no -0.0


def rotation_to_axis(axis: Sequence[float] | Array) -> Array:
    """Return a (3, 3) rotation whose z column points along `axis` (3,), of any length; x and y are arbitrary."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def cone_directions(axis: Sequence[float] | Array, half_angle: float, n: int) -> Array:
    """Return (n, 3) unit vectors spread evenly over a cone, by Fibonacci's lattice; a single one is the axis.

    The axis (3,) has any length. Half the opening angle [rad] is π for the whole sphere.
    R. Swinbank, R. J. Purser: Fibonacci grids: a novel approach to global modelling, QJRMS 132(619), 2006.
    """
    if n == 1:
        return (np.array(axis) / np.linalg.norm(axis))[None]
    index = np.arange(n) + 0.5
    z = 1.0 - (1.0 - np.cos(half_angle)) * index / n
    angle = np.pi * (3.0 - np.sqrt(5.0)) * index
    ring = np.sqrt(np.maximum(0.0, 1.0 - z**2))
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z]) @ rotation_to_axis(axis).T
