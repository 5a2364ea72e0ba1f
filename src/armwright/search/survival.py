"""Which designs stay: those that the hypervolume would lose most without, in a bounded number."""

import moocore
import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import front_mask

Rows = NDArray[np.intp]

MOST_EXACT = 3  # objectives; with more, exact contributions cost seconds a thousand points


def front(values: Array, reference_point: Array) -> Rows:
    """The rows of `values` (N, M) that are on the front and within the reference box."""
    within = np.flatnonzero(np.all(values < reference_point, axis=1))
    return within[front_mask(values[within])]


def nearest(values: Array, reference_point: Array, most: int) -> Rows:
    """The rows on the front of `values` (N, M), at most so many, that exceed the reference box by the least share."""
    best = np.flatnonzero(front_mask(values))
    excess = np.maximum(values[best] / reference_point - 1.0, 0.0).sum(axis=1)
    return best[np.argsort(excess, kind="stable")[:most]]


def survivors(values: Array, reference_point: Array, capacity: int) -> Rows:
    """The rows of `values` (N, M) that stay, at most `capacity`: of the front, or the whole front and the next best.

    Points within the reference box come before those outside, which are the better the less they exceed it.
    """
    best = front(values, reference_point)
    if len(best) >= capacity:
        return best[thinned(values[best], reference_point, capacity)]
    others = np.setdiff1d(np.arange(len(values)), best)
    excess = np.maximum(values[others] - reference_point, 0.0)
    outside = np.any(values[others] >= reference_point, axis=1)
    rank = np.where(outside, moocore.pareto_rank(excess), moocore.pareto_rank(values[others]))
    return np.concatenate([best, others[np.lexsort((rank, outside))]])[:capacity]


def leaders(values: Array, structures: NDArray[np.int64], reference_point: Array, most: int) -> Rows:
    """Of the `most` best structures (N,), the rows of `values` (N, M) that are best in one of M + 1 ways.

    A structure is as good as the largest box of its points: what a point dominates alone, bounded by the reference
    point. The other ways give the gain in one objective more weight, so that not only the middle of its front stays.
    """
    gains = np.maximum(reference_point - values, 0.0)
    boxes = np.prod(gains, axis=1)
    order = np.argsort(structures, kind="stable")
    starts = np.flatnonzero(np.diff(structures[order], prepend=-1))
    largest = np.maximum.reduceat(boxes[order], starts)
    leading = np.argsort(-largest, kind="stable")[:most]
    sizes = np.diff(starts, append=len(order))
    found: list[Rows] = []
    for worth in (boxes, *(boxes[:, None] * gains**2).T):
        best = np.repeat(np.maximum.reduceat(worth[order], starts), sizes)
        places = np.flatnonzero(worth[order] == best)
        first = places[np.searchsorted(places, starts[leading])]
        found.append(order[first])
    return np.unique(np.concatenate(found))


def thinned(front: Array, reference_point: Array, capacity: int) -> Rows:
    """The rows, at most `capacity`, that keep most of the hypervolume of a front (N, M) within the reference box."""
    kept = np.arange(len(front))
    if len(kept) > capacity and front.shape[1] > MOST_EXACT:
        return _winners(front, reference_point, capacity)
    while len(kept) > capacity:
        # Contributions change as neighbours go, so not all of the surplus goes at once.
        contributions = moocore.hv_contributions(front[kept], ref=reference_point)
        surplus = len(kept) - capacity
        going = min(surplus, max(-(-surplus // 2), capacity // 8))
        kept = np.delete(kept, np.argsort(contributions, kind="stable")[:going])
    return kept


def _winners(front: Array, reference_point: Array, n: int) -> Rows:
    """The points that reach farthest from the reference point along one of `n` fixed directions.

    The mean of (farthest reach) ** M over all directions is proportional to the hypervolume (Deng & Zhang,
    IEEE Trans. Evol. Comput. 23(6), 2019), so a point that wins nowhere hardly contributes.
    """
    directions = np.abs(np.random.default_rng(0).standard_normal((n, front.shape[1])))
    gain = reference_point - front
    gain /= gain.max(axis=0)
    reach = np.full((n, len(front)), np.inf)
    for objective, direction in zip(gain.T, directions.T, strict=True):
        np.minimum(reach, objective / direction[:, None], out=reach)
    return np.unique(np.argmax(reach, axis=1))
