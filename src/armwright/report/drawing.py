"""Figures without a screen: made, and written as .png and .pdf, all of a folder in one step."""

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
    """A figure of this size [inch], and its axes."""
    figure = several_panels(width, height)
    return figure, figure.subplots()


def several_panels(width: float, height: float) -> Figure:
    """A figure of this size [inch] whose axes come later."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_drawn(place: Path, drawn: Iterable[tuple[str, Figure]]) -> list[Path]:
    """Writes figures by name as .png and .pdf into the folder `place`, instead of what lies there; the .png files."""
    part = place.with_name(f"{place.name}.part")
    with matplotlib.rc_context(RC), _writing(place):
        if part.exists():
            shutil.rmtree(part)
        part.mkdir(parents=True)
        names = [_save(figure, part / f"{name}.png") for name, figure in drawn]
        replace_folder(place, part)  # which so always holds all figures of one state of the run
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
