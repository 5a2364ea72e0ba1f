"""Which points of a pool stay: those that the hypervolume would lose most without, in a bounded number."""

import moocore
import numpy as np
from numpy.typing import NDArray

from armwright.pareto import Array, front_mask

Rows = NDArray[np.intp]

MOST_EXACT = 3  # objectives; with more, exact contributions cost milliseconds a hundred points


def survivors(values: Array, reference_point: Array, capacity: int) -> Rows:
    """The rows of `values` (N, M) that stay, at most `capacity`: of the front, or the whole front and the next best.

    Points within the reference box come before those outside, which are the better the less they exceed it.
    """
    inside = np.all(values < reference_point, axis=1)
    within, beyond = np.flatnonzero(inside), np.flatnonzero(~inside)
    on_front = front_mask(values[within])
    if on_front.sum() > capacity:
        front = within[on_front]
        return front[_thinned(values[front], reference_point, capacity)]
    # Of equal points the first is on the front, the others come right after it.
    within = within[_by_rank(values[within], ~on_front)]
    excess = np.maximum(values[beyond], reference_point)
    beyond = beyond[_by_rank(excess, np.zeros(len(excess)))]
    return np.concatenate([within, beyond])[:capacity]


def _by_rank(values: Array, handicap: NDArray[np.generic]) -> Rows:
    """The rows by rising Pareto rank."""
    if not len(values):
        return np.zeros(0, dtype=np.intp)
    return np.argsort(moocore.pareto_rank(values) + handicap, kind="stable")


def _thinned(front: Array, reference_point: Array, capacity: int) -> Rows:
    if front.shape[1] > MOST_EXACT:
        return _winners(front, reference_point, capacity)
    kept = np.arange(len(front))
    while len(kept) > capacity:
        # Contributions change as neighbours go, so not all of the surplus goes at once.
        contributions = moocore.hv_contributions(front[kept], ref=reference_point)
        surplus = min(len(kept) - capacity, max(-(-(len(kept) - capacity) // 2), capacity // 16))
        kept = np.delete(kept, np.argsort(contributions, kind="stable")[:surplus])
    return kept


def _winners(front: Array, reference_point: Array, capacity: int) -> Rows:
    """The points that reach farthest from the reference point along one of `capacity` fixed directions.

    The mean of (farthest reach) ** M over all directions is proportional to the hypervolume (Deng & Zhang,
    IEEE Trans. Evol. Comput. 23(6), 2019), so a point that wins nowhere hardly contributes.
    """
    directions = np.abs(np.random.default_rng(0).standard_normal((capacity, front.shape[1])))
    gain = reference_point - front
    gain /= gain.max(axis=0)
    reach = np.full((capacity, len(front)), np.inf)
    for objective, direction in zip(gain.T, directions.T, strict=True):
        np.minimum(reach, objective / direction[:, None], out=reach)
    return np.unique(np.argmax(reach, axis=1))
