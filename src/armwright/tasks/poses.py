"""Poses of the tool, and lines between them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.rotations import rotation_about
from armwright.tasks.targets import ORIENTATION, TargetArrays

LINE_STEP = 0.02  # [m] largest distance of two samples of a line
ANGLE_STEP = 0.1  # [rad] likewise of the tool's angle
MIN_STEPS = 4  # of a line, for its spline


@dataclass(frozen=True)
class Poses:
    """P poses of the tool."""

    position: Array  # (P, 3) [m]
    rotation: Array  # (P, 3, 3) the tool's own x, y and z in the world as columns; unused axes are arbitrary
    n_angular: NDArray[np.intp]  # (P,) number of angles that count: 0, AXIS or ORIENTATION
    tolerance: Array  # (P,) allowed distance of the tip [m]
    angle_tolerance: Array  # (P,) allowed angle of the tool [rad]

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, index: NDArray[np.intp] | list[int]) -> "Poses":
        return Poses(*(getattr(self, field.name)[index] for field in fields(Poses)))

    @property
    def arrays(self) -> TargetArrays:
        """The directions and tolerances as the inverse kinematics takes them."""
        nothing = np.zeros(len(self))
        return TargetArrays(
            self.n_angular, self.rotation, self.tolerance, self.angle_tolerance, nothing + 1.0, nothing, nothing
        )


def stack_poses(parts: Sequence[Poses]) -> Poses:
    """Return the poses of several parts, one after the other."""
    return Poses(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Poses)))


def line_steps(poses: Poses, start: int, end: int) -> int:
    """Return the least number of steps of a line."""
    length = float(np.linalg.norm(poses.position[end] - poses.position[start]))
    angle = abs(shortest_turn(poses, start, end)[1])
    return max(MIN_STEPS, math.ceil(length / LINE_STEP - 1e-9), math.ceil(angle / ANGLE_STEP - 1e-9))


def along_line(poses: Poses, start: int, end: int, share: Array) -> Poses:
    """Return the poses at the given shares (S,) of a line: an orientation by slerp, an axis by the shortest arc."""
    n = len(share)
    a, b = poses.position[start], poses.position[end]
    axis, angle = shortest_turn(poses, start, end)
    rotation = rotation_about(axis, share * angle) @ poses.rotation[start]
    return Poses(
        position=(1.0 - share)[:, None] * a + share[:, None] * b,
        rotation=rotation,
        n_angular=np.full(n, poses.n_angular[start]),
        tolerance=np.full(n, poses.tolerance[end]),
        angle_tolerance=np.full(n, poses.angle_tolerance[end]),
    )


def shortest_turn(poses: Poses, start: int, end: int) -> tuple[Array, float]:
    """Return the unit axis (3,) and the angle [rad] of the shortest rotation between two poses."""
    first, last = poses.rotation[start], poses.rotation[end]
    kind = min(poses.n_angular[start], poses.n_angular[end])
    if kind == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    if kind == ORIENTATION:
        change = last @ first.T
        vector = 0.5 * np.array([change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1]])
        cosine = 0.5 * (float(np.trace(change)) - 1.0)
    else:
        vector, cosine = np.cross(first[:, 2], last[:, 2]), float(first[:, 2] @ last[:, 2])
    sine = float(np.linalg.norm(vector))
    return (vector / sine if sine > 0.0 else np.array([0.0, 0.0, 1.0])), math.atan2(sine, cosine)
