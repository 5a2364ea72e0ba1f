"""The figures of one run, as .png and .pdf in its folder, for papers and for the eye."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from armwright.best_known import standing
from armwright.buying import ComparedArm, read_bought
from armwright.credit import front_by_source, gained_by_source
from armwright.evaluation import Evaluation
from armwright.exceptions import RunFolderError
from armwright.goals import AXIS
from armwright.history import FrontMember, History
from armwright.kinematics.chain import joint_positions, link_lines, rails
from armwright.objectives import POSITION_ERROR, TORQUE, Objective
from armwright.obstacles import Ground
from armwright.pareto import front_numbers, hypervolume, knee_number, solution_numbers
from armwright.report.drawing import one_panel, several_panels, write_drawn
from armwright.report.solids import draw_obstacles
from armwright.report.style import (
    EXISTING,
    FRONT,
    INFEASIBLE,
    JOINT,
    JOINT_LABEL,
    LINK,
    MISSED,
    OBSTACLE,
    REGION,
    TARGET,
    WAY,
    Look,
    look,
)
from armwright.results import FIGURES, read_summary
from armwright.run_folder import FrontMethod, ObjectiveRecord, read_run
from armwright.space import DesignSpace
from armwright.workspace import Region

ARROW = 0.15  # of an arm's reach, long: which way a target asks the tool to point
SAMPLE_SHARES = (0.05, 0.35, 0.65, 1.0)  # of the counted trials: 10, 70, 130 and 200 of 200, as in the paper
SHOWN = 1.35  # of the reference point, the part of the plane that is drawn
MOST_PANELS = 12
HIGHEST_LABEL, LOWEST_LABEL = 0.8, 0.3  # of existing arms, as parts of the panel's height


def write_figures(folder: str | Path) -> list[Path]:
    """Draws the figures of a run folder and returns their .png files."""
    folder = Path(folder)
    config, history = read_run(folder)
    summary = read_summary(folder) if isinstance(config.method, FrontMethod) else None
    bought = read_bought(folder, len(config.objectives))
    if summary is None or "search" not in summary:
        drawn = _figures(history, bought)
    else:
        drawn = _search_figures(history, summary, bought)
    return write_drawn(folder / FIGURES, drawn)


def _figures(history: History, bought: Sequence[ComparedArm]) -> Iterator[tuple[str, Figure]]:
    plane = len(history.problem.objectives) > 1  # of the first two objectives
    yield "hypervolume", draw_hypervolume(history)
    if plane:
        yield "samples", draw_samples(history)
    yield "credit", draw_credit(history)
    if plane:
        yield "front", draw_front(history, bought)
    yield from _arm_figures(history)


def _search_figures(
    history: History, summary: Mapping[str, Any], bought: Sequence[ComparedArm]
) -> Iterator[tuple[str, Figure]]:
    """Of a search for the whole front, whose trials are that front."""
    yield "hypervolume", draw_search(history, summary)
    if len(history.problem.objectives) > 1:
        yield "front", draw_front(history, bought)
    yield from _arm_figures(history)


def _arm_figures(history: History) -> Iterator[tuple[str, Figure]]:
    chosen = chosen_members(history)
    yield "arms", draw_arms(history, chosen)
    for title, member in chosen:
        yield f"arm-{member.number:04d}", draw_arm(history, title, member)


def chosen_members(history: History) -> list[tuple[str, FrontMember]]:
    """Solution 1 (least position error), the knee, Solution 2 (least torque), all within the reference box.

    Before them the most precise design of all, where it lies beyond the box. Of other objectives, the first and the
    last one take the places of position error and torque. As long as no design is feasible: the nearest.
    """
    reference, objectives = _reference(history), history.problem.objectives
    numbers = front_numbers(history.counted)
    if not numbers:
        return [("Nearest to feasible", history.member(number)) for number in history.nearest(1)]
    first, last = (f"least {objective.label.lower()}" for objective in (objectives[0], objectives[-1]))
    solutions = solution_numbers(history.counted, reference)
    if solutions is None:
        lowest = min(numbers, key=lambda n: history.values[n, -1])
        titled = {numbers[0]: f"{first.capitalize()} of all", lowest: f"{last.capitalize()} of all"}
        return [(title, history.member(number)) for number, title in titled.items()]
    titled = {solutions[0]: f"Solution 1: {first}"}
    if numbers[0] != solutions[0]:
        best = "Most precise" if objectives[0] is POSITION_ERROR else first.capitalize()
        titled = {numbers[0]: f"{best} of all, beyond the reference point", **titled}
    knee = knee_number(history.counted, reference)
    if knee is not None:
        titled.setdefault(knee, "Knee of the front")
    titled.setdefault(solutions[1], f"Solution 2: {last}")
    return [(title, history.member(number)) for number, title in titled.items()]


def draw_hypervolume(history: History) -> Figure:
    """The hypervolume over the counted trials, with the trials of the proposer marked where they enlarged it."""
    figure, axes = one_panel(5.2, 3.2)
    curve = history.hypervolume
    start = hypervolume(history.counted[: history.n_init], _reference(history))
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
                **_paint(style),
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
        _say(axes, _nothing(history))
    return figure


def draw_search(history: History, summary: Mapping[str, Any]) -> Figure:
    """The hypervolume of a search over its evaluations, beside the best known one."""
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
    """All trials after 5, 35, 65 and 100 % of the counted ones, coloured by source, with the front."""
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


def draw_credit(history: History) -> Figure:
    """Who found what over the counted trials: hypervolume gained and designs on the front, stacked by source."""
    figure = several_panels(8.4, 3.4)
    volume, members = figure.subplots(1, 2)
    _stack(volume, gained_by_source(history) or {})
    _stack(members, front_by_source(history))
    for axes, words in ((volume, "Hypervolume gained"), (members, "Designs on the front")):
        axes.set_xlabel(f"Iteration (after {history.n_init} random trials)")
        axes.set_ylabel(words)
    volume.set_title(f"{history.problem.task.name}, reference point {_pair(_reference(history))}")
    members.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    if not np.any(history.hypervolume > 0.0):
        _say(volume, _nothing(history))
    areas = [Patch(**_fill(look(source)), label=look(source).label) for source in reversed(_sources(history))]
    figure.legend(handles=areas, loc="outside right center", title="found by", alignment="left")
    return figure


def draw_front(history: History, bought: Sequence[ComparedArm] = ()) -> Figure:
    """The front at the end, its designs by source, the chosen ones named, and arms that exist already."""
    figure, axes = one_panel(5.2, 4.2)
    reference = _reference(history)
    _scatter(axes, history, reference, faint=True)
    for member in history.front:
        style = look(member.source)
        axes.scatter(*member.values[:2], s=1.6 * style.size, marker=style.marker, **_paint(style), zorder=4)
    near = 0  # labels of points close together are stacked
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
    shown = _draw_bought(axes, reference, bought)
    axes.legend(handles=[*_legend(history), *([_mark(EXISTING)] if shown else [])], loc="upper right")
    area = hypervolume(history.counted, reference)
    axes.set_title(f"{history.problem.task.name}: {len(history.front)} designs on the front, hypervolume {area:.2f}")
    return figure


def _draw_bought(axes: Any, reference: Sequence[float], bought: Sequence[ComparedArm]) -> int:
    """Arms that exist already in the plane of the first two objectives; one beyond it at its edge, with its values.

    How many were drawn: those whose values are known.
    """
    edge = SHOWN * np.array(reference[:2])
    known = [(arm, arm.values[0], arm.values[1]) for arm in bought]
    places = [(arm, np.array([x, y])) for arm, x, y in known if x is not None and y is not None]
    height = HIGHEST_LABEL  # names stand apart from the front's and from each other, the highest arm's first
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


def draw_arms(history: History, chosen: Sequence[tuple[str, FrontMember]]) -> Figure:
    """The chosen designs side by side, each with its postures at all targets."""
    figure = Figure(figsize=(3.8 * len(chosen), 4.4))
    FigureCanvasAgg(figure)
    # The layout engines do not know how far the labels of a 3D plot reach.
    figure.subplots_adjust(left=0.01, right=0.97, bottom=0.1, top=0.9, wspace=0.08)
    evaluation = history.evaluation([member.number for _, member in chosen])
    for column, (title, member) in enumerate(chosen):
        axes: Any = figure.add_subplot(1, len(chosen), column + 1, projection="3d")
        targets = range(len(evaluation.targets))
        extent = _extent(evaluation, [m for _, m in chosen])
        draw_obstacles(axes, evaluation.obstacles, extent)
        _draw_workspace(axes, evaluation.workspace)
        _draw_moves(axes, evaluation, column, targets)
        _draw_postures(axes, member, evaluation, column, targets)
        frame(axes, extent)
        axes.set_title(f"{title}\n{_words(history, member)}", y=1.0)
    figure.legend(
        handles=_arm_legend(evaluation), loc="lower center", ncols=3 if len(chosen) == 1 else _columns(evaluation)
    )
    return figure


def draw_arm(history: History, title: str, member: FrontMember) -> Figure:
    """One design, a panel for each target (at most 12 of them, spread over the list)."""
    evaluation = history.evaluation([member.number])
    n = len(evaluation.targets)
    shown = sorted({round(i) for i in np.linspace(0, n - 1, min(n, MOST_PANELS))})
    columns = min(4, max(2, math.ceil(math.sqrt(len(shown)))))
    rows = -(-len(shown) // columns)
    height = 3.1 * rows + 1.2
    figure = Figure(figsize=(3.1 * columns, height))
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0.01, right=0.96, bottom=0.55 / height, top=1 - 0.75 / height, wspace=0.08, hspace=0.12)
    extent = _extent(evaluation, [member])
    for place, target in enumerate(shown):
        axes: Any = figure.add_subplot(rows, columns, place + 1, projection="3d")
        draw_obstacles(axes, evaluation.obstacles, extent)
        _draw_workspace(axes, evaluation.workspace)
        _draw_moves(axes, evaluation, 0, [target])
        _draw_postures(axes, member, evaluation, 0, [target])
        frame(axes, extent)
        missed = evaluation.missed[0, target]
        verdict = f"missed by {_missed_by(evaluation, target)}" if missed else "reached"
        axes.set_title(f"Target {target + 1}: {verdict}", y=1.0, color=MISSED if missed else FRONT)
    part = "" if len(shown) == n else f" ({len(shown)} of {n} targets shown)"
    figure.suptitle(f"{title}{part}\n{_words(history, member)}", fontsize=10)
    figure.legend(handles=_arm_legend(evaluation), loc="lower center", ncols=_columns(evaluation) if columns > 2 else 3)
    return figure


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
            **_paint(style),
        )
    front = values[front_numbers(history.counted)]
    inside = front[np.all(front < np.asarray(reference), axis=1)]
    if len(inside) and len(reference) == 2:  # of more objectives there is no line to draw
        x = [inside[0, 0], *inside[:, 0], reference[0]]
        y = [reference[1], *inside[:, 1], inside[-1, 1]]
        axes.step(x, y, where="post", color=FRONT, linewidth=1.2, zorder=2)
        axes.fill_between(x, y, reference[1], step="post", color="#F0E442", alpha=0.18, linewidth=0, zorder=0.5)
    axes.plot(*reference[:2], marker="+", color=FRONT, markersize=9, clip_on=False)
    axes.set_xlim(0, SHOWN * reference[0])
    axes.set_ylim(0, SHOWN * reference[1])
    if not len(inside):
        _say(axes, _nothing(history))


def _best_known(axes: Any, history: History) -> None:
    """A line at the best known hypervolume of the task, where there is one."""
    found = standing(history.problem, history.counted, _reference(history))
    if found is not None:
        words = f"best known ({found.hypervolume:.2f})"
        axes.axhline(found.hypervolume, color=MISSED, linewidth=1.0, linestyle=(0, (4, 2)), label=words)


def _stack(axes: Any, layers: Mapping[str, np.ndarray]) -> None:
    """Each source's numbers after 0, 1, …, I iterations (I + 1,), one upon the other."""
    n = max(map(len, layers.values()), default=1)
    iterations, lower = np.arange(n), np.zeros(n)
    for source, numbers in layers.items():
        upper = lower + numbers
        axes.fill_between(iterations, lower, upper, step="post", **_fill(look(source)), linewidth=0)
        axes.step(iterations, upper, where="post", color="white", linewidth=0.8)
        lower = upper
    axes.step(iterations, lower, where="post", color=FRONT, linewidth=1.2)
    axes.set_xlim(0, max(1, n - 1))
    axes.set_ylim(bottom=0)


def _draw_postures(axes: Any, member: FrontMember, evaluation: Evaluation, row: int, targets: Sequence[int]) -> None:
    alpha = 1.0 if len(targets) == 1 else 0.75
    for target in targets:
        q = evaluation.q[row, target, : len(member.arm.joints)]
        places = joint_positions(member.arm, q)
        for line in rails(member.arm, q):
            axes.plot(*line.T, color=FRONT, linewidth=1.0, alpha=alpha)
        for line in link_lines(member.arm, q):
            axes.plot(*line.T, color=LINK, linewidth=2.6, alpha=alpha, solid_capstyle="round")
        for joint, place in zip(member.arm.joints, places[:-1], strict=True):
            axes.plot(*place[:, None], marker="o", markersize=5, color=JOINT[joint.axis], alpha=alpha)
        goal = evaluation.targets[target]
        axes.plot(*goal[:, None], marker="*", markersize=10, color=TARGET, markeredgecolor=FRONT, markeredgewidth=0.5)
        _draw_goal(axes, evaluation, target, ARROW * member.arm.reach)
        if evaluation.missed[row, target]:
            axes.plot(*np.array([places[-1], goal]).T, color=MISSED, linewidth=1.2, linestyle=(0, (2, 2)))
    axes.plot(*np.array(member.arm.base)[:, None], marker="s", markersize=7, color=FRONT)


def _draw_moves(axes: Any, evaluation: Evaluation, row: int, targets: Sequence[int]) -> None:
    """The moves that end at these targets: the line, and the way that the tip takes."""
    if not evaluation.moves:
        return
    lines = evaluation.paths.lines
    for (_, end), first, beyond in zip(evaluation.moves.pairs, lines.first, lines.first[1:], strict=False):
        if end in targets:
            axes.plot(*lines.points[first:beyond].T, color=TARGET, linewidth=1.2)
            axes.plot(*evaluation.paths.reached[row, first:beyond].T, color=WAY, linewidth=1.4, linestyle=(0, (3, 1)))


def _draw_workspace(axes: Any, workspace: Sequence[Region]) -> None:
    """The edges of the boxes to cover."""
    for region in workspace:
        corners = np.array(list(product(*zip(region.low, region.high, strict=True))))
        for one, other in combinations(corners, 2):
            if (one != other).sum() == 1:
                axes.plot(*np.array([one, other]).T, color=REGION, linewidth=0.8)


def _draw_goal(axes: Any, evaluation: Evaluation, target: int, size: float) -> None:
    """Where the tool should point to: an arrow for its z, of a whole orientation its x and y, too."""
    goal, rows = evaluation.targets[target], evaluation.goals.rows[target]
    if not rows:
        return
    for k in (2,) if rows == AXIS else (0, 1, 2):
        colour = TARGET if rows == AXIS else JOINT["xyz"[k]]
        way = (1.0 if k == 2 else 0.6) * size * evaluation.goals.rotation[target, :, k]
        axes.quiver(*goal, *way, color=colour, linewidth=1.4, arrow_length_ratio=0.3)


def _missed_by(evaluation: Evaluation, target: int) -> str:
    words = f"{1e3 * evaluation.position_error[0, target]:.0f} mm"
    if not evaluation.goals.rows[target]:
        return words
    return f"{words}, {math.degrees(evaluation.angle_error[0, target]):.0f}°"


def frame(axes: Any, extent: tuple[np.ndarray, float]) -> None:
    """Equal scales, so that angles and lengths look as they are."""
    centre, half = extent
    for name, middle in zip("xyz", centre, strict=True):
        getattr(axes, f"set_{name}lim")(middle - half, middle + half)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
        getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=-6, fontsize=7)
    axes.tick_params(labelsize=6, pad=-2)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-58)


def _extent(evaluation: Evaluation, members: Sequence[FrontMember]) -> tuple[np.ndarray, float]:
    """The middle and the half side of the cube that holds the targets and every posture of the members [m]."""
    places = [
        joint_positions(member.arm, q[: len(member.arm.joints)])
        for row, member in enumerate(members)
        for q in evaluation.q[row]
    ]
    corners = [corner for region in evaluation.workspace for corner in region.corners]
    points = np.vstack([evaluation.targets, *corners, *places])
    low, high = points.min(axis=0), points.max(axis=0)
    for obstacle in evaluation.obstacles:
        if isinstance(obstacle, Ground) and low[2] - (high - low).max() / 4 < obstacle.z:  # a floor that is near
            low[2] = min(low[2], obstacle.z)
    return (low + high) / 2, float(max(0.1, 0.52 * (high - low).max()))


def _sources(history: History) -> list[str]:
    """The sources that occur, in the order in which they first did."""
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


def _arm_legend(evaluation: Evaluation) -> list[Line2D | Patch]:
    joints = [Line2D([], [], linestyle="", marker="o", color=JOINT[a], label=JOINT_LABEL[a]) for a in "xyz"]
    obstacles = [Patch(facecolor=OBSTACLE, alpha=0.3, label="obstacle")] if evaluation.obstacles else []
    moves = [
        Line2D([], [], color=TARGET, linewidth=1.2, label="straight move"),
        Line2D([], [], color=WAY, linewidth=1.4, linestyle=(0, (3, 1)), label="its tip"),
    ][: 2 * bool(evaluation.moves)]
    regions = [Line2D([], [], color=REGION, linewidth=0.8, label="workspace")] if evaluation.workspace else []
    return [
        Line2D([], [], linestyle="", marker="s", color=FRONT, label="base"),
        *joints,
        Line2D([], [], linestyle="", marker="*", markersize=9, color=TARGET, markeredgecolor=FRONT, label="target"),
        Line2D([], [], color=MISSED, linestyle=(0, (2, 2)), label="missed by"),
        *obstacles,
        *moves,
        *regions,
    ]


def _columns(evaluation: Evaluation) -> int:
    """Of a legend on one line."""
    return len(_arm_legend(evaluation))


def _paint(style: Look) -> dict[str, Any]:
    if style.marker == "x":
        return {"color": style.colour, "linewidths": 1.0}
    return {"color": style.colour, "edgecolors": "white", "linewidths": 0.4}


def _fill(style: Look) -> dict[str, Any]:
    return {"facecolor": style.colour, "hatch": style.hatch, "edgecolor": "white"}


def _words(history: History, member: FrontMember) -> str:
    length = sum(member.design.links)
    first = f"#{member.number} ({look(member.source).label}), {member.design.joints}, length {length:.2f} m"
    values = (
        f"{objective.label.lower()} {value:.4g}" + ("" if objective is TORQUE else f" {objective.unit}")
        for objective, value in zip(history.problem.objectives, member.values, strict=True)
    )
    return f"{first}\n{', '.join(values)}"


def _label(history: History, i: int) -> str:
    return axis_label(history.problem.objectives[i], history.problem.space)


def axis_label(objective: Objective | ObjectiveRecord, space: DesignSpace) -> str:
    """An objective with its unit; torques of arms that weigh some grams say so."""
    toy = "; toy masses" if objective.name == TORQUE.name and space.is_toy else ""
    return f"{objective.label} [{objective.unit.replace(' x ', ' × ')}{toy}]"


def _pair(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"


def _reference(history: History) -> tuple[float, ...]:
    reference = history.reference_point
    if reference is None:
        raise RunFolderError(f"figures need the {history.n_init} random trials; the run has only {len(history)} so far")
    return reference


def _nothing(history: History) -> str:
    """Why no design counts."""
    if not history.feasible.any():
        return "No design meets all constraints."
    return "No design lies within the reference box."


def _say(axes: Any, words: str) -> None:
    axes.annotate(words, (0.5, 0.5), xycoords="axes fraction", ha="center", color="#666666")
