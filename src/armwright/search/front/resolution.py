"""Fewer designs of a front, without those that a user cannot tell apart from others."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.search.front.selection import Indices

DEFAULT_SHARE = 0.01  # of the distance from the reference point to the best value


def resolution_of(
    stated: Mapping[str, float], names: Sequence[str], values: Array, reference_point: Sequence[float]
) -> Array:
    """Return the (M,) resolution of each objective: the stated one, else 1 % of its range up to the reference point.

    values: (N, M) of a front within the reference point.
    """
    default = DEFAULT_SHARE * (np.asarray(reference_point) - values.min(axis=0))
    return np.array([stated.get(name, own) for name, own in zip(names, default.tolist(), strict=True)])


def distinct(values: Array, resolution: Array, rank: NDArray[np.int64]) -> Indices:
    """Return the sorted indices of points of a front (N, M), N >= 1, that differ in some objective by the resolution.

    A point is left out if a kept one differs by no more than the resolution (M,) in every objective, or if a kept one
    of lower rank (N,), such as the number of joints, is not worse by more than that in any. The points with the best
    value of each objective stay. Of the others, those of the lowest rank come first, and of these the ones with the
    smallest sum of objectives in units of the resolution.

    The kept points, moved by the resolution r towards the ideal point, dominate the whole front. The loss of
    hypervolume is therefore at most the sum of r_m / L_m times the product of all L_m, the distances from the best
    values to the reference point: with the default, M per cent of that box.
    """
    scaled = (values - values.min(axis=0)) / resolution
    total = scaled.sum(axis=1)
    kept = sorted({int(np.lexsort((total, column))[0]) for column in scaled.T})
    for index in np.lexsort((total, rank)):
        worse = scaled[kept] - scaled[index]
        is_similar = (rank[kept] < rank[index]) | np.all(worse >= -1.0, axis=1)
        if not np.any(is_similar & np.all(worse <= 1.0, axis=1)):
            kept.append(int(index))
    return np.sort(kept)
