"""What the page and the editor draw of a task."""

from dataclasses import asdict
from typing import Any

from armwright.tasks.obstacles import Solid
from armwright.tasks.task import Task


def drawn_task(task: Task) -> dict[str, Any]:
    """Return targets, bodies there, obstacles, workspace and lines of the cycle in JSON types; positions in [m]."""
    arrays, lines = task.target_arrays, []
    if task.cycle is not None:
        plan = task.plan(task.target_positions)
        pairs = [[motion.start, motion.end] for motion in plan.motions if motion.by == "line"]
        lines = [plan.poses.position[pair].tolist() for pair in pairs]
    return {
        "targets": task.target_positions.tolist(),
        "n_angular": arrays.n_angular.tolist(),
        "rotation": arrays.rotation.tolist(),
        "obstacles": [_drawn(one.solid) | {"description": one.describe()} for one in task.obstacles],
        "bodies": [_drawn(solid) for solid in task.bodies_at_targets],
        "workspace": [{"low": r.low, "high": r.high, "description": r.describe()} for r in task.workspace],
        "lines": lines,
    }


def _drawn(solid: Solid) -> dict[str, Any]:
    return asdict(solid) | {"rotation": solid.rotation.tolist(), "hull": solid.hull.triangles.tolist()}
