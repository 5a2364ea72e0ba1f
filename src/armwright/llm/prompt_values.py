"""The values of a prompt template: the problem as text, and what is shown of past designs."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armwright.kinematics.ik.ik import UPDATES
from armwright.llm.answer_format import SINGLE, module_lists
from armwright.llm.feedback import Feedback, design_lines, points, vector
from armwright.llm.model_options import PromptOptions
from armwright.problem.arm_quantities import orientation_error, position_error, unreached_targets
from armwright.problem.ignored_errors import stated_tolerance
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.robot.arm import GRAVITY
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS, MODULES, MOUNT_DESCRIPTIONS
from armwright.spaces.tolerance import length_columns
from armwright.tasks.moments import describe_vector
from armwright.tasks.payload import POINT_LOAD, Payload
from armwright.tasks.targets import REACHED, describe_targets
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from armwright.text import one_line

MAX_TARGETS = 64  # shown
MAX_DESCRIPTION_LENGTH = 2_000  # characters of a task's description


@dataclass(frozen=True)
class Limits:
    """How much a prompt shows at most."""

    targets: int = MAX_TARGETS  # of the task
    designs: int = 5  # in detail, of the front, of the others and of the proposer's latest ones
    lines: int = 60  # designs in one line each, of the front and of the proposer

    def fewer(self) -> "Limits":
        """Return the next smaller limits, or these if they are the smallest.

        Targets are the last but one to go: a model that knows all of them needs fewer examples.
        """
        if self.designs > 2:
            return replace(self, designs=self.designs - 1)
        if self.targets > 4:
            return replace(self, targets=max(4, 3 * self.targets // 4))
        return replace(self, designs=1, lines=max(5, 3 * self.lines // 4))


def common_values(history: History, options: PromptOptions) -> dict[str, Any]:
    """Return the values that do not depend on how much of a history is shown."""
    problem = history.problem
    hypervolume = history.hypervolumes[-1:]
    return {
        **_schedule_values(history),
        "hypervolume": f"{hypervolume[0]:.4g}" if len(hypervolume) else "",
        **_space_values(problem.space),
        **_task_values(problem),
        "constraints": problem.constraints,
        "problem": problem,
        "n_feasible": int(history.feasible.sum()),
        "reference_point": history.reference_point,
        "n_finished": len(history),
        "n_front": len(history.front),
        "form": options.answer,
    }


def _schedule_values(history: History) -> dict[str, int | None]:
    """Return how the study goes on around this prompt."""
    method = history.method
    if method is None:
        return {"n_between": None, "n_turns": None}
    left = method.n_trials - max(method.n_init, len(history))
    return {"n_between": method.n_step - 1, "n_turns": max(1, -(-left // method.n_step))}


def _space_values(space: DesignSpace) -> dict[str, Any]:
    names = {parameter.name for parameter in space.parameters}
    lists = [(group.upper(), kind) for group, kind in module_lists(names).items()]
    per_joint = [(name.upper(), name) for name, entry in space.custom if entry.per is not None]
    single = (*SINGLE, *(name for name, entry in space.custom if entry.per is None))
    return {
        "space": space,
        "n_joints": str(space.max_joints) if space.min_joints == space.max_joints else "D",
        "revolute_types": [kind for kind in space.joint_types if MODULES[kind].is_revolute],
        "prismatic_types": [kind for kind in space.joint_types if MODULES[kind].is_prismatic],
        "straight": space.mount == ("floor",) and space.link_directions == ("+z",),
        "extra_groups": [*((name.upper(), name) for name in single if name in names), *lists, *per_joint],
        "single": single,
        "some_idle": not all(MODULES[letter].is_actuated for letter in space.joint_types),
        "bar_radius": _describe_radius(space),
        "n_copies": len(length_columns(space)) * 2,
        "joint_descriptions": JOINT_DESCRIPTIONS,
        "mount_descriptions": MOUNT_DESCRIPTIONS,
        "restricted": [p for p in space.parameters if p.name in dict(space.restrict)],
    }


def _describe_radius(space: DesignSpace) -> str:
    """Describe the radius of the links, as in "a bar of …"."""
    if len(space.tube_names) > 1:
        return f"the outer diameter of {'tube_j' if space.link_section.per_link else 'tube'}"
    return f"radius {space.tube_values('radius')[0]:g} m"


def _task_values(problem: Problem) -> dict[str, Any]:
    task = problem.task
    of_the_way = [q for q in QUANTITIES.values() if "motions" in q.needs and q in problem.quantities]
    return {
        "gravity": GRAVITY,
        "task": task,
        "description": one_line(task.description, MAX_DESCRIPTION_LENGTH),
        "tool": _describe_tool(task.tool),
        "payload": _describe_payload(task),
        "point_load": task.load_shape == POINT_LOAD,
        "collisions": problem.uses("clearance"),
        "oriented": task.target_arrays.oriented,
        "cycle": task.cycle_description,
        "cycle_times": task.cycle.describe_times() if task.cycle and problem.uses("durations") else "",
        "workspace": [r.describe() for r in task.workspace] if problem.uses("workspace", "directions") else [],
        "of_the_way": [q.symbol for q in sorted(of_the_way, key=lambda q: "clearance" not in q.needs)],
        "n_targets": len(task.target_positions),
        "updates": UPDATES,
        "objectives": [_task_specific(objective, task) for objective in problem.objectives],
    }


def _task_specific(objective: Objective, task: Task) -> Objective:
    """Return the objective with a description that mentions the task's tolerances and weights."""
    target_arrays = task.target_arrays
    if objective == unreached_targets and (target_arrays.oriented or np.any(target_arrays.tolerance != REACHED)):
        angle = " or the tool's direction by its angle tolerance" if target_arrays.oriented else ""
        return replace(
            objective, description=f"1 where the tip misses the target by its tolerance{angle} or more, else 0"
        )
    description = objective.description
    if stated_tolerance(task, objective).any():
        description = f"{description}, beyond the stated tolerance, else 0"
    if objective in (position_error, orientation_error) and np.any(target_arrays.weight != 1.0):
        description = f"{description}, times the target's weight"
    return replace(objective, description=description)


def _describe_tool(tool: Tool) -> str:
    """Describe the mass of the tool."""
    if tool.mass == 0.0:
        return "the tip has no mass of its own"
    inertia = f" and moments of inertia of {describe_vector(tool.inertia)} kg m² around it"
    return (
        f"the tool has {tool.mass:g} kg, with its centre of mass at {describe_vector(tool.center)} m from the end of "
        f"the last link in that link's own frame{inertia if any(tool.inertia) else ''}"
    )


def _describe_payload(task: Task) -> str:
    """Describe the payloads; empty if there are none."""
    payloads = task.payloads
    if not payloads.any():
        return ""
    if isinstance(task.payload, Payload):
        return f"At every target the tip carries a rigid payload: {task.payload.describe()}."
    if np.ptp(payloads) == 0.0:
        return f"At every target the tip carries a payload of {payloads[0]:g} kg, a point mass."
    listed = ", ".join(f"{payloads[i]:g}" for i in spread(len(payloads), MAX_TARGETS))
    each = "some of" if len(payloads) > MAX_TARGETS else "each"
    return f"At the targets the tip carries payloads, point masses of [kg], for {each} TARGET in this order: {listed}."


def shown_values(history: History, feedback: Feedback, most: Limits) -> dict[str, Any]:
    """Return the values that show past designs: those drawn from a history, at most so many of them."""
    task, decimals = history.problem.task, feedback.digits.length
    shown = spread(len(task.target_positions), most.targets)
    front = [feedback.front[i] for i in spread(len(feedback.front), most.designs)]
    others = [feedback.others[i] for i in spread(len(feedback.others), most.designs)]
    whole_front = [member.number for member in history.front]
    own = [trial.number for trial in history if trial.source == feedback.name]
    return {
        "targets": points(task.target_positions[shown], decimals),
        "target_requirements": describe_targets([task.targets[i] for i in shown]),
        "target_low": vector(task.target_positions.min(axis=0), decimals),
        "target_high": vector(task.target_positions.max(axis=0), decimals),
        "n_targets_shown": len(shown),
        "front": feedback.records(front, shown),
        "others": feedback.records(others, shown),
        "n_others": feedback.n_others,
        "latest": feedback.records(feedback.latest[-most.designs :], shown),
        "whole_front": design_lines(
            history, [whole_front[i] for i in spread(len(whole_front), most.lines)], feedback.name
        ),
        "own": design_lines(history, own[-most.lines :], feedback.name),
        "n_own": len(own),
    }


def spread(n: int, most: int) -> list[int]:
    """Return at most `most` of the indices 0 … n-1, evenly spread."""
    return sorted({round(i) for i in np.linspace(0, n - 1, min(n, most))})
