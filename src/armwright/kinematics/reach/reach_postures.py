"""Postures of an arm over its horizontal reach."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.ik.ik import Postures, solve_postures
from armwright.robot.arm import Arm

N_DIRECTIONS, N_STARTS = 16, 16  # horizontal directions, and random starts, that are searched for postures
FAR = 100.0  # times the reach: a point towards which an arm stretches
WIDE = 0.9  # of the largest reach: directions in which an arm reaches less do not count
NEAR = 0.01  # of the reach: the tip is where it should be


@dataclass(frozen=True)
class ReachPostures:
    """Postures of an arm at F fractions of its horizontal reach.

    The reach in a direction is that of the widest posture found, and the tip stays at the height of that posture.
    Directions in which the arm reaches nearly as far as in any count, and in them all postures found.
    """

    arms: ArmArrays  # the arm, its first joint at the origin
    reach: float  # the largest horizontal distance of the tip from the first joint [m]
    targets: Array  # (K, 3) the points of all fractions and directions [m]
    starts: tuple[Postures, ...]  # postures from each start of the inverse kinematics, (1, K, D)
    fractions: int  # number of fractions

    def found(self) -> Iterator[tuple[Postures, NDArray[np.bool_]]]:
        """Yield the postures from each start, and (K,) whether the tip is where it should be."""
        for postures in self.starts:
            yield postures, postures.distance(self.targets)[0] < NEAR * self.reach

    def by_fraction(self, values: Array) -> Array:
        """Return (F, W) of (K,) values: of the W directions at each fraction."""
        return values.reshape(self.fractions, -1)


def postures_over_reach(arm: Arm, fractions: Sequence[float]) -> ReachPostures:
    """Return postures of an arm at fractions of its horizontal reach, each above 0 and at most 1."""
    arms = stack_arms([arm])
    # From the first joint at the origin, so that far points keep their precision.
    arms = replace(arms, base=np.zeros_like(arms.base))
    starts = [np.zeros((1, 1, arms.dof)), *arms.random_postures(N_STARTS)[:, :, None]]
    widest, stretched = _stretched(arms, FAR * arm.reach, starts)
    reach = np.hypot(widest[:, 0], widest[:, 1])
    counts = reach >= WIDE * reach.max()
    scale = np.stack([fractions, fractions, np.ones(len(fractions))], axis=1)[:, None]  # (F, 1, 3)
    targets = (scale * widest[counts]).reshape(-1, 3)  # (F W, 3)
    starts += [np.tile(q[:, counts], (1, len(fractions), 1)) for q in stretched]
    found = [solve_postures(arms, targets, initial_q=start, precision=arms.precision) for start in starts]
    return ReachPostures(arms, float(reach.max()), targets, tuple(found), len(fractions))


def _stretched(arms: ArmArrays, distance: float, starts: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Stretch an arm in horizontal directions, towards points at a distance [m].

    Returns:
        (W, 3) tip of the widest posture in each direction [m], and the (1, W, D) postures from each start.
    """
    angles = 2.0 * np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(N_DIRECTIONS)], axis=1)
    found = [solve_postures(arms, distance * directions, initial_q=q, precision=arms.precision) for q in starts]
    tips = np.concatenate([postures.reached for postures in found]).astype(np.float64)  # (S, W, 3)
    best = (tips * directions).sum(axis=-1).argmax(axis=0)
    return tips[best, np.arange(N_DIRECTIONS)], [postures.q.astype(np.float64) for postures in found]
