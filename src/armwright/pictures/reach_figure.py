"""Slices of a reach map through the base and at one height, with what is around the arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from armwright.kinematics.reach.reach_map import PoseCoverage, ReachMap
from armwright.pictures.drawing import legend_below, legend_mark, save_figure
from armwright.pictures.mapped_arm import MappedArm
from armwright.pictures.style import FRONT, OBSTACLE, TARGET
from armwright.robot.arm import Arm
from armwright.tasks.obstacles import Obstacle

COLOURS = "viridis"
POSITION_ONLY = "#E3E3E8"  # points reached in none of the directions
FINE = 300  # cells along the longer side, for obstacles
PANEL = 4.2  # [inch]


@dataclass(frozen=True)
class _Slice:
    """A plane of the grid: the axes to the right and upwards, the axis across, and the index along it."""

    right: int
    up: int
    across: int
    index: int

    def of(self, found: ReachMap, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values (U, R) of the points in the plane, rows upwards."""
        plane = np.moveaxis(values.reshape(found.shape), self.across, 0)[self.index]
        return plane.T  # the axis to the right comes first in both planes

    def place(self, found: ReachMap) -> float:
        """Return the coordinate across [m]."""
        return float(found.coordinates(self.across)[self.index])


def write_reach_figure(found: ReachMap, around: MappedArm, file: Path) -> None:
    """Write the slices of a reach map with the arm and its surroundings, in the format of the file's ending."""
    save_figure(partial(_draw, found, around), file)


def _draw(found: ReachMap, around: MappedArm) -> Figure:
    """Draw two slices, twice if there are conditions."""
    rows = [("within joint limits", found.bare)]
    if found.usable is not found.bare:
        rows.append((around.conditions, found.usable))
    figure = Figure(figsize=(2 * PANEL + 0.8, PANEL * len(rows) + 0.9), layout="constrained")
    axes: Any = figure.subplots(len(rows), 2, squeeze=False)
    slices = (_vertical(found, around.arm), _horizontal(found, around))
    image: Any = None
    for row, (name, coverage) in enumerate(rows):
        for column, plane in enumerate(slices):
            image = _draw_slice(axes[row, column], found, coverage, plane, around)
            across = "xyz"[plane.across]
            axes[row, column].set_title(f"{across} = {plane.place(found):.3f} m, {name}")
    bar = figure.colorbar(image, ax=axes, shrink=0.8)
    bar.set_label(f"share of {len(found.directions)} directions reached [%]")
    volumes = (
        f"{name}: {coverage.volume:.3g} m³ reached, {coverage.dexterous_volume():.3g} m³ in all directions"
        for name, coverage in rows
    )
    figure.suptitle("\n".join([around.title, *volumes]), fontsize=10)
    handles: list[Any] = [Patch(facecolor=POSITION_ONLY, label="reached, in none of the directions")]
    handles.append(legend_mark("base", "s", FRONT))
    if around.targets is not None:
        handles.append(legend_mark("target near the plane", "*", TARGET, markersize=9, markeredgecolor=FRONT))
    if around.obstacles:
        handles.append(Patch(facecolor="none", edgecolor=OBSTACLE, hatch="////", label="obstacle"))
    legend_below(figure, handles)
    return figure


def _vertical(found: ReachMap, arm: Arm) -> _Slice:
    """Return the vertical plane next to the base in which more is reached: x-z or y-z."""
    planes = [_Slice(0, 2, 1, _nearest(found, 1, arm.base[1])), _Slice(1, 2, 0, _nearest(found, 0, arm.base[0]))]
    return max(planes, key=lambda plane: float(plane.of(found, found.usable.covered.astype(float)).sum()))


def _horizontal(found: ReachMap, around: MappedArm) -> _Slice:
    """Return the horizontal plane at the mean height of the targets, else where the most directions are reached."""
    if around.targets is not None:
        return _Slice(0, 1, 2, _nearest(found, 2, float(around.targets[:, 2].mean())))
    return _Slice(0, 1, 2, int(found.usable.share.reshape(found.shape).sum(axis=(0, 1)).argmax()))


def _nearest(found: ReachMap, axis: int, value: float) -> int:
    """Return the index of the plane nearest to a coordinate [m]."""
    return int(np.abs(found.coordinates(axis) - value).argmin())


def _draw_slice(axes: Any, found: ReachMap, coverage: PoseCoverage, plane: _Slice, around: MappedArm) -> Any:
    """Draw one plane of the map and return its image."""
    shares, covered = plane.of(found, coverage.share), plane.of(found, coverage.covered)
    half = found.spacing / 2
    low, high = found.points.min(axis=0) - half, found.points.max(axis=0) + half
    extent = (low[plane.right], high[plane.right], low[plane.up], high[plane.up])
    options: Any = {"origin": "lower", "extent": extent, "interpolation": "nearest"}
    axes.imshow(np.where(covered, 1.0, np.nan), cmap=ListedColormap([POSITION_ONLY]), **options)
    image = axes.imshow(np.where(shares > 0.0, 100.0 * shares, np.nan), cmap=COLOURS, vmin=0.0, vmax=100.0, **options)
    _draw_obstacles(axes, found, plane, around.obstacles, extent)
    base = around.arm.base
    axes.plot(base[plane.right], base[plane.up], marker="s", markersize=6, color=FRONT)
    if around.targets is not None:
        beside = np.abs(around.targets[:, plane.across] - plane.place(found)) <= found.spacing
        axes.plot(
            *around.targets[beside][:, [plane.right, plane.up]].T,
            linestyle="", marker="*", markersize=9, color=TARGET, markeredgecolor=FRONT, markeredgewidth=0.5,
        )  # fmt: skip
    axes.set(xlabel=f"{'xyz'[plane.right]} [m]", ylabel=f"{'xyz'[plane.up]} [m]", aspect="equal")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.grid(visible=False)
    return image


def _draw_obstacles(
    axes: Any, found: ReachMap, plane: _Slice, obstacles: Sequence[Obstacle], extent: tuple[float, float, float, float]
) -> None:
    """Hatch where the plane cuts the obstacles."""
    right, up = np.meshgrid(np.linspace(extent[0], extent[1], FINE), np.linspace(extent[2], extent[3], FINE))
    points = np.empty((FINE * FINE, 3))
    points[:, plane.right], points[:, plane.up] = right.ravel(), up.ravel()
    points[:, plane.across] = plane.place(found)
    for obstacle in obstacles:
        inside = obstacle.solid.signed_distance(points).reshape(FINE, FINE)
        if inside.min() < 0.0 < inside.max():
            drawn = axes.contourf(right, up, inside, levels=[-np.inf, 0.0], colors="none", hatches=["////"])
            drawn.set_edgecolor(OBSTACLE)
            axes.contour(right, up, inside, levels=[0.0], colors=OBSTACLE, linewidths=0.8)
