"""Selection by hypervolume: which designs stay in a pool of limited size."""

import moocore
import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import front_mask

Indices = NDArray[np.intp]

MAX_EXACT_OBJECTIVES = 3  # objectives; with more, exact contributions take seconds per thousand points


def front(values: Array, reference_point: Array) -> Indices:
    """Return the indices of `values` (N, M) on the Pareto front and within the reference box."""
    within = np.flatnonzero(np.all(values < reference_point, axis=1))
    return within[front_mask(values[within])]


def nearest(values: Array, reference_point: Array, n: int) -> Indices:
    """Return the indices of at most `n` points on the front of `values` (N, M), nearest to the reference box."""
    best = np.flatnonzero(front_mask(values))
    excess = np.maximum(values[best] / reference_point - 1.0, 0.0).sum(axis=1)
    return best[np.argsort(excess, kind="stable")[:n]]


def survivors(values: Array, reference_point: Array, capacity: int) -> Indices:
    """Return the indices of at most `capacity` of `values` (N, M): the front, thinned or filled up.

    The front is filled up by Pareto rank. Points within the reference box come first, then those outside, ranked by how
    far they exceed it.
    """
    best = front(values, reference_point)
    if len(best) >= capacity:
        return best[thinned(values[best], reference_point, capacity)]
    return np.argsort(ranks(values, reference_point), kind="stable")[:capacity]


def ranks(values: Array, reference_point: Array) -> Indices:
    """Return the (N,) Pareto ranks of `values` (N, M); points outside the reference box rank behind those within."""
    outside = np.any(values >= reference_point, axis=1)
    excess = moocore.pareto_rank(np.maximum(values - reference_point, 0.0))
    return np.where(outside, len(values) + excess, moocore.pareto_rank(values))


def best_of_each(values: Array, groups: NDArray[np.int64], reference_point: Array, n: int) -> Indices:
    """Return the indices of the n points of the lowest rank of each group, given the (N,) groups of `values` (N, M)."""
    rank = ranks(values, reference_point)
    order = np.lexsort((rank, groups))
    _, starts, sizes = np.unique(groups[order], return_index=True, return_counts=True)
    return order[np.arange(len(order)) - np.repeat(starts, sizes) < n]


def leaders(values: Array, structures: NDArray[np.int64], reference_point: Array, n: int) -> Indices:
    """Return the indices of the best points of the n best structures, given the (N,) structures of `values` (N, M).

    A structure is as good as its point with the largest box: the volume that the point alone dominates, bounded by the
    reference point. Of each structure M + 1 points are kept: that one, and one for each objective, whose box is
    weighted by the gain in this objective, so that the ends of its front stay, too.
    """
    gains = np.maximum(reference_point - values, 0.0)
    boxes = np.prod(gains, axis=1)
    order = np.argsort(structures, kind="stable")
    starts = np.flatnonzero(np.diff(structures[order], prepend=-1))
    largest = np.maximum.reduceat(boxes[order], starts)
    leading = np.argsort(-largest, kind="stable")[: min(n, np.count_nonzero(largest))]
    sizes = np.diff(starts, append=len(order))
    kept: list[Indices] = []
    for weighted in (boxes, *(boxes[:, None] * gains**2).T):
        best = np.repeat(np.maximum.reduceat(weighted[order], starts), sizes)
        candidates = np.flatnonzero(weighted[order] == best)
        first = candidates[np.searchsorted(candidates, starts[leading])]
        kept.append(order[first])
    return np.unique(np.concatenate(kept))


def thinned(front: Array, reference_point: Array, capacity: int) -> Indices:
    """Return the indices of at most `capacity` points of a `front` (N, M) that keep most of its hypervolume."""
    kept = np.arange(len(front))
    if len(kept) > capacity and front.shape[1] > MAX_EXACT_OBJECTIVES:
        return _farthest(front, reference_point, capacity)
    while len(kept) > capacity:
        # Contributions change when neighbours are removed, so the surplus is removed in several rounds.
        contributions = moocore.hv_contributions(front[kept], ref=reference_point)
        surplus = len(kept) - capacity
        n_removed = min(surplus, max(-(-surplus // 2), capacity // 8))
        kept = np.delete(kept, np.argsort(contributions, kind="stable")[:n_removed])
    return kept


def _farthest(front: Array, reference_point: Array, n: int) -> Indices:
    """Return the points that reach farthest from the reference point along one of `n` fixed directions.

    The mean of (farthest reach) ** M over all directions is proportional to the hypervolume (Deng & Zhang,
    IEEE Trans. Evol. Comput. 23(6), 2019), so the other points contribute little.
    """
    directions = np.abs(np.random.default_rng(0).standard_normal((n, front.shape[1])))
    gain = reference_point - front
    gain /= gain.max(axis=0)
    reach = np.full((n, len(front)), np.inf)
    for objective, direction in zip(gain.T, directions.T, strict=True):
        np.minimum(reach, objective / direction[:, None], out=reach)
    return np.unique(np.argmax(reach, axis=1))
