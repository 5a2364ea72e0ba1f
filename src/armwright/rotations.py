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


def cone_directions(axis: Sequence[float] | Array, half_angle: float, n: int) -> Array:
    """Return (n, 3) unit vectors spread evenly over a cone, by Fibonacci's lattice.

    R. Swinbank, R. J. Purser: Fibonacci grids: a novel approach to global modelling, QJRMS 132(619), 2006.

    Args:
        axis: (3,) middle of the cone, of any length.
        half_angle: Half its opening angle [rad]; π for the whole sphere.
        n: Number of vectors; 1 for the axis alone.
    """
    if n == 1:
        return (np.array(axis) / np.linalg.norm(axis))[None]
    index = np.arange(n) + 0.5
    z = 1.0 - (1.0 - np.cos(half_angle)) * index / n
    angle = np.pi * (3.0 - np.sqrt(5.0)) * index
    ring = np.sqrt(np.maximum(0.0, 1.0 - z**2))
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z]) @ rotation_to_axis(axis).T
