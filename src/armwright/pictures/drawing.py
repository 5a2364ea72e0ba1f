"""Figures without a display, written as PNG and PDF; a folder of figures is replaced in one step."""

from collections.abc import Callable, Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from armwright.arrays import Array
from armwright.files import naming_write_errors, new_part, replace_file, replace_folder
from armwright.pareto import front_mask
from armwright.pictures.style import FRONT, RC
from armwright.problem.arm_quantities import torque
from armwright.problem.problem import Problem

FAR_REFERENCE = 2.0  # times the largest value; a reference point beyond is not drawn
FITTED = 1.1  # upper limit of such an axis, as a multiple of the largest value
SMALLEST = 1e-250  # value that counts as above 0; matplotlib has no axes that end at smaller ones
SIMILAR = 0.5  # share of the upper limit; if all values are above, the axis begins near them
LEGEND_MARK, LEGEND_LETTER = 0.5, 0.06  # widths [inch]


def one_panel(width: float, height: float, pad: float | None = None) -> tuple[Figure, Any]:
    """Return a figure of this size and its only axes; pad: room around them, matplotlib's by default [inch]."""
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(h_pad=pad, w_pad=pad))
    return figure, figure.subplots()


def plane_limits(values: Array, reference: Sequence[float], shown: float) -> Array:
    """Return the limits (2, 2) of a plane of two objectives: low and high of each.

    It shows those of `values` (N, 2) that are nearer than `shown`, a multiple of the reference point, else their front.
    It reaches beyond the reference point, but only beyond the largest values if the reference point is more than twice
    as far in either. It begins at 0, or near the smallest value if that is negative or all values within the reference
    point are similar.
    """
    point = np.asarray(reference[:2])
    within = values[np.all(values <= shown * point, axis=1)]
    values = within if len(within) else values[front_mask(values)]
    if not len(values):
        return np.column_stack([np.zeros(2), shown * point])
    best, worst = values.min(axis=0), values.max(axis=0)
    is_far = np.any((worst > SMALLEST) & (point > FAR_REFERENCE * worst))
    beyond = shown * (point if len(within) else np.maximum(point, worst))
    high = np.where(is_far & (worst > SMALLEST), FITTED * worst, beyond)
    low = np.where(
        (best < 0.0) | ((best > SIMILAR * high) & (best < point)), best - (FITTED - 1.0) * (high - best), 0.0
    )
    return np.column_stack([low, high])


def frame_plane(axes: Any, problem: Problem, reference: Sequence[float], limits: Array) -> None:
    """Label a plane of the first two objectives, set its limits (2, 2), and mark the reference point if it is in them.

    Torques of toy masses are marked as such.
    """
    for i, axis in enumerate("xy"):
        objective = problem.objectives[i]
        unit = objective.unit_in_brackets.replace(" x ", " × ")
        if objective.name == torque.name and problem.space.is_toy:
            unit = unit.replace("]", "; toy masses]")
        label = f"{objective.label}{unit}"
        axes.set(**{f"{axis}label": label, f"{axis}lim": tuple(limits[i])})
    if np.all(np.asarray(reference[:2]) <= limits[:, 1]):
        axes.plot(*reference[:2], marker="+", color=FRONT, markersize=9, clip_on=False)


def draw_dominated(axes: Any, front: Array, reference: Sequence[float], **fill: Any) -> None:
    """Draw a front as a step line from the top to the right side of the reference box, and fill what it dominates.

    The front (K, 2) holds points within the box, at least one, sorted by the first objective. Of the reference point,
    only the first two objectives are used.
    """
    x = np.concatenate([front[:1, 0], front[:, 0], [reference[0]]])
    y = np.concatenate([[reference[1]], front[:, 1], front[-1:, 1]])
    axes.step(x, y, where="post", color=FRONT, linewidth=1.2, zorder=2)
    axes.fill_between(x, y, reference[1], step="post", linewidth=0, **fill)


def legend_mark(label: str, marker: str, colour: str, **style: Any) -> Line2D:
    """Return the legend entry of a marker."""
    return Line2D([], [], linestyle="", marker=marker, color=colour, label=label, **style)


def legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """Add a legend below the panels, with as many columns as fit."""
    widest = LEGEND_MARK + LEGEND_LETTER * max(len(str(handle.get_label())) for handle in handles)
    columns = max(1, min(len(handles), int(figure.get_figwidth() / widest)))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def write_drawn(place: Path, drawn: Iterable[tuple[str, Figure]]) -> list[Path]:
    """Replace the folder `place` by these figures, as PNG and PDF, and return the PNG files."""
    part = new_part(place)
    with matplotlib.rc_context(RC), naming_write_errors(place, "; the trials are safe"):
        part.mkdir(parents=True)
        names = [_save(figure, part / f"{name}.png") for name, figure in drawn]
        replace_folder(place, part)  # so that the folder never mixes figures of two states of a run
    return [place / name for name in names]


def save_figure(draw: Callable[[], Figure], file: Path) -> None:
    """Write what `draw` draws, in the format of the file's ending."""
    content = BytesIO()
    with matplotlib.rc_context(RC), naming_write_errors(file):
        draw().savefig(content, format=file.suffix.removeprefix("."))
        replace_file(file, content.getvalue())


def _save(figure: Figure, png: Path) -> str:
    figure.savefig(png)
    figure.set_layout_engine(None)  # the PDF has the layout of the PNG; computing it again takes as long as drawing
    figure.savefig(png.with_suffix(".pdf"), metadata={"CreationDate": None})
    return png.name
