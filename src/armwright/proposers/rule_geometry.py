"""Position of the shoulder and length of an arm from its targets, without evaluating a design."""

import numpy as np

from armwright.arrays import Array
from armwright.problem.objectives import TORQUE_SCALE
from armwright.robot.arm import GRAVITY
from armwright.spaces.design_space import DesignSpace

INNER_PULL = 0.05  # weight of targets within reach, relative to those beyond
ROUNDS = 60


def shoulder(points: Array, reach: float) -> Array:
    """Return the point (3,) [m] from which the targets are least out of reach in total.

    Minimises Σ max(0, ‖p_i - c‖ - reach) by Weiszfeld's iteration. The sum is flat where all targets are in reach, so
    these have a small weight. The point lies on every symmetry plane of the targets.

    Args:
        points: (T, 3) targets [m].
        reach: of the arm [m].
    """
    centre = points.mean(axis=0)
    for _ in range(ROUNDS):
        distance = np.maximum(np.linalg.norm(points - centre, axis=1), 1e-3)  # (T,)
        weight = np.where(distance > reach, 1.0, INNER_PULL) / distance
        centre = weight @ points / weight.sum()
    return centre


def stretched_torque(space: DesignSpace, length: float) -> float:
    """Return the α-scaled gravity torque on the first joint of a stretched, level arm of `length` [m]."""
    link = length / space.max_joints
    lever = (np.arange(space.max_joints) + 0.5) * link  # (D,) centre of each link [m]
    return TORQUE_SCALE * GRAVITY * space.mass.mass(link) * float(lever.sum())


def affordable_length(space: DesignSpace, n_targets: int, torque: float, longest: float) -> float:
    """Return the length [m], at most `longest`, at which the level arm takes `torque` in total over all targets."""
    low, high = 0.0, longest
    if n_targets * stretched_torque(space, longest) <= torque:
        return longest
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        low, high = (middle, high) if n_targets * stretched_torque(space, middle) < torque else (low, middle)
    return low


def needed_length(points: Array) -> float:
    """Return the distance [m] from the best shoulder to the farthest of `points` (T, 3)."""
    return float(np.linalg.norm(points - shoulder(points, np.inf), axis=1).max())
