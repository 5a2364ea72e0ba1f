"""Arms in three dimensions: the chosen designs at their targets, with motions, workspace and obstacles."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from armwright.arrays import Array
from armwright.kinematics.arms import forward
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.pictures.drawing import legend_mark
from armwright.pictures.solids import Extent, draw_edges, draw_obstacles, draw_solid, extent_of
from armwright.pictures.style import FRONT, JOINT, JOINT_LABEL, LINK, MISSED, OBSTACLE, TARGET
from armwright.problem.arm_quantities import torque
from armwright.problem.problem import Problem
from armwright.proof.design_record import DesignRecord
from armwright.robot.arm import Arm
from armwright.runs.history import FrontMember, History, source_label
from armwright.tasks.targets import AXIS, TargetArrays

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

SAMPLES = 40  # postures of a motion along which its tip is drawn

Records = Mapping[int, DesignRecord]  # of the drawn designs, by number
Panel = tuple[str, str, FrontMember, Sequence[int]]  # title and its colour, design, targets


def draw_arms(history: History, chosen: Sequence[tuple[str, FrontMember]], records: Records) -> Figure:
    """Draw the chosen designs side by side, each with its postures at all targets."""
    targets = range(len(history.problem.task.target_positions))
    captions = [f"{title}\n{_caption(history, member, COLUMNS)}" for title, member in chosen]
    panels = [(caption, FRONT, member, targets) for caption, (_, member) in zip(captions, chosen, strict=True)]
    head = LINE_HEIGHT * max(caption.count("\n") + 1 for caption in captions) - 0.1
    return _draw(history.problem, records, panels, len(chosen), 3.6, head)


def draw_arm(history: History, title: str, member: FrontMember, records: Records) -> Figure:
    """Draw one design with a panel for each target; of more than 12 targets, 12 spread evenly over the list."""
    targets = records[member.number].targets
    n = len(targets)
    shown: list[int] = sorted({round(i) for i in np.linspace(0, n - 1, min(n, MAX_PANELS))})
    panels: list[Panel] = []
    for target in shown:
        reason = targets[target].unreached_reason
        verdict = "reached" if reason is None else f"missed by {reason.partition(':')[0]}"
        panels.append((f"Target {target + 1}: {verdict}", FRONT if reason is None else MISSED, member, [target]))
    columns = min(4, max(2, math.ceil(math.sqrt(len(shown)))))
    figure = _draw(history.problem, records, panels, columns, 3.1, 0.75)
    part = "" if len(shown) == n else f" ({len(shown)} of {n} targets shown)"
    figure.suptitle(f"{title}{part}\n{_caption(history, member)}", fontsize=10)
    return figure


def _draw(
    problem: Problem, records: Records, panels: Sequence[Panel], columns: int, side: float, head: float
) -> Figure:
    """Draw panels in rows above a legend; side, head: of a panel, and the height above the first row [inch]."""
    rows = -(-len(panels) // columns)
    members = {member.number: member for _, _, member, _ in panels}
    handles = _legend(problem, [records[number] for number in members])
    legend_columns = NARROW if side * columns < WIDE else len(handles)
    foot = 0.35 + LINE_HEIGHT * math.ceil(len(handles) / legend_columns)  # [inch]
    height = side * rows + foot + head - 0.1
    figure = Figure(figsize=(side * columns, height))
    # The layout engines do not know how far the labels of a 3D plot reach.
    figure.subplots_adjust(left=0.01, right=0.96, bottom=foot / height, top=1 - head / height, wspace=0.08, hspace=0.12)
    extent = _extent(problem, [(member.arm, records[number]) for number, member in members.items()])
    for place, (title, colour, member, targets) in enumerate(panels, start=1):
        axes: Any = figure.add_subplot(rows, columns, place, projection="3d")
        _draw_panel(axes, problem, member.arm, records[member.number], targets, extent)
        axes.set_title(title, y=1.0, color=colour)
    figure.legend(handles=handles, loc="lower center", ncols=legend_columns)
    return figure


def _draw_panel(
    axes: Any, problem: Problem, arm: Arm, record: DesignRecord, targets: Sequence[int], extent: Extent
) -> None:
    """Draw one arm at some of its targets."""
    task, plan = problem.task, problem.scenes[0].plan
    draw_obstacles(axes, task.obstacles, extent)
    for region in task.workspace:
        draw_edges(axes, region.low, region.high, EDGE)
    for motion, points in zip(plan.motions if plan else (), _tip_paths(arm, record), strict=True):
        if plan is not None and plan.targets[motion.step] in targets:
            if motion.by == "line":
                axes.plot(*plan.poses.position[[motion.start, motion.end]].T, **MOVE)
            axes.plot(*points.T, **TIP)
    column = forward.column_solid(arm)
    if column is not None:
        draw_solid(axes, column, extent, LINK)
    alpha = 1.0 if len(targets) == 1 else 0.75
    for target in targets:
        q = record.targets[target].q
        places = forward.joint_positions(arm, q)
        for line in forward.rails(arm, q):
            axes.plot(*line.T, color=FRONT, linewidth=1.0, alpha=alpha)
        for line in forward.link_lines(arm, q):
            axes.plot(*line.T, color=LINK, linewidth=2.6, alpha=alpha, solid_capstyle="round")
        for axis, body in forward.motor_solids(arm, q):
            draw_solid(axes, body, extent, JOINT[axis])
        for joint, place in zip(arm.joints, places[:-1], strict=True):
            axes.plot(*place[:, None], marker="o", markersize=5, color=JOINT[joint.nearest_axis], alpha=alpha)
        goal = task.target_positions[target]
        axes.plot(*goal[:, None], marker="*", markersize=10, color=TARGET, markeredgecolor=FRONT, markeredgewidth=0.5)
        _draw_orientation(axes, goal, task.target_arrays, target, ARROW * arm.reach)
        if record.targets[target].unreached_reason is not None:
            axes.plot(*np.array([places[-1], goal]).T, **MISS)
    axes.plot(*np.array(arm.base)[:, None], marker="s", markersize=7, color=FRONT)
    frame(axes, extent)


def _tip_paths(arm: Arm, record: DesignRecord) -> list[Array]:
    """Return the path (N, 3) of an arm's tip [m] on each motion of a cycle."""
    found: list[Array] = []
    for points in [] if record.motion is None else record.motion.q:
        shares, at = np.linspace(0.0, 1.0, len(points)), np.linspace(0.0, 1.0, SAMPLES)
        columns: Array = np.array(points, dtype=np.float64).T
        values: list[Array] = [np.interp(at, shares, column) for column in columns]
        q: Array = np.stack(values, axis=-1)
        found.append(forward.forward_kinematics(stack_arms([arm], "float64"), q[None]).tip[0])
    return found


def _draw_orientation(axes: Any, goal: Array, arrays: TargetArrays, target: int, size: float) -> None:
    """Draw the required tool direction: an arrow along its z axis, and for a full orientation also along x and y."""
    rows = arrays.n_angular[target]
    if not rows:
        return
    for k in (2,) if rows == AXIS else (0, 1, 2):
        colour = TARGET if rows == AXIS else JOINT["xyz"[k]]
        way = (1.0 if k == 2 else 0.6) * size * arrays.rotation[target, :, k]
        axes.quiver(*goal, *way, color=colour, linewidth=1.4, arrow_length_ratio=0.3)


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


def _extent(problem: Problem, drawn: Sequence[tuple[Arm, DesignRecord]]) -> Extent:
    """Return the cube that contains all targets, columns, postures and motions."""
    places = places_of(problem)
    for arm, record in drawn:
        places += [forward.joint_positions(arm, target.q) for target in record.targets] + _tip_paths(arm, record)
        if arm.column is not None:
            places.append(np.array(arm.base) - (0.0, 0.0, arm.column.length))
    return extent_of(places, problem.task.obstacles)


def places_of(problem: Problem) -> list[Any]:
    """Return the points of a task that are drawn: targets, poses of the cycle, and corners of the workspace."""
    task, plan = problem.task, problem.scenes[0].plan
    corners = [corner for region in task.workspace for corner in region.corners]
    return [task.target_positions, *([] if plan is None else [plan.poses.position]), *corners]


def _legend(problem: Problem, records: Sequence[DesignRecord]) -> list[Line2D | Patch]:
    """Return the entries of the legend below the panels."""
    handles: list[Line2D | Patch] = [
        legend_mark("base", "s", FRONT),
        *(legend_mark(JOINT_LABEL[axis], "o", JOINT[axis]) for axis in "xyz"),
        legend_mark("target", "*", TARGET, markersize=9, markeredgecolor=FRONT),
    ]
    if any(target.unreached_reason is not None for record in records for target in record.targets):
        handles.append(Line2D([], [], **MISS, label="missed by"))
    return handles + scene_legend(problem, "path of the tip", TIP)


def scene_legend(problem: Problem, label: str, style: Any) -> list[Line2D | Patch]:
    """Return the entries of what is around an arm, and of paths that are no stated lines: their label and style."""
    handles: list[Line2D | Patch] = []
    if problem.task.obstacles:
        handles.append(Patch(facecolor=OBSTACLE, alpha=0.3, label="obstacle"))
    plan = problem.scenes[0].plan
    ways = {motion.by for motion in plan.motions} if plan else set[str]()
    if "line" in ways:
        handles.append(Line2D([], [], **MOVE, label="line of the cycle"))
    if ways - {"line"} or (ways and style is TIP):
        handles.append(Line2D([], [], **style, label=label))
    if problem.task.workspace:
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
