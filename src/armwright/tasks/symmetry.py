"""Symmetry planes of a set of points, which mirror the set onto itself."""

from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from armwright.arrays import Array

TOLERANCE = 1e-6  # [m]
ROUGH = 1e-5  # [m]; a candidate plane within it is refined on all the pairs that it mirrors
MAX_CANDIDATES = 2000  # otherwise thousands of points on a circle take minutes


def symmetry_planes(points: Array) -> Array:
    """Return the unit normals (P, 3) of all planes that mirror points (T, 3) [m] onto themselves within 1e-6 m.

    All planes pass through `centre(points)`. If the points lie in one plane, it is included. For points on one line
    only the plane that bisects it is returned, and for a single point none, since infinitely many others exist.
    Duplicate points count once. At most 2,000 candidates are tried.
    """
    offsets = np.unique(points, axis=0) - centre(points)  # (T, 3)
    normals = np.empty((0, 3))
    for candidate in _candidates(offsets):
        normal = None if _is_among(candidate, normals) else _refined(offsets, candidate)
        if normal is not None and not _is_among(normal, normals):
            tidy = np.where(np.abs(normal) < 1e-12, 0.0, normal)  # its first component other than 0 becomes positive
            normals = np.vstack([normals, tidy * np.sign(tidy[np.flatnonzero(tidy)[0]]) + 0.0])  # no -0.0
    return normals


def centre(points: Array) -> Array:
    """Return the mean (3,) of the different points among `points` (T, 3) [m]."""
    return np.unique(points, axis=0).mean(axis=0)


def distance_to_planes(position: Array, points: Array, normals: Array) -> float:
    """Return the distance [m] of a position (3,) to the nearest plane through the centre of `points` (T, 3)."""
    return float(np.abs(normals @ (position - centre(points))).min(initial=np.inf))


def _candidates(offsets: Array) -> Array:
    """Return (C, 3) unit normals that include those of all symmetry planes.

    Mirroring moves at least one of any three offsets that span the space, along the normal of the plane, to another
    offset at the same distance from the centre. Offsets that span a plane need two, and that plane itself.
    """
    distance = np.linalg.norm(offsets, axis=1)
    basis = _basis(offsets)
    normals = [np.empty((0, 3))]
    if len(basis) == 2:
        normals.append(np.linalg.svd(offsets, full_matrices=False)[2][2:])  # the plane of all points
    for row in basis:
        moves = offsets[np.abs(distance - distance[row]) <= ROUGH] - offsets[row]
        length = np.linalg.norm(moves, axis=1)
        normals.append(moves[length > ROUGH] / length[length > ROUGH, None])
    return np.vstack(normals)[:MAX_CANDIDATES]


def _basis(offsets: Array) -> list[int]:
    """Return indices of offsets that span all: the farthest, then the farthest from its line, from their plane."""
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


def _refined(offsets: Array, normal: Array) -> Array | None:
    """Return the normal fitted to all pairs that it mirrors; None if it does not mirror the set onto itself.

    The direction of a single pair is only as accurate as its digits, and less if its points are close.
    """
    partners = _partners(offsets, normal, ROUGH)
    if partners is None:
        return None
    pairs = offsets - offsets[partners]
    if np.linalg.norm(pairs, axis=1).max() > ROUGH:
        normal = np.linalg.svd(pairs, full_matrices=False)[2][0]
    return normal if _partners(offsets, normal, TOLERANCE) is not None else None


def _is_among(normal: Array, normals: Array) -> bool:
    across = normals - np.outer(normals @ normal, normal)
    return bool(np.any(np.linalg.norm(across, axis=1) <= ROUGH))


def _partners(offsets: Array, normal: Array, tolerance: float) -> NDArray[np.intp] | None:
    """Return (T,) the index of the offset at each mirrored one; None if one has none within `tolerance` [m]."""
    mirrored = offsets - 2.0 * np.outer(offsets @ normal, normal)
    distances, partners = cast("tuple[Array, NDArray[np.intp]]", KDTree(offsets).query(mirrored))
    return partners if distances.max() <= tolerance else None
