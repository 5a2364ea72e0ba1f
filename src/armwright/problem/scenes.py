"""The targets and surroundings that a task states, as arms are evaluated in them."""

from armwright.problem.evaluation import Scene
from armwright.tasks.task import Task


def scenes_of(task: Task) -> tuple[Scene, ...]:
    """Return the targets and surroundings of each case of a task."""
    scenes: list[Scene] = []
    for points, payloads in task.cases:
        plan = task.plan(points) if task.cycle else None
        held = payloads if plan is None else payloads * plan.holds_payload(len(points))
        scenes.append(Scene(points, held, task.target_arrays, task.obstacles, plan, task.workspace, task.load_shape))
    return tuple(scenes)
