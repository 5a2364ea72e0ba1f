"""Check a task and a design space: what they mean, what cannot work, and what was hardly meant."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from armwright.cli.notes import unused_parts
from armwright.cli.show_inputs import show_target_table, show_task
from armwright.cli.streams import activity, print_json
from armwright.problem.checks.finding import Finding
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.checks.sampling import check_by_sampling
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.problem.problem import Problem
from armwright.runs.config import record_objectives
from armwright.runs.folder import CONFIG
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Parameter

FIRST_SECONDS = 1.0  # [s] of samples before a search
DEEP_SECONDS, DEEP_SAMPLES = 10.0, 1000  # [s] of a deep check, and the samples that it takes at least


def check_before_search(console: Console, problem: Problem, folder: Path) -> None:
    """Print warnings about a problem; stop at what is proven.

    Constraints are sampled for a second, unless the run folder already holds a run.

    Raises:
        TaskError: It is proven that no design can serve the task.
    """
    findings = check_instantly(problem)
    _show_warnings(console, findings)
    stop_if_proven(findings)
    if not (folder / CONFIG).exists():
        _show_warnings(console, check_by_sampling(problem, FIRST_SECONDS)[0])


def _show_warnings(console: Console, findings: Sequence[Finding]) -> int:
    """Print the findings that are not proven, and return their number."""
    warnings = [finding for finding in findings if not finding.is_proven]
    for finding in warnings:
        console.print(f"warning: {finding}")
    return len(warnings)


def record_check(problem: Problem, findings: Sequence[Finding], n_samples: int) -> dict[str, Any]:
    """Return what a task and a space mean and what is wrong with them, for JSON."""
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
        "samples": n_samples,
        "findings": [{"message": finding.message, "evidence": finding.evidence} for finding in findings],
    }


def show_check(console: Console, problem: Problem) -> None:
    """Print what a task and a space mean."""
    show_task(console, problem.task, problem=problem)
    show_target_table(console, problem)
    minimised = ", ".join(f"{objective.name}{objective.unit_in_brackets}" for objective in problem.objectives)
    console.print(f"  minimised: {minimised}")
    if ignored := describe_ignored_errors(problem):
        console.print(f"  {ignored}")
    space, tie = problem.space, dict(problem.space.tie)
    low, high = space.min_joints, space.max_joints
    console.print(
        f"space {space.name}: {low if low == high else f'{low} to {high}'} joints, reach at most "
        f"{problem.max_reach:.3g} m, {len(free_parameters(space))} free parameters"
    )
    for parameter in space.parameters:
        tied = f", always equal to {tie[parameter.name]}" if parameter.name in tie else ""
        console.print(f"  {parameter.name}: {_describe_range(parameter)}{tied}")
    console.print(f"  {space.mass_note}")
    for note in unused_parts(problem):
        console.print(f"note: {note}")


def run_check(console: Console, problem: Problem, deep: bool, picture: Path | None, json_: bool) -> None:
    """Print what a task and a space mean and what is wrong with them, and draw them into the picture, if there is one.

    Raises:
        TaskError: It is proven that no design can serve the task.
    """
    if not json_:
        show_check(console, problem)
    with activity("evaluating random designs" if deep else "checking"):
        findings, n_samples = check_instantly(problem), 0
        if deep and not any(finding.is_proven for finding in findings):
            sampled, n_samples = check_by_sampling(problem, DEEP_SECONDS, DEEP_SAMPLES)
            findings += sampled
    if picture is not None:
        with activity("drawing the picture"):
            from armwright.pictures.task_figure import write_task_figure

            write_task_figure(problem, picture)
    if json_:
        print_json({**record_check(problem, findings, n_samples), "picture": picture})
        stop_if_proven(findings)
        return
    n_warnings = _show_warnings(console, findings)
    if n_samples:
        console.print(f"random designs evaluated: {n_samples:,}")
    if picture is not None:
        console.print(f"picture: {picture}")
    stop_if_proven(findings)
    console.print(f"task and space are valid; warnings: {n_warnings or 'none'}")


def free_parameters(space: DesignSpace) -> list[Parameter]:
    """Return the parameters that are neither fixed nor tied to another one."""
    tied = dict(space.tie)
    return [parameter for parameter in space.parameters if parameter.name not in tied and not _is_fixed(parameter)]


def _is_fixed(parameter: Parameter) -> bool:
    if isinstance(parameter, CategoricalParameter):
        return len(parameter.choices) == 1
    return parameter.low == parameter.high


def _describe_range(parameter: Parameter) -> str:
    if isinstance(parameter, CategoricalParameter):
        return " | ".join(parameter.choices)
    unit = f" {parameter.unit}" if parameter.unit else ""
    if _is_fixed(parameter):
        return f"{parameter.low:g}{unit}"
    step = f" in steps of {parameter.step:g}" if parameter.step else ""
    if parameter.integer and parameter.step == 1.0:
        step = ", whole numbers"
    scale = ", on a logarithmic scale" if parameter.log else ""
    return f"{parameter.low:g} to {parameter.high:g}{unit}{step}{scale}"
