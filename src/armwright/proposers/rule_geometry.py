"""Closed-form sizing of an arm for its targets: where its shoulder belongs, and how long it may be.

Nothing here evaluates a design; it is what a designer knows before the first trial.
"""

import numpy as np

from armwright.arrays import Array
from armwright.problem.objectives import TORQUE_SCALE
from armwright.robot.arm import GRAVITY
from armwright.spaces.design_space import DesignSpace

INNER_PULL = 0.05  # weight of a target that is already within reach, against one beyond it
ROUNDS = 60


def shoulder(points: Array, reach: float) -> Array:
    """(3,) the place from which an arm of `reach` [m] misses `points` (T, 3) by the smallest sum [m].

    It lies on every symmetry plane of the points, as a mirror does not change the sum. The sum of distances that are
    left, Σ max(0, ‖p_i - c‖ - reach), is flat where everything is in reach: a weak pull of the near targets settles c
    there. Weiszfeld's iteration, re-weighted.
    """
    place = points.mean(axis=0)
    for _ in range(ROUNDS):
        distance = np.maximum(np.linalg.norm(points - place, axis=1), 1e-3)  # (T,)
        weight = np.where(distance > reach, 1.0, INNER_PULL) / distance
        place = weight @ points / weight.sum()
    return place


def stretched_torque(space: DesignSpace, length: float) -> float:
    """Gravity's torque, α-scaled, on the first joint of an arm of `length` [m] that lies stretched and level."""
    link = length / space.max_joints
    lever = (np.arange(space.max_joints) + 0.5) * link  # (D,) of each link's middle [m]
    return TORQUE_SCALE * GRAVITY * space.mass.mass(link) * float(lever.sum())


def affordable_length(space: DesignSpace, n_targets: int, torque: float, longest: float) -> float:
    """The length [m], at most `longest`, at which reaching out level to every target costs `torque` in all."""
    low, high = 0.0, longest
    if n_targets * stretched_torque(space, longest) <= torque:
        return longest
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        low, high = (middle, high) if n_targets * stretched_torque(space, middle) < torque else (low, middle)
    return low


def needed_length(points: Array) -> float:
    """From the best shoulder to the farthest of `points` (T, 3) [m]."""
    return float(np.linalg.norm(points - shoulder(points, np.inf), axis=1).max())
