"""The outline of all points that the tip of an arm reaches, seen along an axis of the world.

The tip is farthest where joints are at their limits or the arm is straight (Siciliano et al. 2009, section 2.10). So
some postures are drawn with joints there, and those that reach farthest in each direction are changed a little, by less
and less, and kept where they reach farther still.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays, stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.robot.arm import Arm

N_SECTORS = 72
N_RANDOM, N_ROUNDS, N_CHANGED = 20_000, 24, 24  # postures; rounds; changed postures of each sector in a round
AT_LIMIT, AT_ZERO = 0.25, 0.25  # shares of the joints of random postures
FIRST_STEP, SHRINKING = 0.2, 0.8  # of a joint's range; from round to round


@dataclass(frozen=True)
class Outline:
    """The farthest points of the tip in the sectors around the base, in a plane of the world."""

    points: tuple[tuple[float, float], ...]
    """(S, 2) of each sector, counterclockwise [m]; the base where a sector has none."""


def reach_outline(arm: Arm, view: tuple[int, int]) -> Outline:
    """Return the outline of what the tip reaches, joint limits considered; view: the axes of the plane, 0 to 2."""
    arms, rng = stack_arms([arm], "float64"), np.random.default_rng(0)
    low, high = (np.where(arms.motion == FIXED, 0.0, limit)[0] for limit in (arms.lower, arms.upper))
    base = np.array([arm.base[axis] for axis in view])
    q = _random_postures(rng, low, high)
    best, q = _farthest(_seen(arms, q, view) - base, q)
    for number in range(N_ROUNDS):
        step = FIRST_STEP * SHRINKING**number * (high - low)
        parents = np.tile(q, (N_CHANGED, 1))
        changed = parents + step * rng.normal(size=parents.shape) * (rng.uniform(size=parents.shape) < 0.5)
        tried = np.vstack([q, np.clip(changed, low, high)])
        best, q = _farthest(_seen(arms, tried, view) - base, tried)
    points = np.tile(base, (N_SECTORS, 1))
    points[_sectors(best)] += best
    return Outline(tuple((float(x), float(y)) for x, y in points))


def _random_postures(rng: np.random.Generator, low: Array, high: Array) -> Array:
    """Return (K, D) postures of random joints, some of them at a limit or at zero."""
    shape = (N_RANDOM, len(low))
    kind, ends = rng.uniform(size=shape), np.where(rng.uniform(size=shape) < 0.5, low, high)
    q = np.where(kind < AT_LIMIT, ends, rng.uniform(low, high, size=shape))
    q = np.where(kind > 1.0 - AT_ZERO, np.clip(0.0, low, high), q)
    q[0] = np.clip(0.0, low, high)
    return q


def _seen(arms: ArmArrays, q: Array, view: tuple[int, int]) -> Array:
    """Return the (K, 2) positions of the tip in postures (K, D), in a plane of the world [m]."""
    return forward_kinematics(arms, q[None]).tip[0][:, list(view)]


def _farthest(points: Array, q: Array) -> tuple[Array, Array]:
    """Return the farthest point of each sector that has one, and its posture; points: (K, 2) from the base [m]."""
    order = np.argsort(np.hypot(points[:, 0], points[:, 1]), kind="stable")
    of_sector = np.full(N_SECTORS, -1)
    of_sector[_sectors(points[order])] = order  # the last one assigned to a sector is the farthest
    rows = of_sector[of_sector >= 0]
    return points[rows], q[rows]


def _sectors(points: Array) -> NDArray[np.intp]:
    """Return the (K,) sectors of points (K, 2) around the origin."""
    turn = (np.arctan2(points[:, 1], points[:, 0]) + np.pi) / (2.0 * np.pi)
    return np.minimum((turn * N_SECTORS).astype(np.intp), N_SECTORS - 1)
