"""Boxed labels of points in a panel, placed clear of points, legend and each other."""

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
CORNERS = ("upper right", "lower left", "upper left", "lower right")
BESIDE = 30.0  # from a legend: a point nearer than this has no room for its label [px]
POINT = 5.0  # half the size of a point [px]


@dataclass(frozen=True)
class PointLabel:
    """A text beside a point, in the coordinates of the data."""

    text: str
    at: tuple[float, float]
    colour: str


def place_legend(axes: Any, handles: Sequence[Any], points: Sequence[tuple[float, float]]) -> None:
    """Put a legend into the corner where it hides the fewest points; of equal ones, the upper right one first."""

    def hidden(corner: str) -> int:
        legend = axes.legend(handles=handles, loc=corner)
        axes.figure.draw_without_rendering()
        box = legend.get_window_extent().padded(BESIDE)
        return sum(box.contains(*axes.transData.transform(point)) for point in points)

    counts: dict[str, int] = {}
    for corner in CORNERS:
        counts[corner] = hidden(corner)
        if not counts[corner]:
            return
    axes.legend(handles=handles, loc=min(CORNERS, key=counts.__getitem__))


def place_labels(axes: Any, labels: Sequence[PointLabel], points: Sequence[tuple[float, float]]) -> None:
    """Label points of a finished panel.

    Args:
        axes: the panel, with its legend.
        labels: in the order in which they choose their place.
        points: that labels should not hide.
    """
    axes.figure.draw_without_rendering()  # places the panel
    centers = axes.transData.transform([*points, *(label.at for label in labels)])
    taken = [Bbox.from_extents(x - POINT, y - POINT, x + POINT, y + POINT) for x, y in centers]
    legend = axes.get_legend()
    taken += [legend.get_window_extent()] if legend else []
    taken += [text.get_window_extent() for text in axes.texts]
    for label in labels:
        box = _place(axes, label, taken)
        taken += [box, *_along_leader(axes, label, box)]


def _place(axes: Any, label: PointLabel, taken: Sequence[Bbox]) -> Bbox:
    """Draw a label at its first place that is free, or the one that hides least, and return its box."""
    best: tuple[float, Any, Bbox] | None = None
    others = [box for box in taken if not box.contains(*axes.transData.transform(label.at))]
    for drawn in _candidates(axes, label):
        drawn.set_in_layout(False)
        drawn.get_window_extent()  # moves the text to its place
        box = Text.get_window_extent(drawn).padded(4.0)  # without the line to its point
        hidden = sum(_area(Bbox.intersection(box, other)) for other in taken)
        crossed = _along_leader(axes, label, box)
        hidden += sum(_area(Bbox.intersection(part, other)) for part in crossed for other in others)
        outside = _area(box) - _area(Bbox.intersection(box, axes.bbox))
        if best is None or hidden + outside < best[0]:
            if best is not None:
                best[1].remove()
            best = hidden + outside, drawn, box
        else:
            drawn.remove()
        if best[0] <= 0.0:
            break
    assert best is not None
    return best[2]


def _candidates(axes: Any, label: PointLabel) -> Iterator[Any]:
    for distance in DISTANCES:
        for x, y in DIRECTIONS:
            yield axes.annotate(
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


def _along_leader(axes: Any, label: PointLabel, box: Bbox) -> list[Bbox]:
    """Return small boxes along the line from a point to the middle of its label, as far as it is drawn."""
    start: Array = axes.transData.transform(label.at)
    if not axes.figure.bbox.contains(*start):
        return []
    along = np.asarray(box.corners(), dtype=np.float64).mean(axis=0) - start
    steps = np.linspace(0.0, 1.0, 2 + int(np.hypot(along[0], along[1]) / POINT))[1:-1]
    places = [(start + step * along).tolist() for step in steps]
    half = POINT / 2
    return [Bbox.from_extents(x - half, y - half, x + half, y + half) for x, y in places if not box.contains(x, y)]


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else float(box.width * box.height)
