"""A picture of a task before any search: targets, tool directions, bases, obstacles and lines of the cycle."""

from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from armwright.exceptions import TaskError
from armwright.pictures.arm_figures import EDGE, MOVE, frame, places_of, scene_legend
from armwright.pictures.drawing import legend_mark, save_figure
from armwright.pictures.solids import draw_edges, draw_obstacles, draw_solid, extent_of
from armwright.pictures.style import FRONT, TARGET
from armwright.problem.checks.reach import base_box
from armwright.problem.problem import Problem

ARROW = 0.12  # length of a tool direction, as a share of the picture's side
MAX_NAMED = 40  # targets
FORMATS = (".png", ".pdf", ".svg")
BASES: Any = {"color": FRONT, "linewidth": 0.9, "linestyle": (0, (2, 2))}  # edges of the box of allowed bases
# A joint motion, whose way depends on the arm
PATH: Any = {"color": TARGET, "linewidth": 0.8, "linestyle": (0, (1, 2))}


def write_task_figure(problem: Problem, file: Path) -> None:
    """Write the picture of a task and its space.

    Raises:
        TaskError: The file is not a PNG, PDF or SVG.
    """
    if file.suffix.lower() not in FORMATS:
        raise TaskError(f"--out {file}: expected a name that ends in {', '.join(FORMATS)}")
    save_figure(partial(draw_task, problem), file)


def draw_task(problem: Problem) -> Figure:
    """Draw a task and the bases that its space allows."""
    task = problem.task
    figure = Figure(figsize=(6.4, 6.0))
    figure.subplots_adjust(left=0.02, right=0.95, bottom=0.12, top=0.95)
    axes: Any = figure.add_subplot(projection="3d")
    low, high = base_box(problem.space)
    plan = problem.scenes[0].plan
    extent = extent_of([low, high, *places_of(problem)], task.obstacles)
    draw_obstacles(axes, task.obstacles, extent)
    for solid in task.bodies_at_targets:
        draw_solid(axes, solid, extent, TARGET)
    for region in task.workspace:
        draw_edges(axes, region.low, region.high, EDGE)
    draw_edges(axes, low, high, BASES)
    axes.plot(*((low + high) / 2)[:, None], marker="s", markersize=6, color=FRONT)
    for motion in plan.motions if plan else ():
        assert plan is not None
        axes.plot(*plan.poses.position[[motion.start, motion.end]].T, **(MOVE if motion.by == "line" else PATH))
    arrays = task.target_arrays
    for i, point in enumerate(task.target_positions):
        axes.plot(*point[:, None], marker="*", markersize=10, color=TARGET, markeredgecolor=FRONT, markeredgewidth=0.5)
        if arrays.n_angular[i]:
            axes.quiver(*point, *(2 * ARROW * extent[1] * arrays.rotation[i, :, 2]), color=TARGET, linewidth=1.2)
        if i < MAX_NAMED:
            axes.text(*point, f" {task.target_names[i]}", fontsize=8)
    frame(axes, extent)
    axes.set_title(f"{task.name} in space {problem.space.name}")
    figure.legend(handles=_handles(problem), loc="lower center", ncols=3)
    return figure


def _handles(problem: Problem) -> list[Line2D | Patch]:
    """Return the entries of the legend."""
    return [
        legend_mark("target, tool direction", "*", TARGET, markersize=9, markeredgecolor=FRONT),
        Line2D([], [], **BASES, marker="s", markersize=5, label="allowed bases, their centre"),
        *([Patch(facecolor=TARGET, alpha=0.3, label="tool, payload")] if problem.task.bodies_at_targets else []),
        *scene_legend(problem, "joint motion between", PATH),
    ]
