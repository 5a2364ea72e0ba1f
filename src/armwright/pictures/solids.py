"""Obstacles, motor bodies and columns in figures: translucent faces, clipped to the drawing."""

from collections.abc import Iterable, Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from armwright.arrays import Array
from armwright.pictures.style import OBSTACLE
from armwright.tasks.obstacles import Ground, Obstacle, Solid

EDGE = 0.5  # [pt]
OPACITY = 0.18
AROUND, UPWARDS = 32, 12  # faces of round shapes


Extent = tuple[Array, float]  # centre (3,) and half the side of the cube that is drawn [m]


def extent_of(points: Sequence[Any], obstacles: Sequence[Obstacle] = ()) -> Extent:
    """Return the cube around points (3,) or (N, 3), with a floor that is close below them."""
    places = np.vstack(points)
    low, high = places.min(axis=0), places.max(axis=0)
    for obstacle in obstacles:
        if isinstance(obstacle, Ground) and low[2] - (high - low).max() / 4 < obstacle.z:
            low[2] = min(low[2], obstacle.z)
    return (low + high) / 2, float(max(0.1, 0.55 * (high - low).max()))


def draw_edges(axes: Any, low: Sequence[float] | Array, high: Sequence[float] | Array, style: Any) -> None:
    """Draw the edges of a box, which may be flat, a line or a point."""
    corners = np.unique(np.array(list(product(*zip(low, high, strict=True)))), axis=0)
    for one, other in combinations(corners, 2):
        if (one != other).sum() == 1:
            axes.plot(*np.array([one, other]).T, **style)


def draw_obstacles(axes: Any, obstacles: Sequence[Obstacle], extent: Extent) -> None:
    """Draw the parts of obstacles within a cube."""
    for obstacle in obstacles:
        draw_solid(axes, obstacle.solid, extent, OBSTACLE)


def draw_solid(axes: Any, solid: Solid, extent: Extent, colour: str) -> None:
    """Draw the part of a solid within a cube."""
    middle, half = extent
    faces = [(clipped(face, middle, half), line) for face, line in _faces(solid, middle, half)]
    shown = [(face, line) for face, line in faces if len(face) > 2]
    if shown:
        faces_, lines = zip(*shown, strict=True)
        # Matplotlib pads shorter faces with uninitialised memory, which may overflow when projected.
        most = max(map(len, faces_))
        corners = [np.vstack([face, np.repeat(face[-1:], most - len(face), axis=0)]) for face in faces_]
        drawn = Poly3DCollection(corners, facecolor=colour, edgecolor=colour, alpha=OPACITY, linewidth=lines)
        axes.add_collection3d(drawn, autolim=False)


def clipped(face: Array, middle: Array, half: float) -> Array:
    """Clip a flat convex face (n, 3) to a cube; returns (m, 3), m = 0 if it is outside (Sutherland & Hodgman)."""
    for axis in range(3):
        for sign in (-1.0, 1.0):
            room = half - sign * (face[:, axis] - middle[axis])  # (n,) >= 0 inside
            corners: list[Array] = []
            for k in range(len(face)):
                after = (k + 1) % len(face)
                if room[k] >= 0.0:
                    corners.append(face[k])
                if (room[k] >= 0.0) != (room[after] >= 0.0):
                    share = room[k] / (room[k] - room[after])
                    corners.append(face[k] + share * (face[after] - face[k]))
            face = np.array(corners).reshape(-1, 3)
    return face


def _faces(solid: Solid, middle: Array, half: float) -> Iterable[tuple[Array, float]]:
    """Yield each visible face as its (n, 3) corners in the world [m] and the width of its outline [pt]."""
    if solid.shape == "ground":
        x, y = middle[:2]
        corners = [(x + s * half, y + t * half, solid.centre[2]) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return [(np.array(corners), EDGE)]
    flat, round_ = {"box": (_box(), []), "cylinder": _cylinder(), "sphere": ([], _sphere())}[solid.shape]
    return [
        (np.array(solid.centre) + face * np.array(solid.half) @ solid.rotation.T, line)
        for faces, line in ((flat, EDGE), (round_, 0.0))
        for face in faces
    ]


def _box() -> list[Array]:
    """Return the faces of a box from -1 to 1."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return [np.insert(square, axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]


def _cylinder() -> tuple[list[Array], list[Array]]:
    """Return the faces of a cylinder of radius 1 from z = -1 to 1."""
    angles = np.linspace(0.0, 2 * np.pi, AROUND, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.ones(AROUND)])
    low = ring * [1.0, 1.0, -1.0]
    sides = [np.array([low[k - 1], low[k], ring[k], ring[k - 1]]) for k in range(AROUND)]
    return [low, ring], sides


def _sphere() -> list[Array]:
    """Return the faces of a sphere of radius 1."""
    around, up = np.linspace(0.0, 2 * np.pi, AROUND + 1), np.linspace(-np.pi / 2, np.pi / 2, UPWARDS + 1)
    x, y = np.outer(np.cos(around), np.cos(up)), np.outer(np.sin(around), np.cos(up))
    grid = np.stack([x, y, np.broadcast_to(np.sin(up), x.shape)], axis=-1)
    return [
        np.array([grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]])
        for i in range(AROUND)
        for j in range(UPWARDS)
    ]
