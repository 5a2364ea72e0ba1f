"""Position of the shoulder and reach of an arm from its targets, without evaluating a design."""

import numpy as np

from armwright.arrays import Array

INNER_PULL = 0.05  # weight of targets within reach, relative to those beyond
ROUNDS = 60


def shoulders(points: Array, reach: Array) -> Array:
    """Return the points (N, 3) [m] from which the targets are least out of reach in total.

    Minimises Σ max(0, ‖p_i - c‖ - reach) by Weiszfeld's iteration. The sum is flat where all targets are in reach, so
    these have a small weight. A point lies on every symmetry plane of the targets.

    Args:
        points: (T, 3) targets [m].
        reach: (N,) of the arms [m].
    """
    centre = np.repeat(points.mean(axis=0)[None], len(reach), axis=0)  # (N, 3)
    for _ in range(ROUNDS):
        distance = np.maximum(np.linalg.norm(points - centre[:, None], axis=-1), 1e-3)  # (N, T)
        weight = np.where(distance > reach[:, None], 1.0, INNER_PULL) / distance
        centre = weight @ points / weight.sum(axis=1)[:, None]
    return centre


def median(points: Array) -> Array:
    """Return the geometric median (3,) [m] of the targets, from which their distances are least in total."""
    return shoulders(points, np.zeros(1))[0]


def needed_length(points: Array) -> float:
    """Return the distance [m] from the geometric median to the farthest of `points` (T, 3)."""
    return float(np.linalg.norm(points - median(points), axis=1).max())
