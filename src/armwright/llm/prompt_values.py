"""The values of a prompt template: the problem as text, and what is shown of past designs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armwright.kinematics.ik.ik import UPDATES
from armwright.llm.answer_format import SINGLE, module_lists
from armwright.llm.feedback import MAX_PROPOSED, MIN_PROPOSED, Feedback, Record, design_lines, points, vector
from armwright.llm.model_options import PromptOptions
from armwright.problem.ignored_errors import stated_tolerance
from armwright.problem.objective import Objective
from armwright.problem.objectives import (
    CLEARANCE_QUANTITIES,
    ORIENTATION_ERROR,
    PATH_QUANTITIES,
    POSITION_ERROR,
    TIMED_QUANTITIES,
    UNREACHED_TARGETS,
    WORKSPACE_QUANTITIES,
)
from armwright.problem.problem import Problem
from armwright.robot.arm import GRAVITY
from armwright.runs.history import History
from armwright.spaces.custom_parameters import CustomParameter
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
    """How much a prompt shows at most.

    Attributes:
        targets: of the task.
        designs: in detail, of the front, of the others and of the proposer's latest ones.
        lines: designs in one line each, of the front and of the proposer.
        proposed: earlier proposals with expectations and reasons.
    """

    targets: int = MAX_TARGETS
    designs: int = 5
    lines: int = 60
    proposed: int = MAX_PROPOSED

    def fewer(self) -> "Limits":
        """Return the next smaller limits, or these if they are the smallest.

        Targets are the last but one to go: a model that knows all of them needs fewer examples.
        """
        proposed = max(MIN_PROPOSED, 3 * self.proposed // 4)
        if self.designs > 2:
            return replace(self, designs=self.designs - 1, proposed=proposed)
        if self.targets > 4:
            return replace(self, targets=max(4, 3 * self.targets // 4), proposed=proposed)
        return replace(self, designs=1, lines=max(5, 3 * self.lines // 4), proposed=proposed)


# Variables of a template, as `--print-prompt variables` lists them.
VARIABLES = {
    "space": "the design space: min_joints, max_joints, joint_types, joint_range, origin_x, origin_y, origin_z, "
    "link, mass_note, and all other keys of a space file",
    "n_joints": "number of joints as text; D if it is searched",
    "revolute_types": "joint types that rotate",
    "prismatic_types": "joint types that slide",
    "straight": "true if all links form one vertical line in the start posture",
    "extra_groups": "parameters besides base, joints and links: name in capitals, and prefix of the parameters",
    "single": "names of the parameters that are choices of a whole arm",
    "custom_parameters": "parameters that only the evaluator reads: name, per_joint, some (some joints do not have "
    "it), unit, choices, range, integer, log",
    "bar_radius": "radius of the links, as text",
    "n_copies": "number of copies of a design that a build tolerance adds",
    "joint_descriptions": "description of each joint type, by its letter",
    "mount_descriptions": "description of each mount",
    "gravity": "[m/s²], along -z",
    "task": "the task: name, and more",
    "description": "description of the task, on one line",
    "targets": "target points as text; n_targets_shown of n_targets",
    "restricted": "parameters that are fixed or narrower than the space's ranges: name with low and high, or choices",
    "tool": "mass of the tool, as text",
    "payload": "payload of the tip at the targets, as text; empty if there is none",
    "point_masses": "parts that count as point masses, as text",
    "obstacles": "obstacles, each as text",
    "collisions": "true if contact counts in an objective",
    "target_requirements": "requirements of targets besides their points, such as an axis of the tool, a line each",
    "oriented": "true if any target requires an axis or an orientation of the tool",
    "restarts": "additional starts of the inverse kinematics at each target",
    "cycle": "steps of the cycle, as text; empty if the task has none",
    "cycle_times": "durations of the steps, as text; empty if they count in no objective",
    "workspace": "boxes that the tip should cover, each as text; none if they count in no objective",
    "of_the_way": "objectives whose share of a target is the worst of it and of the way to it",
    "n_targets": "number of targets of the task",
    "n_targets_shown": "number of targets that are listed",
    "target_low": "smallest x, y and z of all targets",
    "target_high": "largest x, y and z of all targets",
    "updates": "updates of the inverse kinematics per start",
    "objectives": "objectives, each with symbol, label, unit, description, over (sum, max, min, rms or arm)",
    "constraints": "constraints, each with quantity (as an objective), relation, bound",
    "n_feasible": "number of feasible designs",
    "cases": "variants of the task whose worst case counts, as text; empty if there are none",
    "tolerance": "build tolerance [m] of base and links whose worst case counts; 0 if there is none",
    "reference_point": "of the hypervolume; none if there is none yet",
    "n_finished": "number of evaluated designs",
    "n_front": "number of Pareto-optimal designs",
    "front": "members of the front, by rising first objective: number, origin, joints, links, fine_origin and "
    "fine_links (with more digits), extras, e_each, p_ik, a_ik, unreached, q_ik, tau_ik, limits, load, e_all, violated "
    "(constraints, or none; empty if the task has none); if no design is feasible (n_feasible), those with the "
    "smallest violations",
    "others": "some other designs, with the same fields",
    "n_others": "number of designs that these were drawn from: those off the front, or all (option others)",
    "latest": "the proposer's latest designs, with the same fields",
    "whole_front": "every design of the front in short, by rising first objective: number, source, origin, joints, "
    "links, fine_origin, fine_links, extras, e_all, gained (hypervolume, when it was evaluated), on_front",
    "own": "every earlier design of the proposer, with the same fields; n_own of them",
    "n_own": "number of the proposer's earlier designs",
    "hypervolume": "of the front, as text; empty without a reference point",
    "n_between": "designs that the black box tries between two prompts; none outside a study",
    "n_turns": "prompts that are left, this one included; none outside a study",
    "proposed": "earlier proposals (memory: own): number, origin, joints, links, extras, expected, e_all, violated, "
    "reason",
    "n_proposed": "number of earlier proposals",
    "proposals": "number of designs to propose",
    "expected": "true if expected objectives are requested",
    "hints": "notes of an engineer who watches the search, for this prompt only, each on one line",
    "form": 'of the answer: "schema", "then-schema" (free text, a second call extracts it) or "text" (free text alone)',
}


def common_values(history: History, options: PromptOptions) -> dict[str, Any]:
    """Return the values that do not depend on how much of a history is shown."""
    problem = history.problem
    hypervolume = history.hypervolumes[-1:]
    return {
        **_schedule_values(history, options),
        "hypervolume": f"{hypervolume[0]:.4g}" if len(hypervolume) else "",
        **_space_values(problem.space),
        **_task_values(problem),
        "constraints": problem.constraints,
        "tolerance": problem.tolerance,
        "n_feasible": int(history.feasible.sum()),
        "reference_point": history.reference_point,
        "n_finished": len(history),
        "n_front": len(history.front),
        "proposals": options.proposals,
        "expected": options.expects,
        "form": options.form,
    }


def _schedule_values(history: History, options: PromptOptions) -> dict[str, int | None]:
    """Return how the study goes on around this prompt."""
    method = history.method
    if method is None:
        return {"n_between": None, "n_turns": None}
    block = method.n_step * options.proposals
    left = method.n_trials - max(method.n_init, len(history))
    return {"n_between": (method.n_step - 1) * options.proposals, "n_turns": max(1, -(-left // block))}


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
        "custom_parameters": [_custom_record(space, name, entry) for name, entry in space.custom],
        "bar_radius": _describe_radius(space),
        "n_copies": len(length_columns(space)) * 2,
        "joint_descriptions": JOINT_DESCRIPTIONS,
        "mount_descriptions": MOUNT_DESCRIPTIONS,
        "restricted": [p for p in space.parameters if p.name in dict(space.restrict)],
    }


def _custom_record(space: DesignSpace, name: str, entry: CustomParameter) -> dict[str, Any]:
    """Return a custom parameter as the templates read it."""
    return {
        "name": name,
        "per_joint": entry.per is not None,
        "some": not all(MODULES[letter].is_actuated for letter in space.joint_types),
        "unit": entry.unit,
        "choices": entry.choices,
        "range": entry.range,
        "integer": entry.integer,
        "log": entry.scale == "log",
    }


def _describe_radius(space: DesignSpace) -> str:
    """Describe the radius of the links, as in "a bar of …"."""
    if len(space.tube_names) > 1:
        return f"the outer diameter of {'tube_j' if space.link_section.per_link else 'tube'}"
    return f"radius {space.tube_values('radius')[0]:g} m"


def _task_values(problem: Problem) -> dict[str, Any]:
    task = problem.task
    return {
        "gravity": GRAVITY,
        "task": task,
        "description": one_line(task.description, MAX_DESCRIPTION_LENGTH),
        "tool": _describe_tool(task.tool),
        "payload": _describe_payload(task),
        "point_masses": "actuators and payload" if task.load_shape == POINT_LOAD else "actuators",
        "obstacles": [obstacle.describe() for obstacle in task.obstacles],
        "collisions": problem.uses(*CLEARANCE_QUANTITIES),
        "oriented": task.target_arrays.oriented,
        "restarts": task.restarts,
        "cycle": task.cycle_description,
        "cycle_times": task.cycle.describe_times() if task.cycle and problem.uses(*TIMED_QUANTITIES) else "",
        "workspace": [region.describe() for region in task.workspace] if problem.uses(*WORKSPACE_QUANTITIES) else [],
        "of_the_way": [quantity.symbol for quantity in PATH_QUANTITIES if problem.uses(quantity)],
        "n_targets": len(task.target_positions),
        "updates": UPDATES,
        "objectives": [_task_specific(objective, task) for objective in problem.objectives],
        "cases": task.cases_description,
    }


def _task_specific(objective: Objective, task: Task) -> Objective:
    """Return the objective with a description that mentions the task's tolerances and weights."""
    target_arrays = task.target_arrays
    if objective == UNREACHED_TARGETS and (target_arrays.oriented or np.any(target_arrays.tolerance != REACHED)):
        angle = " or the tool's direction by its angle tolerance" if target_arrays.oriented else ""
        return replace(
            objective, description=f"1 where the tip misses the target by its tolerance{angle} or more, else 0"
        )
    description = objective.description
    if stated_tolerance(task, objective).any():
        description = f"{description}, beyond the stated tolerance, else 0"
    if objective in (POSITION_ERROR, ORIENTATION_ERROR) and np.any(target_arrays.weight != 1.0):
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
    listed, omission = _sample([f"{payload:g}" for payload in payloads])
    each = "some of" if omission else "each"
    return f"At the targets the tip carries payloads, point masses of [kg], for {each} TARGET in this order: {listed}."


def _sample(items: Sequence[str]) -> tuple[str, str]:
    """Join at most MAX_TARGETS of the items; the second text says if some are omitted."""
    shown = spread(len(items), MAX_TARGETS)
    return ", ".join(items[i] for i in shown), "" if len(shown) == len(items) else f" (some of {len(items)})"


def shown_values(
    history: History,
    feedback: Feedback,
    proposed: Sequence[Record],
    most: "Limits",
) -> dict[str, Any]:
    """Return the values that show past designs.

    Args:
        history: the finished trials.
        feedback: the designs drawn from them.
        proposed: records of the proposer's earlier designs.
        most: how much is shown.
    """
    task, decimals = history.problem.task, feedback.digits.length
    shown = spread(len(task.target_positions), most.targets)
    front = [feedback.front[i] for i in spread(len(feedback.front), most.designs)]
    others = [feedback.others[i] for i in spread(len(feedback.others), most.designs)]
    whole_front = [member.number for member in history.front]
    own = [trial.number for trial in history if trial.source == feedback.name]
    return {
        "targets": points(task.target_positions[shown], decimals),
        "target_requirements": describe_targets([task.target_specs[i] for i in shown]),
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
        "proposed": proposed[-most.proposed :],
    }


def spread(n: int, most: int) -> list[int]:
    """Return at most `most` of the indices 0 … n-1, evenly spread."""
    return sorted({round(i) for i in np.linspace(0, n - 1, min(n, most))})
