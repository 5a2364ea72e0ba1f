"""How targets are to be reached, beside their points: which way the tool points, how exactly, how much each counts."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

REACHED = 1e-3  # [m]; a target that is missed by less counts as reached
ALIGNED = math.radians(1.0)  # [rad]; the same of a target's axis or orientation
AXIS, ORIENTATION = 2, 3  # how many angles a target asks for; 0 of a point


@dataclass(frozen=True)
class Goals:
    """How T targets are to be reached. `rotation` says where the tool's own x, y and z should point in the world."""

    rows: NDArray[np.intp]  # (T,) 0 of a point alone, AXIS where the tool's z counts, ORIENTATION where its x does, too
    rotation: Array  # (T, 3, 3) with x, y, z as columns; what does not count is any
    tolerance: Array  # (T,) from which on a target counts as missed [m]
    angle_tolerance: Array  # (T,) the same [rad]
    weight: Array  # (T,) that multiplies a target's share of a sum of errors
    restarts: int = 0  # further starts of the inverse kinematics

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def oriented(self) -> bool:
        """Whether any target asks for more than its point."""
        return bool(self.rows.any())

    @property
    def trade(self) -> Array:
        """(T,) how far off a radian counts as, where a posture is chosen [m/rad]: the tolerances count alike."""
        return self.tolerance / self.angle_tolerance


@lru_cache
def plain_goals(n: int, restarts: int = 0) -> Goals:
    """Of n points alone."""
    return Goals(
        rows=np.zeros(n, dtype=np.intp),
        rotation=np.broadcast_to(np.eye(3), (n, 3, 3)),
        tolerance=np.full(n, REACHED),
        angle_tolerance=np.full(n, ALIGNED),
        weight=np.ones(n),
        restarts=restarts,
    )


def pointing(axis: tuple[float, float, float]) -> Array:
    """(3, 3) a rotation whose z is this direction; its x and y are any."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """(3, 3) about the fixed x, then y, then z [rad], as in URDF."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
