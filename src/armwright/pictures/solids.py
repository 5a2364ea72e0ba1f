"""Obstacles, motor bodies and columns in figures: translucent faces within the drawing."""

from collections.abc import Sequence
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
    """Draw obstacles within a cube."""
    for obstacle in obstacles:
        draw_solid(axes, obstacle.solid, extent, OBSTACLE)


def draw_solid(axes: Any, solid: Solid, extent: Extent, colour: str) -> None:
    """Draw a solid; what is outside a cube is flattened onto its sides."""
    middle, half = extent
    low, high = middle - half, middle + half
    for faces, line in _faces(solid):
        if solid.shape == "ground":
            corners = middle + half * faces
            corners[..., 2] = solid.centre[2]
        else:
            corners = np.array(solid.centre) + faces * np.array(solid.half) @ solid.rotation.T
        if np.all(corners.min(axis=(0, 1)) < high) and np.all(corners.max(axis=(0, 1)) > low):
            drawn = Poly3DCollection(
                np.clip(corners, low, high), facecolor=colour, edgecolor=colour, alpha=OPACITY, linewidth=line
            )
            axes.add_collection3d(drawn, autolim=False)


def _faces(solid: Solid) -> list[tuple[Array, float]]:
    """Return the faces (F, n, 3) of a solid in its own frame, in half sides, and the widths of their outlines [pt]."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    match solid.shape:
        case "mesh":
            return [(solid.hull.triangles / solid.half, 0.0)]
        case "ground":
            return [(np.insert(square, 2, 0.0, axis=1)[None], EDGE)]
        case "box":
            return [(np.array([np.insert(square, k, side, axis=1) for k in range(3) for side in (-1.0, 1.0)]), EDGE)]
        case "cylinder":
            angles = np.linspace(0.0, 2 * np.pi, AROUND, endpoint=False)
            ring = np.column_stack([np.cos(angles), np.sin(angles), np.ones(AROUND)])
            low = ring * [1.0, 1.0, -1.0]
            sides = np.stack([np.roll(low, 1, axis=0), low, ring, np.roll(ring, 1, axis=0)], axis=1)
            return [(np.stack([low, ring]), EDGE), (sides, 0.0)]
        case _:  # a sphere
            around, up = np.linspace(0.0, 2 * np.pi, AROUND + 1), np.linspace(-np.pi / 2, np.pi / 2, UPWARDS + 1)
            x, y = np.outer(np.cos(around), np.cos(up)), np.outer(np.sin(around), np.cos(up))
            grid = np.stack([x, y, np.broadcast_to(np.sin(up), x.shape)], axis=-1)
            quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
            return [(quads.reshape(-1, 4, 3), 0.0)]
