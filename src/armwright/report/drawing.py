"""Figures without a display, written as PNG and PDF; a folder of figures is replaced in one step."""

import shutil
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from armwright.exceptions import RunFolderError
from armwright.files import replace_folder
from armwright.report.style import RC


def one_panel(width: float, height: float) -> tuple[Figure, Any]:
    """Return a figure of this size [inch] and its only axes."""
    figure = several_panels(width, height)
    return figure, figure.subplots()


def several_panels(width: float, height: float) -> Figure:
    """Return a figure of this size [inch] without axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_drawn(place: Path, drawn: Iterable[tuple[str, Figure]]) -> list[Path]:
    """Replace the folder `place` by these figures, as PNG and PDF, and return the PNG files."""
    part = place.with_name(f"{place.name}.part")
    with matplotlib.rc_context(RC), _writing(place):
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


@contextmanager
def _writing(path: Path) -> Generator[None]:
    try:
        yield
    except OSError as fault:
        raise RunFolderError(f"cannot write {path}: {fault.strerror or fault}; the trials are safe") from fault
