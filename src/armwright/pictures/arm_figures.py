"""Arms in three dimensions: the chosen designs at their targets, with motions, workspace and obstacles."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from armwright.arrays import Array
from armwright.kinematics.arms.forward import (
    column_solid,
    forward_kinematics,
    joint_positions,
    link_lines,
    motor_solids,
    rails,
)
from armwright.pictures.drawing import legend_mark
from armwright.pictures.solids import Extent, draw_edges, draw_obstacles, draw_solid, extent_of
from armwright.pictures.style import FRONT, JOINT, JOINT_LABEL, LINK, MISSED, OBSTACLE, TARGET
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import torque
from armwright.runs.history import FrontMember, History, source_label
from armwright.tasks.motions import Motion
from armwright.tasks.targets import AXIS

ARROW = 0.15  # length of a target's direction arrow, as a share of the arm's reach
MAX_PANELS = 12
COLUMNS = 42  # characters of a caption above one of several panels
LINE_HEIGHT = 0.2  # [inches]
NARROW = 3  # columns of the legend of a narrow figure
WIDE = 7.0  # [inch] of a figure with its legend on one line
INNER = 0.88  # part of an axis that has tick labels

# Lines
MISS: Any = {"color": MISSED, "linewidth": 1.2, "linestyle": (0, (2, 2))}  # from the tip to a target not reached
MOVE: Any = {"color": TARGET, "linewidth": 1.2}  # between two targets
TIP: Any = {"color": FRONT, "linewidth": 1.4, "linestyle": (0, (3, 1))}  # path of the tip on a motion
EDGE: Any = {"color": "#8A8A8A", "linewidth": 0.8}  # of boxes to cover

Panel = tuple[str, str, int, Sequence[int]]  # title and its colour, row of the arm in the evaluation, targets


def draw_arms(history: History, chosen: Sequence[tuple[str, FrontMember]]) -> Figure:
    """Draw the chosen designs side by side, each with its postures at all targets."""
    evaluation = history.evaluation([member.number for _, member in chosen])
    captions = [f"{title}\n{_caption(history, member, COLUMNS)}" for title, member in chosen]
    panels = [(caption, FRONT, row, range(len(evaluation.targets))) for row, caption in enumerate(captions)]
    head = LINE_HEIGHT * max(caption.count("\n") + 1 for caption in captions) - 0.1
    return _draw(evaluation, [member for _, member in chosen], panels, len(chosen), 3.6, head)


def draw_arm(history: History, title: str, member: FrontMember) -> Figure:
    """Draw one design with a panel for each target; of more than 12 targets, 12 spread evenly over the list."""
    evaluation = history.evaluation([member.number])
    n = len(evaluation.targets)
    shown = sorted({round(i) for i in np.linspace(0, n - 1, min(n, MAX_PANELS))})
    panels: list[Panel] = []
    for target in shown:
        missed = evaluation.unreached[0, target]
        verdict = f"missed by {_describe_miss(evaluation, target)}" if missed else "reached"
        panels.append((f"Target {target + 1}: {verdict}", MISSED if missed else FRONT, 0, [target]))
    figure = _draw(evaluation, [member], panels, min(4, max(2, math.ceil(math.sqrt(len(shown))))), 3.1, 0.75)
    part = "" if len(shown) == n else f" ({len(shown)} of {n} targets shown)"
    figure.suptitle(f"{title}{part}\n{_caption(history, member)}", fontsize=10)
    return figure


def _draw(
    evaluation: Evaluation,
    members: Sequence[FrontMember],
    panels: Sequence[Panel],
    columns: int,
    side: float,
    head: float,
) -> Figure:
    """Draw panels in rows above a legend; side, head: of a panel, and the height above the first row [inch]."""
    rows = -(-len(panels) // columns)
    handles = _legend(evaluation)
    legend_columns = NARROW if side * columns < WIDE else len(handles)
    foot = 0.35 + LINE_HEIGHT * math.ceil(len(handles) / legend_columns)  # [inch]
    height = side * rows + foot + head - 0.1
    figure = Figure(figsize=(side * columns, height))
    # The layout engines do not know how far the labels of a 3D plot reach.
    figure.subplots_adjust(left=0.01, right=0.96, bottom=foot / height, top=1 - head / height, wspace=0.08, hspace=0.12)
    extent = _extent(evaluation, members)
    for place, (title, colour, row, targets) in enumerate(panels, start=1):
        axes: Any = figure.add_subplot(rows, columns, place, projection="3d")
        _draw_panel(axes, members[row], evaluation, row, targets, extent)
        axes.set_title(title, y=1.0, color=colour)
    figure.legend(handles=handles, loc="lower center", ncols=legend_columns)
    return figure


def _draw_panel(
    axes: Any,
    member: FrontMember,
    evaluation: Evaluation,
    row: int,
    targets: Sequence[int],
    extent: Extent,
) -> None:
    """Draw one arm at some of its targets; row: that of the arm in the evaluation."""
    draw_obstacles(axes, evaluation.obstacles, extent)
    for region in evaluation.workspace:
        draw_edges(axes, region.low, region.high, EDGE)
    for motion, points in _tip_paths(evaluation, row):
        if evaluation.plan is not None and evaluation.plan.targets[motion.step] in targets:
            if motion.by == "line":
                axes.plot(*evaluation.plan.poses.position[[motion.start, motion.end]].T, **MOVE)
            axes.plot(*points.T, **TIP)
    arm = member.arm
    column = column_solid(arm)
    if column is not None:
        draw_solid(axes, column, extent, LINK)
    alpha = 1.0 if len(targets) == 1 else 0.75
    for target in targets:
        q = evaluation.q[row, target, : len(arm.joints)]
        places = joint_positions(arm, q)
        for line in rails(arm, q):
            axes.plot(*line.T, color=FRONT, linewidth=1.0, alpha=alpha)
        for line in link_lines(arm, q):
            axes.plot(*line.T, color=LINK, linewidth=2.6, alpha=alpha, solid_capstyle="round")
        for axis, body in motor_solids(arm, q):
            draw_solid(axes, body, extent, JOINT[axis])
        for joint, place in zip(arm.joints, places[:-1], strict=True):
            axes.plot(*place[:, None], marker="o", markersize=5, color=JOINT[joint.axis], alpha=alpha)
        goal = evaluation.targets[target]
        axes.plot(*goal[:, None], marker="*", markersize=10, color=TARGET, markeredgecolor=FRONT, markeredgewidth=0.5)
        _draw_orientation(axes, evaluation, target, ARROW * arm.reach)
        if evaluation.unreached[row, target]:
            axes.plot(*np.array([places[-1], goal]).T, **MISS)
    axes.plot(*np.array(arm.base)[:, None], marker="s", markersize=7, color=FRONT)
    frame(axes, extent)


def _tip_paths(evaluation: Evaluation, row: int) -> list[tuple[Motion, Array]]:
    """Return each motion of a cycle with the path (N, 3) of an arm's tip [m]."""
    if evaluation.plan is None:
        return []
    arms, paths = evaluation.paths.of_arm(row)
    return [(path.motion, forward_kinematics(arms, path.q).tip[0]) for path in paths]


def _draw_orientation(axes: Any, evaluation: Evaluation, target: int, size: float) -> None:
    """Draw the required tool direction: an arrow along its z axis, and for a full orientation also along x and y."""
    goal, rows = evaluation.targets[target], evaluation.target_arrays.n_angular[target]
    if not rows:
        return
    for k in (2,) if rows == AXIS else (0, 1, 2):
        colour = TARGET if rows == AXIS else JOINT["xyz"[k]]
        way = (1.0 if k == 2 else 0.6) * size * evaluation.target_arrays.rotation[target, :, k]
        axes.quiver(*goal, *way, color=colour, linewidth=1.4, arrow_length_ratio=0.3)


def _describe_miss(evaluation: Evaluation, target: int) -> str:
    distance = f"{1e3 * evaluation.position_error[0, target]:.0f} mm"
    if not evaluation.target_arrays.n_angular[target]:
        return distance
    return f"{distance}, {math.degrees(evaluation.angle_error[0, target]):.0f}°"


def frame(axes: Any, extent: Extent) -> None:
    """Set equal scales on all axes, so that angles and lengths are not distorted."""
    centre, half = extent
    for name, middle in zip("xyz", centre, strict=True):
        low, high = middle - half, middle + half
        getattr(axes, f"set_{name}lim")(low, high)
        # Labels at the ends of two axes would lie on each other in their common corner.
        ticks = [tick for tick in MaxNLocator(4).tick_values(low, high) if abs(tick - middle) < INNER * half]
        getattr(axes, f"set_{name}ticks")(ticks)
        getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=-6, fontsize=7)
    axes.tick_params(labelsize=6, pad=-2)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-58)


def _extent(evaluation: Evaluation, members: Sequence[FrontMember]) -> Extent:
    """Return the cube that contains all targets, columns, postures and motions."""
    places = [
        joint_positions(member.arm, q[: len(member.arm.joints)])
        for row, member in enumerate(members)
        for q in evaluation.q[row]
    ]
    motions = [points for row in range(len(members)) for _, points in _tip_paths(evaluation, row)]
    lines = [] if evaluation.plan is None else [evaluation.plan.poses.position]
    corners = [corner for region in evaluation.workspace for corner in region.corners]
    feet = [
        np.array(member.arm.base) - (0.0, 0.0, member.arm.column.length)
        for member in members
        if member.arm.column is not None
    ]
    return extent_of([evaluation.targets, *corners, *feet, *places, *lines, *motions], evaluation.obstacles)


def _legend(evaluation: Evaluation) -> list[Line2D | Patch]:
    """Return the entries of the legend below the panels."""
    handles: list[Line2D | Patch] = [
        legend_mark("base", "s", FRONT),
        *(legend_mark(JOINT_LABEL[axis], "o", JOINT[axis]) for axis in "xyz"),
        legend_mark("target", "*", TARGET, markersize=9, markeredgecolor=FRONT),
    ]
    if evaluation.unreached.any():
        handles.append(Line2D([], [], **MISS, label="missed by"))
    if evaluation.obstacles:
        handles.append(Patch(facecolor=OBSTACLE, alpha=0.3, label="obstacle"))
    if evaluation.plan is not None:
        if any(motion.by == "line" for motion in evaluation.plan.motions):
            handles.append(Line2D([], [], **MOVE, label="line of the cycle"))
        handles.append(Line2D([], [], **TIP, label="path of the tip"))
    if evaluation.workspace:
        handles.append(Line2D([], [], **EDGE, label="workspace"))
    return handles


def _caption(history: History, member: FrontMember, columns: int = 200) -> str:
    length = sum(member.design.links)
    first = f"#{member.number} ({source_label(member.source)}), {member.design.joints}, length {length:.2f} m"
    values = (
        f"{objective.label.lower()} {value:.4g}" + ("" if objective is torque else f" {objective.unit}")
        for objective, value in zip(history.problem.objectives, member.values, strict=True)
    )
    return f"{first}\n{textwrap.fill(', '.join(values), columns)}"
