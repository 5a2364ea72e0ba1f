"""Empirical attainment surfaces of several methods on a task."""

from collections.abc import Sequence
from typing import Any

import moocore
import numpy as np
from matplotlib.figure import Figure

from armwright.arrays import Array
from armwright.experiments.compare_runs import Comparison
from armwright.experiments.run_record import RunSummary
from armwright.pareto import front_indices
from armwright.pictures.drawing import frame_plane, front_steps, legend_below, method_handle, one_panel, plane_limits
from armwright.pictures.style import line


def draw_attainment(comparison: Comparison, task: str) -> Figure:
    """Draw empirical attainment surfaces: attained by half of a method's runs, by at least one and by all."""
    figure, axes = one_panel(5.2, 4.2)
    reference = comparison.reference_point(task)
    handles: list[Any] = []
    for method in comparison.methods:
        fronts = [_front(run) for run in comparison.runs_of(method, task)]
        if not sum(map(len, fronts)):
            continue
        style = line(comparison.methods.index(method))
        least, median, most = (_surface(fronts, share, reference) for share in (100 / len(fronts), 50, 100))
        grid = np.unique(np.concatenate([least[0], median[0], most[0]]))
        low, high = (_heights(grid, *steps) for steps in (least, most))
        axes.fill_between(grid, low, high, step="post", color=style.colour, alpha=0.13, linewidth=0)
        axes.step(*median, where="post", **style.curve)
        handles.append(method_handle(comparison, method, with_marker=False))
    fronts = [_front(run) for run in comparison.runs if run.task == task]
    limits = plane_limits(np.vstack(fronts), reference, 1.1)
    frame_plane(axes, comparison.first_run(task).config.problem, reference, limits)
    axes.set_title(f"{task}: attained by half of the runs (lines), by one and by all (areas)")
    legend_below(figure, handles)
    return figure


def _front(run: RunSummary) -> Array:
    """Return the front of a run in the first two objectives (K, 2)."""
    values = run.history().masked_objectives
    return values[front_indices(values)][:, :2]


def _surface(fronts: Sequence[Array], share: float, reference: Sequence[float]) -> tuple[Array, Array]:
    """Return the surface that this share of the fronts attains [%], as the x and y of a step line."""
    sets = np.concatenate([np.full(len(front), i) for i, front in enumerate(fronts)])
    surface = moocore.eaf(np.vstack(fronts), sets=sets, percentiles=[share])
    points = surface[np.argsort(surface[:, 0])][:, :2]
    return front_steps(points[np.all(points < np.asarray(reference[:2]), axis=1)], reference)


def _heights(grid: Array, x: Array, y: Array) -> Array:
    """Return the heights of the steps at `grid`; left of the first step, the top of the box."""
    step = np.searchsorted(x, grid, side="right") - 1
    return np.where(step >= 0, y[np.maximum(step, 0)], y[0])
