"""The symmetry planes of a set of points: where mirroring maps the set onto itself."""

import numpy as np

from armwright.arrays import Array

TOLERANCE = 1e-6  # [m]
ROUGH = 1e-5  # [m]; within which a plane is taken up, to be laid anew through all the pairs that it mirrors
MOST_CANDIDATES = 2000  # so that thousands of points on a circle do not take minutes


def symmetry_planes(points: Array) -> Array:
    """(P, 3) the unit normals of all planes that mirror `points` (T, 3) [m] onto themselves, within 1e-6 m.

    All of them lie through `centre(points)`. Points of one plane have that plane, too. Of points on one line only the
    plane that halves it is given, and of a single point none: every place lies on one of the others.
    Points are a set: one that is given twice counts once. Where there are more than 2,000 candidates (a thousand
    points at one distance from the centre), only that many are looked at.
    """
    offsets = _offsets(points)  # (T, 3)
    found = np.empty((0, 3))
    for candidate in _candidates(offsets):
        normal = None if _is_among(candidate, found) else _settled(offsets, candidate)
        if normal is not None and not _is_among(normal, found):
            found = np.vstack([found, _upward(normal)])
    return found


def is_mirrored(points: Array, normal: Array) -> bool:
    """Whether the plane with this unit normal (3,) through the centre mirrors `points` (T, 3) [m] onto themselves."""
    offsets = _offsets(points)
    return _partners(offsets, _mirrored(offsets, normal), TOLERANCE) is not None


def centre(points: Array) -> Array:
    """(3,) the mean of the different points of `points` (T, 3) [m]."""
    return np.unique(points, axis=0).mean(axis=0)


def distance_to_planes(place: Array, points: Array, normals: Array) -> float:
    """From `place` (3,) to the nearest of the planes with `normals` (P, 3) through the centre of `points` [m]."""
    return float(np.abs(normals @ (place - centre(points))).min(initial=np.inf))


def _offsets(points: Array) -> Array:
    return np.unique(points, axis=0) - centre(points)


def _candidates(offsets: Array) -> Array:
    """(C, 3) normals among which every symmetry plane's is.

    A plane moves one of any three offsets that span the space (two, where all lie in a plane, but for that plane
    itself), and what it moves, it moves along its normal to another offset at the same distance from the centre.
    """
    distance = np.linalg.norm(offsets, axis=1)
    basis = _basis(offsets)
    normals = [np.empty((0, 3))]
    if len(basis) == 2:
        normals.append(_least(offsets))  # the plane of all points
    for row in basis:
        moves = offsets[np.abs(distance - distance[row]) <= ROUGH] - offsets[row]
        length = np.linalg.norm(moves, axis=1)
        normals.append(moves[length > ROUGH] / length[length > ROUGH, None])
    return np.vstack(normals)[:MOST_CANDIDATES]


def _basis(offsets: Array) -> list[int]:
    """Rows that span what all rows span: the farthest, the farthest from its line, the farthest from their plane."""
    basis: list[int] = []
    left = offsets
    for _ in range(3):
        row = int(np.argmax(np.linalg.norm(left, axis=1)))
        length = np.linalg.norm(left[row])
        if length <= TOLERANCE:
            break
        basis.append(row)
        left = left - np.outer(left @ left[row], left[row]) / length**2
    return basis


def _least(offsets: Array) -> Array:
    """(1, 3) the direction in which the rows differ least."""
    return np.linalg.svd(offsets, full_matrices=False)[2][2:]


def _settled(offsets: Array, normal: Array) -> Array | None:
    """The normal laid through all the pairs that it mirrors, or None where the set is not mirrored onto itself.

    A single pair's direction is as rough as its digits and as its points are near.
    """
    partners = _partners(offsets, _mirrored(offsets, normal), ROUGH)
    if partners is None:
        return None
    pairs = offsets - offsets[partners]
    if np.linalg.norm(pairs, axis=1).max() > ROUGH:
        normal = np.linalg.svd(pairs, full_matrices=False)[2][0]
    return normal if _partners(offsets, _mirrored(offsets, normal), TOLERANCE) is not None else None


def _is_among(normal: Array, normals: Array) -> bool:
    across = normals - np.outer(normals @ normal, normal)
    return bool(np.any(np.linalg.norm(across, axis=1) <= ROUGH))


def _mirrored(offsets: Array, normal: Array) -> Array:
    return offsets - 2.0 * np.outer(offsets @ normal, normal)


def _partners(offsets: Array, mirrored: Array, tolerance: float) -> np.ndarray | None:
    """(T,) the row of `offsets` at each of the `mirrored` ones; None where one has none within `tolerance` [m]."""
    # Sorted along a direction that no grid has, a point's partner is one of the few at its own height.
    along = np.array([0.5377, 0.6613, 0.5227])
    order = np.argsort(offsets @ along)
    heights, sought = (offsets @ along)[order], mirrored @ along
    first, last = (np.searchsorted(heights, sought + sign * tolerance) for sign in (-1.0, 1.0))
    partners = np.full(len(offsets), -1)
    for step in range(int((last - first).max(initial=0))):
        row = order[np.minimum(first + step, len(order) - 1)]
        here = (np.linalg.norm(offsets[row] - mirrored, axis=1) <= tolerance) & (first + step < last)
        partners[here] = row[here]
    return partners if np.all(partners >= 0) else None


def _upward(normal: Array) -> Array:
    """The normal with its first component that is not 0 above 0."""
    tidy = np.where(np.abs(normal) < 1e-12, 0.0, normal)
    return tidy * np.sign(tidy[np.flatnonzero(tidy)[0]]) + 0.0  # no -0.0
