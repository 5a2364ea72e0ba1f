"""Figures of one run, written to its folder as PNG and PDF."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from armwright.exceptions import RunFolderError
from armwright.experiments.compare_arms import ComparedArm, read_existing_arms
from armwright.pareto import front_indices, hypervolume, knee_index, paper_solution_indices
from armwright.problem.objective import Objective
from armwright.problem.objectives import POSITION_ERROR, TORQUE
from armwright.report.arm_figures import draw_arm, draw_arms
from armwright.report.drawing import front_steps, one_panel, several_panels, write_drawn
from armwright.report.style import (
    EXISTING,
    FRONT,
    INFEASIBLE,
    MISSED,
    Look,
    look,
)
from armwright.runs.attribution import front_by_source, gained_by_source
from armwright.runs.best_known import front_gap
from armwright.runs.config import FrontMethod, ObjectiveRecord, RunConfig
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.runs.results import FIGURES, read_summary
from armwright.spaces.design_space import DesignSpace

SAMPLE_SHARES = (0.05, 0.35, 0.65, 1.0)  # of the counted trials; 10, 70, 130 and 200 of 200, as in the paper
SHOWN = 1.35  # drawn part of the plane, as a multiple of the reference point
HIGHEST_LABEL, LOWEST_LABEL = 0.8, 0.3  # positions of the labels of existing arms, as shares of the panel height


def write_figures(folder: str | Path) -> list[Path]:
    """Draw the figures of a run folder and return the PNG files."""
    folder = Path(folder)
    config, history = read_run(folder)
    summary = read_summary(folder) if isinstance(config.method, FrontMethod) else None
    existing = read_existing_arms(folder, len(config.objectives))
    if summary is None or "search" not in summary:
        drawn = _figures(history, existing)
    else:
        drawn = _search_figures(history, summary, existing)
    return write_drawn(folder / FIGURES, drawn)


def _figures(history: History, existing: Sequence[ComparedArm]) -> Iterator[tuple[str, Figure]]:
    plane = len(history.problem.objectives) > 1  # figures of the first two objectives
    yield "hypervolume", draw_hypervolume(history)
    if plane:
        yield "samples", draw_samples(history)
    yield "attribution", draw_attribution(history)
    if plane:
        yield "front", draw_front(history, existing)
    yield from _arm_figures(history)


def _search_figures(
    history: History, summary: Mapping[str, Any], existing: Sequence[ComparedArm]
) -> Iterator[tuple[str, Figure]]:
    """Yield the figures of a direct search, whose trials are its front."""
    yield "hypervolume", draw_search(history, summary)
    if len(history.problem.objectives) > 1:
        yield "front", draw_front(history, existing)
    yield from _arm_figures(history)


def _arm_figures(history: History) -> Iterator[tuple[str, Figure]]:
    chosen = chosen_members(history)
    yield "arms", draw_arms(history, chosen)
    for title, member in chosen:
        yield f"arm-{member.number:04d}", draw_arm(history, title, member)


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
    if solutions is None:
        lowest = min(numbers, key=lambda n: history.values[n, -1])
        titled = {numbers[0]: f"{first.capitalize()} of all", lowest: f"{last.capitalize()} of all"}
        return [(title, history.member(number)) for number, title in titled.items()]
    titled = {solutions[0]: f"Solution 1: {first}"}
    if numbers[0] != solutions[0]:
        best = "Most precise" if objectives[0] is POSITION_ERROR else first.capitalize()
        titled = {numbers[0]: f"{best} of all, beyond the reference point", **titled}
    knee = knee_index(history.masked_objectives, reference)
    if knee is not None:
        titled.setdefault(knee, "Knee of the front")
    titled.setdefault(solutions[1], f"Solution 2: {last}")
    return [(title, history.member(number)) for number, title in titled.items()]


def draw_hypervolume(history: History) -> Figure:
    """Draw the hypervolume over the counted trials; proposals that enlarged it are marked."""
    figure, axes = one_panel(5.2, 3.2)
    curve = history.hypervolume
    start = hypervolume(history.masked_objectives[: history.n_init], _reference(history))
    iterations = np.arange(len(curve) + 1)
    axes.step(iterations, [start, *curve], where="post", color=FRONT, linewidth=1.4, label="hypervolume")
    gains = np.diff(np.array([start, *curve])) > 0.0
    for source in _sources(history):
        hits = [i for i in range(len(curve)) if gains[i] and history.trials[history.n_init + i].source == source]
        if hits:
            style = look(source)
            axes.scatter(
                np.array(hits) + 1,
                curve[hits],
                s=style.size,
                marker=style.marker,
                **style.paint,
                zorder=3,
                label=f"gained by {style.label}",
            )
    _best_known(axes, history)
    axes.set_xlabel(f"Iteration (after {history.n_init} random trials)")
    axes.set_ylabel("Hypervolume")
    axes.set_title(f"{history.problem.task.name}, reference point {_pair(_reference(history))}")
    axes.set_xlim(0, max(1, len(curve)))
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower right")
    if len(curve) and curve[-1] == 0.0:
        _annotate_centre(axes, _explain_empty(history))
    return figure


def draw_search(history: History, summary: Mapping[str, Any]) -> Figure:
    """Draw the hypervolume of a direct search over its evaluations, with the best known value."""
    figure, axes = one_panel(5.2, 3.2)
    evaluations, volumes = np.array(summary["search"]["hypervolume_history"]).T
    axes.step(evaluations, volumes, where="post", color=FRONT, linewidth=1.4, label="hypervolume")
    _best_known(axes, history)
    axes.set_xscale("log")
    axes.set_xlabel("Designs evaluated")
    axes.set_ylabel("Hypervolume")
    axes.set_title(f"{history.problem.task.name}, reference point {_pair(_reference(history))}")
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower right")
    return figure


def draw_samples(history: History) -> Figure:
    """Draw all trials after 5, 35, 65 and 100 % of the counted ones, coloured by source, with the front."""
    figure = several_panels(10.4, 3.4)
    panels: Sequence[Any] = figure.subplots(1, 4, sharex=True, sharey=True)
    counted = len(history) - history.n_init
    shown = sorted({max(1, round(share * counted)) for share in SAMPLE_SHARES}) if counted > 0 else [0]
    for axes, iteration in zip(panels, shown, strict=False):
        part = History(history.problem, history.trials[: history.n_init + iteration], history.n_init)
        _scatter(axes, part, _reference(history))
        beyond = int(np.sum(np.any(part.values[:, :2] > SHOWN * np.asarray(_reference(history)[:2]), axis=1)))
        axes.set_title(f"After {iteration} iterations" + (f"\n({beyond} designs outside the view)" if beyond else ""))
        axes.set_xlabel(_label(history, 0))
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    panels[0].set_ylabel(_label(history, 1))
    figure.legend(handles=_legend(history), loc="outside lower center", ncols=len(_legend(history)))
    return figure


def draw_attribution(history: History) -> Figure:
    """Draw hypervolume gained and designs on the front over the counted trials, stacked by source."""
    figure = several_panels(8.4, 3.4)
    volume, members = figure.subplots(1, 2)
    _stack(volume, gained_by_source(history) or {})
    _stack(members, front_by_source(history))
    for axes, label in ((volume, "Hypervolume gained"), (members, "Designs on the front")):
        axes.set_xlabel(f"Iteration (after {history.n_init} random trials)")
        axes.set_ylabel(label)
    volume.set_title(f"{history.problem.task.name}, reference point {_pair(_reference(history))}")
    members.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    if not np.any(history.hypervolume > 0.0):
        _annotate_centre(volume, _explain_empty(history))
    areas = [Patch(**look(source).fill, label=look(source).label) for source in reversed(_sources(history))]
    figure.legend(handles=areas, loc="outside right center", title="found by", alignment="left")
    return figure


def draw_front(history: History, existing: Sequence[ComparedArm] = ()) -> Figure:
    """Draw the final front by source, with the chosen designs labelled and existing arms for comparison."""
    figure, axes = one_panel(5.2, 4.2)
    reference = _reference(history)
    _scatter(axes, history, reference, faint=True)
    for member in history.front:
        style = look(member.source)
        axes.scatter(*member.values[:2], s=1.6 * style.size, marker=style.marker, **style.paint, zorder=4)
    near = 0  # labels of neighbouring points are stacked
    before = np.full(2, np.inf)
    for title, member in chosen_members(history):
        place = np.array(member.values[:2]) / np.array(reference[:2])
        if np.any(place > SHOWN):
            continue
        near = near + 1 if np.abs(place - before).max() < 0.15 else 0
        before = place
        axes.annotate(
            f"{title.split(':')[0].split(',')[0]}\n#{member.number}  {member.design.joints}",
            member.values[:2],
            xytext=(10, -34 if place[1] > 0.9 * SHOWN else 10 + 40 * near),
            textcoords="offset points",
            fontsize=8,
            zorder=5,
            bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "#BBBBBB", "alpha": 0.9},
            arrowprops={"arrowstyle": "-", "color": "#888888", "linewidth": 0.8},
        )
    axes.set_xlabel(_label(history, 0))
    axes.set_ylabel(_label(history, 1))
    shown = _draw_existing(axes, reference, existing)
    axes.legend(handles=[*_legend(history), *([_mark(EXISTING)] if shown else [])], loc="upper right")
    area = hypervolume(history.masked_objectives, reference)
    axes.set_title(f"{history.problem.task.name}: {len(history.front)} designs on the front, hypervolume {area:.2f}")
    return figure


def _draw_existing(axes: Any, reference: Sequence[float], existing: Sequence[ComparedArm]) -> int:
    """Draw existing arms in the plane of the first two objectives and return how many were drawn.

    An arm outside the drawn part is placed at its edge, with its values in the label.
    """
    edge = SHOWN * np.array(reference[:2])
    known = [(arm, arm.values[0], arm.values[1]) for arm in existing]
    places = [(arm, np.array([x, y])) for arm, x, y in known if x is not None and y is not None]
    height = HIGHEST_LABEL  # labels keep clear of the front's and of each other, from the top down
    for arm, place in sorted(places, key=lambda known: -known[1][1]):
        at = np.minimum(place, edge)
        beyond = "" if np.all(place <= edge) else f"\nbeyond, at {_short(place[0])}, {_short(place[1])}"
        axes.scatter(
            *at,
            s=EXISTING.size,
            marker=EXISTING.marker,
            color=EXISTING.colour,
            edgecolors=FRONT,
            zorder=6,
            clip_on=False,
        )
        column, row = at / edge
        height = min(height, max(row, LOWEST_LABEL))
        axes.annotate(
            f"{arm.name}{beyond}",
            at,
            xytext=(column + 0.33 if column < 0.5 else column - 0.33, height),
            textcoords="axes fraction",
            ha="left" if column < 0.5 else "right",
            va="center",
            fontsize=8,
            zorder=5,
            bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": EXISTING.colour, "alpha": 0.9},
            arrowprops={"arrowstyle": "-", "color": EXISTING.colour, "linewidth": 0.8},
        )
        height -= 0.11 if beyond else 0.08
    return len(places)


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"


def _scatter(axes: Any, history: History, reference: Sequence[float], faint: bool = False) -> None:
    values = history.values
    broken = values[~history.feasible]
    if len(broken):
        axes.scatter(
            broken[:, 0], broken[:, 1], s=14, facecolors="none", edgecolors=INFEASIBLE, linewidths=0.7, zorder=2
        )
    for source in _sources(history):
        style = look(source)
        rows = values[history.feasible & np.array([trial.source == source for trial in history])]
        axes.scatter(
            rows[:, 0],
            rows[:, 1],
            s=style.size,
            marker=style.marker,
            alpha=0.25 if faint else 0.85,
            zorder=3,
            **style.paint,
        )
    front = values[front_indices(history.masked_objectives)]
    inside = front[np.all(front < np.asarray(reference), axis=1)]
    if len(inside) and len(reference) == 2:  # more than two objectives have no front line
        x, y = front_steps(inside, reference)
        axes.step(x, y, where="post", color=FRONT, linewidth=1.2, zorder=2)
        axes.fill_between(x, y, reference[1], step="post", color="#F0E442", alpha=0.18, linewidth=0, zorder=0.5)
    axes.plot(*reference[:2], marker="+", color=FRONT, markersize=9, clip_on=False)
    axes.set_xlim(0, SHOWN * reference[0])
    axes.set_ylim(0, SHOWN * reference[1])
    if not len(inside):
        _annotate_centre(axes, _explain_empty(history))


def _best_known(axes: Any, history: History) -> None:
    """Draw a line at the best known hypervolume of the task, if one is known."""
    found = front_gap(history.problem, history.masked_objectives, _reference(history))
    if found is not None:
        label = f"best known ({found.hypervolume:.2f})"
        axes.axhline(found.hypervolume, color=MISSED, linewidth=1.0, linestyle=(0, (4, 2)), label=label)


def _stack(axes: Any, layers: Mapping[str, np.ndarray]) -> None:
    """Stack the values of each source after 0, 1, …, I iterations, (I + 1,) each."""
    n = max(map(len, layers.values()), default=1)
    iterations, lower = np.arange(n), np.zeros(n)
    for source, numbers in layers.items():
        upper = lower + numbers
        axes.fill_between(iterations, lower, upper, step="post", **look(source).fill, linewidth=0)
        axes.step(iterations, upper, where="post", color="white", linewidth=0.8)
        lower = upper
    axes.step(iterations, lower, where="post", color=FRONT, linewidth=1.2)
    axes.set_xlim(0, max(1, n - 1))
    axes.set_ylim(bottom=0)


def _sources(history: History) -> list[str]:
    """Return the sources in order of their first appearance."""
    return list(dict.fromkeys(trial.source for trial in history))


def _legend(history: History) -> list[Line2D]:
    marks = [_mark(look(source)) for source in _sources(history)]
    if not history.feasible.all():
        marks.append(
            Line2D(
                [],
                [],
                linestyle="",
                marker="o",
                markerfacecolor="none",
                color=INFEASIBLE,
                markersize=4,
                label="infeasible",
            )
        )
    line = Line2D([], [], color=FRONT, linewidth=1.2, label="Pareto front")
    return [*marks, line] if len(history.problem.objectives) == 2 else marks


def _mark(style: Look) -> Line2D:
    return Line2D([], [], linestyle="", marker=style.marker, color=style.colour, markersize=5, label=style.label)


def _label(history: History, i: int) -> str:
    return axis_label(history.problem.objectives[i], history.problem.space)


def label_axes(axes: Any, config: RunConfig) -> None:
    """Label the axes of a plane of the first two objectives."""
    axes.set_xlabel(axis_label(config.objectives[0], config.space))
    axes.set_ylabel(axis_label(config.objectives[1], config.space))


def axis_label(objective: Objective | ObjectiveRecord, space: DesignSpace) -> str:
    """Return an objective's label with its unit; torques of toy masses are marked as such."""
    toy = "; toy masses" if objective.name == TORQUE.name and space.is_toy else ""
    return f"{objective.label} [{objective.unit.replace(' x ', ' × ')}{toy}]"


def _pair(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"


def _reference(history: History) -> tuple[float, ...]:
    reference = history.reference_point
    if reference is None:
        raise RunFolderError(f"figures need the {history.n_init} random trials; the run has only {len(history)} so far")
    return reference


def _explain_empty(history: History) -> str:
    """Explain why the hypervolume is zero."""
    if not history.feasible.any():
        return "No design meets all constraints."
    return "No design lies within the reference box."


def _annotate_centre(axes: Any, message: str) -> None:
    axes.annotate(message, (0.5, 0.5), xycoords="axes fraction", ha="center", color="#666666")
