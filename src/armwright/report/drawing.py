"""Figures without a display, written as PNG and PDF; a folder of figures is replaced in one step."""

import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armwright.arrays import Array
from armwright.experiments.compare_runs import Comparison
from armwright.files import naming_write_errors, replace_folder
from armwright.report.style import RC, line

LEGEND_MARK, LEGEND_LETTER = 0.5, 0.06  # widths [inch]


def one_panel(width: float, height: float) -> tuple[Figure, Any]:
    """Return a figure of this size [inch] and its only axes."""
    figure = several_panels(width, height)
    return figure, figure.subplots()


def several_panels(width: float, height: float) -> Figure:
    """Return a figure of this size [inch] without axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def front_steps(front: Array, reference: Sequence[float]) -> tuple[Array, Array]:
    """Return the x and y of a front's step line from the top to the right side of the reference box.

    Args:
        front: Points within the box, sorted by the first objective (K, 2).
        reference: The reference point; only its first two objectives are used.
    """
    if not len(front):
        return np.array([reference[0]]), np.array([reference[1]])
    x = np.concatenate([front[:1, 0], front[:, 0], [reference[0]]])
    y = np.concatenate([[reference[1]], front[:, 1], front[-1:, 1]])
    return x, y


def method_handle(comparison: Comparison, method: str, with_marker: bool = True) -> Line2D:
    """Return the legend entry of a method's line."""
    style = line(comparison.methods.index(method))
    marker = style.marker if with_marker else None
    return Line2D(
        [], [], color=style.colour, linestyle=style.pattern, linewidth=1.5, marker=marker, markersize=4,
        label=comparison.label(method),
    )  # fmt: skip


def legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """Add a legend below the panels, with as many columns as fit."""
    if handles:
        widest = LEGEND_MARK + LEGEND_LETTER * max(len(str(handle.get_label())) for handle in handles)
        columns = max(1, min(len(handles), int(figure.get_figwidth() / widest)))
        figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def write_drawn(place: Path, drawn: Iterable[tuple[str, Figure]]) -> list[Path]:
    """Replace the folder `place` by these figures, as PNG and PDF, and return the PNG files."""
    part = place.with_name(f"{place.name}.part")
    with matplotlib.rc_context(RC), naming_write_errors(place, "; the trials are safe"):
        if part.exists():
            shutil.rmtree(part)
        part.mkdir(parents=True)
        names = [_save(figure, part / f"{name}.png") for name, figure in drawn]
        replace_folder(place, part)  # so that the folder never mixes figures of two states of a run
    return [place / name for name in names]


def _save(figure: Figure, png: Path) -> str:
    figure.savefig(png)
    figure.savefig(png.with_suffix(".pdf"), metadata={"CreationDate": None})
    return png.name
