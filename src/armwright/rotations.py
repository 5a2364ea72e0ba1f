"""Rotation matrices, their columns being the rotated axes."""

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


def rotation_to_axis(axis: Sequence[float] | Array) -> Array:
    """Return a (3, 3) rotation whose z column points along `axis` (3,), of any length; x and y are arbitrary."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
