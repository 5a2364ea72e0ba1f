"""Further starts of the inverse kinematics, of which the best posture is kept."""

from collections.abc import Iterator

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, ArmArrays
from armwright.kinematics.ik.ik import Postures
from armwright.tasks.targets import TargetArrays


def random_starts(arrays: ArmArrays, n: int) -> Iterator[Array]:
    """Yield n times (N, 1, D) initial postures, each the same share of every joint's range for all arms."""
    if n == 0:
        return
    shares = np.random.default_rng(0).uniform(size=(n, MAX_JOINTS))[:, : arrays.dof]
    lower, upper = arrays.lower.astype(np.float64), arrays.upper.astype(np.float64)
    for share in shares:
        yield np.where(arrays.motion == FIXED, 0.0, lower + share * (upper - lower))[:, None]


def nearer_postures(first: Postures, second: Postures, targets: Array, target_arrays: TargetArrays) -> Postures:
    """Return, per arm and target, the posture with the smaller distance, angles included; the first of equals."""

    def off(postures: Postures) -> Array:
        distance = np.linalg.norm(postures.reached.astype(np.float64) - targets, axis=-1)
        return np.hypot(distance, target_arrays.metres_per_radian * postures.angle)

    better = off(second) < off(first)
    return Postures(
        q=np.where(better[..., None], second.q, first.q),
        reached=np.where(better[..., None], second.reached, first.reached),
        torque=np.where(better[..., None], second.torque, first.torque),
        angle=np.where(better, second.angle, first.angle),
    )
