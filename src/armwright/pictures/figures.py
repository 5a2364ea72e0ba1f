"""Figures of one run, written to its folder as PNG and PDF."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from armwright.arrays import Array
from armwright.exceptions import RunFolderError
from armwright.existing.compare_arms import ComparedArm, read_existing_arms
from armwright.pareto import front_indices, hypervolume, knee_index, paper_solution_indices
from armwright.pictures import drawing
from armwright.pictures.arm_figures import draw_arms
from armwright.pictures.style import BEST_KNOWN, EXISTING, FRONT, INFEASIBLE, Look, look
from armwright.proof.design_record import read_records
from armwright.proof.front_gap import front_gap
from armwright.proof.results import FIGURES, read_summary
from armwright.runs.config import FrontMethod
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.text import rounded

SAMPLE_SHARES = (0.05, 0.35, 0.65, 1.0)  # of the counted trials; 10, 70, 130 and 200 of 200, as in the paper
SHOWN = 1.35  # drawn part of the plane, as a multiple of the reference point
LINE = 0.18  # [inch] of the legend
MARK_PAD = 0.08  # [inch] around a panel with marks on its edge


def write_figures(folder: str | Path) -> list[Path]:
    """Draw hypervolume, front and chosen arms of a run folder, and return the PNG files."""
    folder = Path(folder)
    config, history = read_run(folder)
    search = (read_summary(folder) or {}).get("search") if isinstance(config.method, FrontMethod) else None
    existing = read_existing_arms(folder, len(config.objectives))
    return drawing.write_drawn(folder / FIGURES, _figures(folder, history, search, existing))


def _figures(
    folder: Path, history: History, search: Mapping[str, Any] | None, existing: Sequence[ComparedArm]
) -> Iterator[tuple[str, Figure]]:
    """Yield figures by name; `search` is the record of a direct search, whose trials are its front."""
    if len(history) and not history.evaluated.any():
        return  # there is nothing to draw
    yield "hypervolume", draw_hypervolume(history) if search is None else draw_search(history, search)
    if len(history.problem.objectives) > 1:
        yield "front", draw_front(history, existing)
    chosen = chosen_members(history)
    yield "arms", draw_arms(history, chosen, read_records(folder, history, [member.number for _, member in chosen]))


def chosen_members(history: History) -> list[tuple[str, FrontMember]]:
    """Return titled designs of the front: Solution 1, the knee and Solution 2, all within the reference box.

    Solution 1 has the smallest value of the first objective (position error in the paper), Solution 2 of the last one
    (torque). If the most precise design lies outside the box, it comes first. If no design is feasible, the one nearest
    to feasibility is returned.
    """
    reference, objectives = _reference(history), history.problem.objectives
    numbers = front_indices(history.masked_objectives)
    if not numbers:
        return [("Nearest to feasible", history.member(number)) for number in history.nearest(1)]
    first, last = (f"least {objective.label.lower()}" for objective in (objectives[0], objectives[-1]))
    solutions = paper_solution_indices(history.masked_objectives, reference)
    titled: dict[int, str] = {}
    if solutions is None:
        lowest = min(numbers, key=lambda number: history.values[number, -1])
        titled = {numbers[0]: f"{first.capitalize()} of all", lowest: f"{last.capitalize()} of all"}
    else:
        if numbers[0] != solutions[0]:
            titled[numbers[0]] = f"{first.capitalize()} of all, beyond the reference point"
        titled[solutions[0]] = f"Solution 1: {first}"
        knee = knee_index(history.masked_objectives, reference)
        if knee is not None:
            titled.setdefault(knee, "Knee of the front")
        titled.setdefault(solutions[1], f"Solution 2: {last}")
    return [(title, history.member(number)) for number, title in titled.items()]


def draw_hypervolume(history: History) -> Figure:
    """Draw the hypervolume over the counted trials; proposals that enlarged it are marked."""
    figure, axes = drawing.one_panel(5.2, 3.2)
    curve = history.hypervolume
    start = hypervolume(history.masked_objectives[: history.n_init], _reference(history))
    values = np.array([start, *curve])
    axes.step(np.arange(len(values)), values, where="post", color=FRONT, linewidth=1.4, label="hypervolume")
    gained: list[int] = np.flatnonzero(np.diff(values) > 0.0).tolist()  # counted trials, from 0
    for source in _sources(history):
        hits = [i for i in gained if history.trials[history.n_init + i].source == source]
        if hits:
            style = look(source)
            axes.scatter(np.array(hits) + 1, curve[hits], **style.points, zorder=3, label=f"gained by {style.label}")
    axes.set_xlim(0, max(1, len(curve)))
    _label_hypervolume(axes, history, f"Iteration (after {history.n_init} random trials)")
    if len(curve) and curve[-1] == 0.0:
        _explain_empty(axes, history)
    return figure


def draw_search(history: History, search: Mapping[str, Any]) -> Figure:
    """Draw the hypervolume of a direct search over its evaluations, with the best known value."""
    figure, axes = drawing.one_panel(5.2, 3.2)
    evaluations, volumes = np.array(search["hypervolume_history"]).T
    axes.step(evaluations, volumes, where="post", color=FRONT, linewidth=1.4, label="hypervolume")
    axes.set_xscale("log")
    if evaluations[-1] < 100 * evaluations[0]:  # else decades suffice
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))  # the usual one writes markup
    axes.xaxis.set_minor_formatter(NullFormatter())
    _label_hypervolume(axes, history, "Designs evaluated")
    return figure


def _label_hypervolume(axes: Any, history: History, x_label: str) -> None:
    """Label axes of a hypervolume, with a line at the best known one of the task, if one is known."""
    reference = _reference(history)
    found = front_gap(history.problem, history.masked_objectives, reference)
    if found is not None:
        axes.axhline(found.hypervolume, **BEST_KNOWN, label=f"best known ({found.hypervolume:.2f})")
    title = f"{history.problem.task.name}, reference point ({', '.join(f'{value:.4g}' for value in reference)})"
    axes.set(xlabel=x_label, ylabel="Hypervolume", title=title)
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower right")


def draw_samples(history: History) -> Figure:
    """Draw all trials after 5, 35, 65 and 100 % of the counted ones, coloured by source, with the front."""
    figure = Figure(figsize=(10.4, 3.4), layout="constrained")
    panels: Sequence[Any] = figure.subplots(1, len(SAMPLE_SHARES), sharex=True, sharey=True)
    counted, limits = len(history) - history.n_init, _limits(history)
    shown = sorted({max(1, round(share * counted)) for share in SAMPLE_SHARES}) if counted > 0 else [0]
    for axes, iteration in zip(panels, shown, strict=False):
        part = History(history.problem, history.trials[: history.n_init + iteration], history.n_init)
        _scatter(axes, part, _reference(history), limits)
        beyond = int(np.sum(np.any(part.values[part.evaluated, :2] > limits[:, 1], axis=1)))
        axes.set_title(f"After {iteration} iterations" + (f"\n({beyond} designs outside the view)" if beyond else ""))
        axes.label_outer()
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    drawing.legend_below(figure, _legend(history))
    return figure


def draw_front(history: History, existing: Sequence[ComparedArm] = ()) -> Figure:
    """Draw the final front by source, with numbers at the chosen designs and letters at existing arms."""
    reference, limits = _reference(history), _limits(history)
    marked = [
        (f"{title.split(':')[0].split(',')[0]}, #{member.number} {member.design.joints}", member.values)
        for title, member in chosen_members(history)
        if np.all(np.array(member.values[:2]) <= limits[:, 1])
    ]
    arms = [arm for arm in existing if None not in arm.values[:2]]
    # Marks on both sides keep apart.
    arms.sort(key=lambda arm: np.minimum(arm.values[0] or 0.0, limits[0, 1]), reverse=True)
    figure, axes = drawing.one_panel(5.2, 4.2 + LINE * (len(marked) + len(arms)), MARK_PAD if arms else None)
    _scatter(axes, history, reference, limits, alpha=0.25)
    for member in history.front:
        style = look(member.source)
        axes.scatter(*member.values[:2], **style.points | {"s": 1.6 * style.size}, zorder=4)
    area = hypervolume(history.masked_objectives, reference)
    n = len(history.front)
    axes.set_title(f"{history.problem.task.name}: {n} design{'s' * (n != 1)} on the front, hypervolume {area:.2f}")
    handles = [*_legend(history), *([_mark(EXISTING)] if arms else [])]
    for number, (label, values) in enumerate(marked):
        side = -1 if number % 2 else 1
        handles.append(_named(axes, values[:2], (side, side), str(number + 1), label))
    for number, arm in enumerate(arms):
        place = np.array(arm.values[:2], dtype=float)
        at = np.minimum(place, limits[:, 1])
        beyond = "" if np.all(place <= at) else f", beyond, at {rounded(place[0])}, {rounded(place[1])}"
        axes.scatter(*at, **EXISTING.points | {"edgecolors": FRONT}, zorder=6, clip_on=False)
        sides = (-1 if number % 2 else 1, -1 if at[1] > limits[1].mean() else 1)
        handles.append(_named(axes, at, sides, ascii_lowercase[number % 26], f"{arm.name}{beyond}"))
    drawing.legend_below(figure, handles)
    return figure


def _named(axes: Any, place: Any, sides: tuple[int, int], mark: str, label: str) -> Line2D:
    """Ring a place, write a mark on its right or left (1, -1), above or below, and return the legend entry."""
    x, y = sides
    axes.plot(*place, marker="o", markersize=10, color=FRONT, markerfacecolor="none", clip_on=False, zorder=7)
    aligned = {"ha": "left" if x > 0 else "right", "va": "bottom" if y > 0 else "top"}
    axes.annotate(mark, place, (5 * x, 4 * y), textcoords="offset points", **aligned, weight="bold", zorder=7)
    return drawing.legend_mark(f"{mark}: {label}", "", FRONT)


def _limits(history: History) -> Array:
    """Return the drawn part of the plane (2, 2), low and high: where the feasible designs are, if there are any."""
    feasible = history.values[history.feasible]
    shown = feasible if len(feasible) else history.values[history.evaluated]
    return drawing.plane_limits(shown[:, :2], _reference(history), SHOWN)


def _scatter(axes: Any, history: History, reference: Sequence[float], limits: Array, alpha: float = 0.85) -> None:
    values = history.values
    infeasible = values[~history.feasible & history.evaluated]
    axes.scatter(*infeasible.T[:2], s=14, facecolors="none", edgecolors=INFEASIBLE, linewidths=0.7, zorder=2)
    for source in _sources(history):
        found = values[history.feasible & np.array([trial.source == source for trial in history])]
        axes.scatter(*found.T[:2], **look(source).points, alpha=alpha, zorder=3)
    front = values[front_indices(history.masked_objectives)]
    inside = front[np.all(front < np.asarray(reference), axis=1)]
    if len(inside) and len(reference) == 2:  # more than two objectives have no front line
        drawing.draw_dominated(axes, inside, reference, color="#F0E442", alpha=0.18, zorder=0.5)
    drawing.frame_plane(axes, history.problem, reference, limits)
    if not len(inside):
        _explain_empty(axes, history)


def _sources(history: History) -> list[str]:
    """Return the sources in order of their first appearance."""
    return list(dict.fromkeys(trial.source for trial in history))


def _legend(history: History) -> list[Line2D]:
    marks = [_mark(look(source)) for source in _sources(history)]
    if np.any(~history.feasible & history.evaluated):
        marks.append(drawing.legend_mark("infeasible", "o", INFEASIBLE, markerfacecolor="none", markersize=4))
    if len(history.problem.objectives) == 2:
        marks.append(Line2D([], [], color=FRONT, linewidth=1.2, label="Pareto front"))
    return marks


def _mark(style: Look) -> Line2D:
    return drawing.legend_mark(style.label, style.marker, style.colour, markersize=5)


def _reference(history: History) -> tuple[float, ...]:
    reference = history.reference_point
    if reference is None:
        raise RunFolderError(f"figures need the {history.n_init} random trials; the run has only {len(history)} so far")
    return reference


def _explain_empty(axes: Any, history: History) -> None:
    """Write into the figure why the hypervolume is zero."""
    is_feasible = history.feasible.any()
    message = "No design lies within the reference box." if is_feasible else "No design meets all constraints."
    axes.annotate(message, (0.5, 0.5), xycoords="axes fraction", ha="center", color="#666666")
