"""Boxed labels of points in a panel, placed clear of points and each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from armwright.arrays import Array

DISTANCES = (14.0, 36.0, 60.0, 90.0, 120.0)  # of a label from its point [pt]
STEEP = 0.3  # of the horizontal part of a nearly vertical direction
DIRECTIONS = (
    *((1, 1), (-1, 1), (1, 0), (-1, 0), (1, -1), (-1, -1), (0, 1), (0, -1)),
    *((STEEP, 1), (-STEEP, 1), (STEEP, -1), (-STEEP, -1)),
)
ALIGNMENTS = {-1: ("right", "top"), 0: ("center", "center"), 1: ("left", "bottom")}
POINT = 5.0  # half the size of a point [px]


@dataclass(frozen=True)
class PointLabel:
    """A text beside a point, in the coordinates of the data."""

    text: str
    at: tuple[float, float]
    colour: str


def place_labels(axes: Any, labels: Sequence[PointLabel], points: Sequence[tuple[float, float]]) -> None:
    """Label points of a finished panel, each at its first place that is free, or that hides least.

    Args:
        axes: The panel.
        labels: In the order in which they choose their place.
        points: Points that labels should not hide.
    """
    axes.figure.draw_without_rendering()  # places the panel
    centers = axes.transData.transform([*points, *(label.at for label in labels)])
    taken = [_around(center, POINT) for center in centers]
    taken += [text.get_window_extent() for text in axes.texts]
    for label in labels:
        start = axes.transData.transform(label.at)
        others = [box for box in taken if not box.contains(*start)]
        tried: list[tuple[float, Any, list[Bbox]]] = []
        for drawn in _candidates(axes, label):
            drawn.get_window_extent()  # moves the text to its place
            box = Text.get_window_extent(drawn).padded(4.0)  # without the line to its point
            leader = _along_leader(axes, start, box)
            hidden = _common([box], taken) + _common(leader, others) + _area(box) - _common([box], [axes.bbox])
            tried.append((hidden, drawn, [box, *leader]))
            if hidden <= 0.0:
                break
        _, kept, boxes = min(tried, key=lambda candidate: candidate[0])
        for _, drawn, _ in tried:
            if drawn is not kept:
                drawn.remove()
        taken += boxes


def _candidates(axes: Any, label: PointLabel) -> Iterator[Any]:
    for distance in DISTANCES:
        for x, y in DIRECTIONS:
            drawn = axes.annotate(
                label.text,
                label.at,
                xytext=(distance * x, distance * y),
                textcoords="offset points",
                ha=ALIGNMENTS[int(np.sign(x))][0],
                va=ALIGNMENTS[y][1],
                fontsize=8,
                zorder=5,
                bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": label.colour, "alpha": 0.9},
                arrowprops={"arrowstyle": "-", "color": label.colour, "linewidth": 0.8},
            )
            drawn.set_in_layout(False)
            yield drawn


def _along_leader(axes: Any, start: Array, box: Bbox) -> list[Bbox]:
    """Return small boxes along the line from a point to the middle of its label, as far as it is drawn."""
    if not axes.figure.bbox.contains(*start):
        return []
    along = np.asarray(box.corners(), dtype=np.float64).mean(axis=0) - start
    steps = np.linspace(0.0, 1.0, 2 + int(np.hypot(along[0], along[1]) / POINT))[1:-1]
    places = (start + step * along for step in steps)
    return [_around(place, POINT / 2) for place in places if not box.contains(float(place[0]), float(place[1]))]


def _around(center: Array, half: float) -> Bbox:
    x, y = center.tolist()
    return Bbox.from_extents(x - half, y - half, x + half, y + half)


def _common(boxes: Sequence[Bbox], others: Sequence[Bbox]) -> float:
    """Return the area that boxes have in common with others, counted by pairs."""
    pairs = (Bbox.intersection(box, other) for box in boxes for other in others)
    return sum(_area(pair) for pair in pairs if pair is not None)


def _area(box: Bbox) -> float:
    return float(box.width * box.height)
