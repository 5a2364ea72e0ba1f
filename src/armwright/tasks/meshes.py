"""Meshes of obstacles as convex hulls: STL and OBJ files, read safely."""

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from armwright.arrays import Array
from armwright.files import read_bytes
from armwright.rotations import cone_directions

MAX_MESH = 64 * 1024 * 1024  # [bytes]
MAX_CORNERS = 200  # of a hull; each counts in every search for a nearest point

Unit = Annotated[float, Field(ge=-1e6, le=1e6)]  # of a file
Corners = tuple[tuple[Unit, Unit, Unit], ...]


@dataclass(frozen=True)
class Hull:
    """The surface of a convex hull."""

    corners: Array  # (P, 3)
    planes: Array  # (F, 4) unit normals that point outwards, and how far the hull reaches along them
    triangles: Array  # (T, 3, 3), their corners in any order


NO_HULL = Hull(np.empty((0, 3)), np.empty((0, 4)), np.empty((0, 3, 3)))


@lru_cache(maxsize=200)
def scaled_hull(points: Corners, scale: float) -> tuple[Array, Hull]:
    """Return the middle (3,) of the box around points that are scaled, and their hull about it."""
    corners = scale * np.array(points)
    middle = (corners.max(axis=0) + corners.min(axis=0)) / 2
    return middle, _convex_hull(corners - middle)


def read_hull(path: Path) -> tuple[Array, str]:
    """Return the corners of a convex hull that contains a mesh, in the unit of its file, and what it is of.

    A hull with many corners becomes that of its outermost points along MAX_CORNERS directions, scaled about their mean
    until it contains the others.
    """
    points = _read_points(path)
    corners, source = _convex_hull(points).corners, f"{path.name}: convex hull of {len(points):,} points"
    if len(corners) > MAX_CORNERS:
        directions = cone_directions((0.0, 0.0, 1.0), np.pi, MAX_CORNERS) / np.ptp(corners, axis=0)
        outer = corners[np.unique((corners @ directions.T).argmax(axis=0))]
        middle = outer.mean(axis=0)
        planes = _convex_hull(outer - middle).planes
        scale = (((corners - middle) @ planes[:, :3].T).max(axis=0) / planes[:, 3]).max()
        corners = middle + scale * (outer - middle)
        source += f", at most {scale - 1.0:.1%} larger"
    return corners, source


def _convex_hull(corners: Array) -> Hull:
    from scipy.spatial import ConvexHull, QhullError  # takes a quarter of a second to import

    try:
        found = ConvexHull(corners)
    except (QhullError, ValueError) as fault:
        raise ValueError(f"expected points around a volume, got {len(corners)} that are flat") from fault
    planes = np.unique((found.equations * [1.0, 1.0, 1.0, -1.0]).round(9), axis=0)
    return Hull(corners[found.vertices], planes, corners[found.simplices])


def _read_points(path: Path) -> Array:
    """Return the points (N, 3) of a mesh, each once; ValueError with one line if it cannot be read."""
    data = read_bytes(path, MAX_MESH, ValueError)
    if len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):  # a binary STL
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
        points = np.frombuffer(data, record, offset=84)["corners"].reshape(-1, 3).astype(np.float64)
    else:
        lines = re.findall(r"^[ \t]*(?:vertex|v)[ \t]([^\r\n]{1,200})", data.decode("latin-1"), re.MULTILINE)
        try:
            points = np.array([[float(x), float(y), float(z)] for x, y, z, *_ in map(str.split, lines)])
        except ValueError as fault:
            raise ValueError(f"{path}: expected three numbers for each vertex of a mesh") from fault
    if len(points) == 0 or not np.isfinite(points).all():
        raise ValueError(f"{path}: expected an STL or OBJ file with finite vertices")
    return np.unique(points, axis=0)
