"""Describe what a task and a design space mean, and warn of what cannot work."""

import math
from typing import Any

import numpy as np
from rich.console import Console

from armwright.cli.notes import unused_parts
from armwright.cli.show_inputs import show_task
from armwright.cli.streams import format_point
from armwright.problem.problem import Problem
from armwright.runs.config import record_objectives
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Parameter
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.targets import Point


def check_problem(problem: Problem) -> dict[str, Any]:
    """Return what a task and a space mean, for JSON.

    Raises:
        ArmwrightError: Task and space do not go together; found by evaluating one design.
    """
    problem.evaluate(problem.space.sample(1, seed=0))
    space = problem.space
    return {
        "task": problem.task.model_dump(mode="json"),
        "objectives": [record.model_dump() for record in record_objectives(problem.objectives)],
        "constraints": [constraint.description for constraint in problem.constraints],
        "reference_point": problem.reference_point,
        "space": {
            "name": space.name,
            "joints": [space.min_joints, space.max_joints],
            "max_reach": problem.max_reach,
            "free_parameters": len(free_parameters(space)),
            "parameters": {parameter.name: _describe_range(parameter) for parameter in space.parameters},
            "tie": dict(space.tie),
            "masses": space.mass_note,
            "is_toy": space.is_toy,
            "actuators": [record.name for record in space.actuators],
        },
        "unused": unused_parts(problem),
        "warnings": geometry_warnings(problem),
    }


def show_check(console: Console, problem: Problem) -> None:
    """Print what a task and a space mean."""
    record = check_problem(problem)
    show_task(console, problem.task, has_drives=problem.has_drives)
    minimised = ", ".join(f"{objective.name} [{objective.unit}]" for objective in problem.objectives)
    console.print(f"  minimised: {minimised}")
    space = record["space"]
    low, high = space["joints"]
    console.print(
        f"space {space['name']}: {low if low == high else f'{low} to {high}'} joints, reach at most "
        f"{space['max_reach']:.3g} m, {space['free_parameters']} free parameters"
    )
    for name, described in space["parameters"].items():
        tied = f", always equal to {space['tie'][name]}" if name in space["tie"] else ""
        console.print(f"  {name}: {described}{tied}")
    console.print(f"  {space['masses']}")
    for note in record["unused"]:
        console.print(f"note: {note}")
    for warning in record["warnings"]:
        console.print(f"warning: {warning}")
    console.print(f"task and space are valid; warnings: {len(record['warnings']) or 'none'}")


def free_parameters(space: DesignSpace) -> list[Parameter]:
    """Return the parameters that are neither fixed nor tied to another one."""
    tied = dict(space.tie)
    return [parameter for parameter in space.parameters if parameter.name not in tied and not _is_fixed(parameter)]


def geometry_warnings(problem: Problem) -> list[str]:
    """Return a line for each target that no arm can reach, or that lies inside an obstacle."""
    reach = problem.max_reach
    warnings: list[str] = []
    for number, target in enumerate(problem.task.targets, start=1):
        distance = problem.distance_to_bases(target)
        if distance > reach:
            warnings.append(
                f"target {number} {format_point(target)} m is {distance:.3g} m from the nearest allowed base, and the "
                f"longest arm reaches {reach:.3g} m; widen origin_x, origin_y, origin_z or link in the space"
            )
        warnings += [
            f"target {number} {format_point(target)} m is inside an obstacle: {obstacle.describe()}"
            for obstacle in problem.task.obstacles
            if contains(obstacle, target)
        ]
    return warnings


def contains(obstacle: Obstacle, point: Point) -> bool:
    """Return whether a point [m] is inside an obstacle."""
    solid = obstacle.solid
    local = solid.rotation.T @ (np.array(point) - solid.centre)
    radius, half_height = solid.half[0], solid.half[2]
    match solid.shape:
        case "box":
            return bool(np.all(np.abs(local) < solid.half))
        case "sphere":
            return math.hypot(*local) < radius
        case "cylinder":
            return math.hypot(*local[:2]) < radius and abs(local[2]) < half_height
        case "ground":
            return bool(local[2] < 0.0)


def _is_fixed(parameter: Parameter) -> bool:
    if isinstance(parameter, CategoricalParameter):
        return len(parameter.choices) == 1
    return parameter.low == parameter.high


def _describe_range(parameter: Parameter) -> str:
    if isinstance(parameter, CategoricalParameter):
        return " | ".join(parameter.choices)
    if _is_fixed(parameter):
        return f"{parameter.low:g} {parameter.unit}"
    step = f" in steps of {parameter.step:g}" if parameter.step else ""
    return f"{parameter.low:g} to {parameter.high:g} {parameter.unit}{step}"
