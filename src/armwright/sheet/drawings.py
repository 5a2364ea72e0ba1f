"""The drawings of a data sheet, side view and top view. They are readable in grey."""

import math
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.pictures.style import FRONT, LINK, TARGET
from armwright.sheet.record import DataSheet

REACHED = "#EDEDED"
SHORT = 1e-6  # [m]; links without length are not drawn
MARGIN = 0.06  # around a view, as a share of its size
MOST_NUMBERS = 12  # of targets; more are not numbered
MM = 1e3


def draw_side(axes: Any, sheet: DataSheet) -> None:
    """Draw the arm from the side, with its joints at 0 or the nearest limit, and what it reaches."""
    drawing, outline = sheet.drawing, np.array(sheet.drawing.side.points)
    axes.fill(*(MM * outline.T), facecolor=REACHED, edgecolor=LINK, linewidth=0.8, zorder=1)
    x, _, z = drawing.base
    if drawing.column is not None:
        axes.plot([MM * x] * 2, [MM * (z - drawing.column), MM * z], color=LINK, linewidth=5.0, alpha=0.5, zorder=2)
    for number, start, end in drawing.links:
        if math.dist(start, end) >= SHORT:
            ends = MM * np.array([start, end])[:, [0, 2]]
            axes.plot(*ends.T, color=FRONT, linewidth=2.4 if number else 1.2, solid_capstyle="butt", zorder=3)
            axes.plot(*ends[0], marker="o", markersize=3.5, color=FRONT, markerfacecolor="white", zorder=4)
            name = f"link {number}" if number else "tool"
            axes.annotate(
                name, ends.mean(axis=0), (6, 0), textcoords="offset points", fontsize=7, va="center", zorder=5
            )
    axes.plot(MM * x, MM * z, marker="s", markersize=5, color=FRONT, zorder=4)
    _frame(axes, *_limits(outline, _ends(sheet)), "x [mm]", "z [mm]")
    top, bottom = MM * outline[:, 1].max(), MM * outline[:, 1].min()
    posture = "joints at 0; " if drawing.is_at_zero else "joints at 0 or the limit next to it\n"
    axes.set_title(f"Side view, {posture}tip from z = {bottom:.0f} to {top:.0f} mm")


def draw_top(axes: Any, sheet: DataSheet) -> None:
    """Draw the outline of the reach from above, with its radius and the targets."""
    drawing = sheet.drawing
    outline, base = np.array(drawing.top.points), np.array(drawing.base[:2])
    axes.fill(*(MM * outline.T), facecolor=REACHED, edgecolor=LINK, linewidth=0.8, zorder=1)
    targets = np.array([target[:2] for target in drawing.targets]).reshape(-1, 2)
    low, high = _limits(outline, targets)
    distance = np.linalg.norm(outline - base, axis=1)
    far = outline[int(distance.argmax())]
    axes.annotate(
        "", MM * far, MM * base, arrowprops={"arrowstyle": "-|>", "color": FRONT, "linewidth": 0.9, "shrinkA": 0}
    )
    numbers: dict[tuple[float, float], list[str]] = {}  # of targets above each other
    for number, (x, y) in enumerate(targets.round(3).tolist(), start=1):
        numbers.setdefault((x, y), []).append(str(number))
    for target, names in numbers.items():
        place = MM * np.array(target)
        axes.plot(*place, marker="*", markersize=8, color=TARGET, markeredgecolor=FRONT, zorder=3)
        if len(targets) <= MOST_NUMBERS:
            text = ", ".join(names)
            axes.annotate(text, place, (0, 5), textcoords="offset points", fontsize=7, ha="center", zorder=5)
    axes.plot(*(MM * base), marker="s", markersize=5, color=FRONT, zorder=4)
    _frame(axes, low, high, "x [mm]", "y [mm]")
    starred = "; stars: targets" if len(targets) else ""
    axes.set_title(f"Top view, tip within R = {MM * (sheet.facts['reach'].value or 0.0):.0f} mm{starred}")


def _ends(sheet: DataSheet) -> Array:
    """Return the (K, 2) points of the drawn arm in x and z [m]."""
    drawing = sheet.drawing
    x, _, z = drawing.base
    points = [(x, z - (drawing.column or 0.0))]
    points += [(point[0], point[2]) for _, start, end in drawing.links for point in (start, end)]
    return np.array(points)


def _limits(*points: Array) -> tuple[Array, Array]:
    """Return the corners (2,) of a view that shows all points (K, 2) [m], of a little more."""
    every = np.vstack([array for array in points if len(array)])
    low, high = every.min(axis=0), every.max(axis=0)
    room = MARGIN * max(float((high - low).max()), 1e-3)
    return low - room, high + room


def _frame(axes: Any, low: Array, high: Array, x: str, y: str) -> None:
    axes.set(xlabel=x, ylabel=y, xlim=MM * np.array([low[0], high[0]]), ylim=MM * np.array([low[1], high[1]]))
    axes.set_aspect("equal")
    axes.locator_params(nbins=5)
