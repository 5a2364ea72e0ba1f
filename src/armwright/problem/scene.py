"""Where arms are evaluated: the targets of a task in one case, and their surroundings."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.tasks.motions import CyclePlan
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.payload import POINT_LOAD, LoadShape
from armwright.tasks.targets import TargetArrays
from armwright.tasks.task import Task
from armwright.tasks.tip_rules import TipRules
from armwright.tasks.workspace import Region

# What a task may lack, by the need of a quantity: an error, and the reason alone
MISSING: Mapping[str, tuple[str, str]] = {
    "cycle": (
        "path_error, cycle_time and other quantities of motions need a cycle in the task; try cycle: in_order",
        "the task has no cycle",
    ),
    "workspace": (
        "uncovered_fraction needs a workspace in the task; try workspace: {low: [0.2, -0.3, 0], high: [0.6, 0.3, 0.4]}",
        "the task has no workspace",
    ),
    "directions": (
        "dexterous_volume and undexterous_fraction need a workspace with directions in the task; try workspace: "
        "{low: [0.2, -0.3, 0], high: [0.6, 0.3, 0.4], directions: {axis: [0, 0, -1], half_angle: 0.5}}",
        "the task has no workspace with directions",
    ),
}


@dataclass(frozen=True)
class Scene:
    """The targets of a task in one case, and their surroundings."""

    targets: Array  # (T, 3) positions [m]
    payload: Array  # (T,) mass carried by the tip at each target [kg]
    target_arrays: TargetArrays  # how the targets are to be reached
    obstacles: tuple[Obstacle, ...] = ()  # what clearances are measured from; the inverse kinematics ignores them
    plan: CyclePlan | None = None  # the motions of the task's cycle; None if it has none
    workspace: tuple[Region, ...] = ()  # boxes to cover
    load_shape: LoadShape = POINT_LOAD  # how the mass of the payload is distributed
    tip_rules: TipRules | None = None  # tool and payload as bodies at the targets; None if neither counts

    def require(self, need: str) -> None:
        """Raise UnknownQuantityError if the task lacks a cycle, a workspace, or one with directions."""
        directions = any(region.directions is not None for region in self.workspace)
        has = {"cycle": self.plan is not None, "workspace": bool(self.workspace), "directions": directions}
        if not has.get(need, True):
            raise UnknownQuantityError(*MISSING[need])


def task_scene(task: Task, targets: Array, payloads: Array) -> Scene:
    """Return the surroundings of a task with these targets (T, 3) [m] and payloads (T,) [kg]."""
    plan = task.plan(targets) if task.cycle else None
    held = payloads if plan is None else payloads * plan.holds_payload(len(targets))
    rules = replace(task.tip_rules, carries=held > 0.0)
    return Scene(targets, held, task.target_arrays, task.obstacles, plan, task.workspace, task.load_shape, rules)
