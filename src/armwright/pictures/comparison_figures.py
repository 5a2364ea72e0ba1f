"""Figures of a comparison, which are those of the paper."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from armwright.experiments.compare_runs import Comparison
from armwright.pareto import front_indices, hypervolume, paper_solution_indices
from armwright.pictures.arm_figures import draw_arm, frame
from armwright.pictures.drawing import draw_dominated, frame_plane, legend_below, one_panel, write_drawn
from armwright.pictures.figures import draw_samples
from armwright.pictures.reason_figures import draw_reasons
from armwright.pictures.solids import extent_of
from armwright.pictures.style import BEST_KNOWN, FRONT, MISSED, TARGET, line
from armwright.proof.design_record import read_records
from armwright.proof.results import FIGURES

MAX_SHOWN = 12  # most tasks in the figure of targets
COLUMNS = 3  # panels side by side
MARKERS = 5  # markers on a curve

Curves = Mapping[str, tuple[str, Sequence[str]]]  # title and methods of each figure


def write_comparison_figures(
    place: Path, comparison: Comparison, curves: Curves | None = None, samples: Sequence[str] = ()
) -> list[Path]:
    """Draw a comparison into `place`/figures and return the PNG files.

    Hypervolume curves are by default one figure with all methods. Of the methods to show in detail (`samples`), the
    first one with runs is drawn; by default the last of all methods.
    """
    return write_drawn(place / FIGURES, _drawn(comparison, curves or {}, samples))


def _drawn(comparison: Comparison, curves: Curves, samples: Sequence[str]) -> Iterator[tuple[str, Figure]]:
    yield "targets", draw_targets(comparison)
    with_curves = [
        method for method in comparison.methods if any(len(comparison.curves(method, t)) for t in comparison.tasks)
    ]
    if with_curves:
        if all(len(run.config.objectives) > 1 for run in comparison.runs):
            yield "area", draw_area(comparison)
        for name, (title, methods) in (curves or {"methods": ("", with_curves)}).items():
            if drawn := [method for method in methods if method in with_curves]:
                yield f"hypervolume-{name}", draw_curves(comparison, drawn, title)
    yield from _details(comparison, samples)


def _details(comparison: Comparison, samples: Sequence[str]) -> Iterator[tuple[str, Figure]]:
    """Yield figures of one run per task: its samples, Solutions 1 and 2, and the reasons for Solution 1."""
    shown = next((method for method in samples if method in comparison.methods), comparison.methods[-1])
    for task in comparison.tasks[:COLUMNS]:
        runs = [run for run in comparison.runs_of(shown, task) if len(run.curve)]
        if not runs:
            continue
        history = runs[0].history()
        if len(history.problem.objectives) > 1:
            yield f"samples-{task}", draw_samples(history)
        solutions = paper_solution_indices(history.masked_objectives, comparison.reference_point(task))
        for i, number in enumerate(dict.fromkeys(solutions or ()), start=1):
            title = f"{task}, {shown}, seed {runs[0].seed}: Solution {i}"
            records = read_records(runs[0].folder, history, [number])
            yield f"solution-{i}-{task}", draw_arm(history, title, history.member(number), records)
        reasons = draw_reasons(runs[0], history, solutions)
        if reasons is not None:
            yield f"reasoning-{task}", reasons


def draw_targets(comparison: Comparison) -> Figure:
    """Draw the targets of each task in space."""
    shown = comparison.tasks[:MAX_SHOWN]
    columns = min(len(shown), COLUMNS + 1)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(3.2 * columns, 3.3 * rows))
    figure.subplots_adjust(left=0.02, right=0.95, bottom=0.06 / rows, top=1 - 0.1 / rows, wspace=0.1, hspace=0.16)
    for place, task in enumerate(shown, start=1):
        points = comparison.first_run(task).config.task.target_positions
        axes: Any = figure.add_subplot(rows, columns, place, projection="3d")
        axes.scatter(*points.T, marker="*", s=90, color=TARGET, edgecolors=FRONT, linewidths=0.5, depthshade=False)
        centre, half = extent_of([points])
        for x, y, z in points.tolist():
            axes.plot([x, x], [y, y], [centre[2] - half, z], color="#BBBBBB", linewidth=0.6)
        frame(axes, (centre, half))
        axes.set_title(f"{task}: {len(points)} targets", y=1.0)
    if len(shown) < len(comparison.tasks):
        figure.suptitle(f"{len(shown)} of {len(comparison.tasks)} tasks", fontsize=10)
    return figure


def draw_area(comparison: Comparison) -> Figure:
    """Draw the area that E_hv measures, between the front of one run and the reference point."""
    run = next(
        run
        for method in [comparison.baseline, *comparison.methods]
        for run in comparison.runs
        if run.method == method and len(run.curve)
    )
    reference = np.array(run.reference_point)
    history = run.history()
    values, masked = history.values[:, :2], history.masked_objectives
    evaluated = values[np.isfinite(values).all(axis=1)]
    inside = values[[n for n in front_indices(masked[:, :2]) if np.all(values[n] < reference[:2])]]
    figure, axes = one_panel(4.4, 3.8)
    axes.scatter(*evaluated.T, s=12, color="#9A9A9A", label="designs")
    if len(inside):
        fill = {"facecolor": "#F0E442", "alpha": 0.5, "hatch": "///", "edgecolor": "#B8AE2C"}
        draw_dominated(axes, inside, run.reference_point, label="area measured", **fill)
        axes.scatter(*inside.T, s=34, color=MISSED, edgecolors="white", linewidths=0.5, zorder=4, label="Pareto front")
    axes.annotate("reference point", reference[:2], xytext=(-4, 5), textcoords="offset points", ha="right")
    limits = np.column_stack([np.zeros(2), 1.15 * reference[:2]])  # the area reaches to the reference point
    frame_plane(axes, history.problem, run.reference_point, limits)
    area = hypervolume(masked, run.reference_point)
    axes.set_title(f"{run.task}, {run.method}, seed {run.seed}: E_hv = {area:.2f}")
    axes.legend(loc="lower left")
    return figure


def draw_curves(comparison: Comparison, methods: Sequence[str], title: str) -> Figure:
    """Draw the mean and standard deviation of the hypervolume over the seeds, with a panel for each task."""
    figure, panels = _panels(comparison.tasks, 2.6)
    for axes, task in zip(panels, comparison.tasks, strict=True):
        for method in methods:
            curves = comparison.curves(method, task)
            if not len(curves):
                continue
            style = line(comparison.methods.index(method))
            iterations = np.arange(1, len(curves[0]) + 1)
            mean, deviation = curves.mean(axis=0), curves.std(axis=0)
            low, high = mean - deviation, mean + deviation
            axes.fill_between(iterations, low, high, color=style.colour, alpha=0.15, linewidth=0)
            axes.plot(iterations, mean, **style.curve, markevery=max(1, len(mean) // MARKERS), marker=style.marker)
        known = comparison.best_known(task)
        if known is not None:
            axes.axhline(known, **BEST_KNOWN)
        label = "Hypervolume" if axes.get_subplotspec().is_first_col() else ""
        axes.set(title=task, xlabel="Iteration", ylabel=label)
        axes.margins(y=0.08)
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
    styles = {method: line(comparison.methods.index(method)) for method in methods}
    handles = [Line2D([], [], **s.curve, marker=s.marker, label=comparison.label(m)) for m, s in styles.items()]
    if any(comparison.best_known(task) is not None for task in comparison.tasks):
        handles.append(Line2D([], [], **BEST_KNOWN, label="best known"))
    legend_below(figure, handles)
    seeds = {len(comparison.runs_of(method, task)) for method in methods for task in comparison.tasks} - {0}
    runs = f"{min(seeds)} to {max(seeds)}" if len(seeds) > 1 else f"{seeds.pop()}"
    caption = f"mean and standard deviation of {runs} runs"
    figure.suptitle(f"{title}: {caption}" if title else caption.capitalize(), fontsize=10)
    return figure


def _panels(tasks: Sequence[str], height: float) -> tuple[Figure, Sequence[Any]]:
    columns = min(len(tasks), COLUMNS if len(tasks) <= 2 * COLUMNS else COLUMNS + 2)
    rows = math.ceil(len(tasks) / columns)
    width = max(5.2, min(3.5, 11.0 / columns) * columns)
    figure = Figure(figsize=(width, height * rows + 0.7), layout="constrained")
    panels: list[Any] = list(np.atleast_1d(figure.subplots(rows, columns)).flat)
    for axes in panels[len(tasks) :]:
        axes.set_visible(False)
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    return figure, panels[: len(tasks)]
