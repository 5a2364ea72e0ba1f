"""What the texts of a task and a space mean, and what is wrong with them, for the page."""

from collections.abc import Callable
from typing import Any

from armwright.editor.edited_files import EditedFiles, Texts
from armwright.exceptions import ArmwrightError, SpaceError, TaskError
from armwright.problem.checks.finding import Finding
from armwright.problem.checks.instant import check_instantly
from armwright.problem.checks.reach import base_box
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.drawn_task import drawn_task
from armwright.tasks.task import Task
from armwright.yaml_documents import load_document, parse_document


def assess(texts: Texts, files: EditedFiles) -> dict[str, Any]:
    """Return what the texts of the edited files mean; it needs no kernels."""
    names = str(files.task), str(files.space)
    faults: list[ArmwrightError] = []

    def attempt(make: Callable[[], Any]) -> Any:
        try:
            return make()
        except ArmwrightError as fault:
            faults.append(fault)
            return None

    contents = [
        attempt(lambda: load_document(texts.task, TaskError, names[0])),
        attempt(lambda: load_document(texts.space, SpaceError, names[1])),
    ]
    faults.clear()  # they come again
    task: Task | None = attempt(lambda: parse_document(texts.task, Task, TaskError, files.task))
    space: DesignSpace | None = attempt(lambda: parse_document(texts.space, DesignSpace, SpaceError, names[1]))
    problem: Problem | None = None
    if task is not None and space is not None:
        problem = attempt(lambda: Problem(task, space))
    findings: list[Finding] = []
    if problem is not None:
        findings = attempt(lambda: check_instantly(problem)) or []
    return {
        "task": contents[0],  # as read, valid or not; None if it is not YAML
        "space": contents[1],  # likewise
        # With one of these, no search can start
        "errors": [*map(str, faults), *(str(finding) for finding in findings if finding.is_proven)],
        "findings": [finding for finding in findings if not finding.is_proven],  # what is suspicious
        "scene": None if task is None else _scene(task, problem),
        "meaning": {} if problem is None else _meaning(problem),  # in words
    }


def _scene(task: Task, problem: Problem | None) -> dict[str, Any]:
    """Return what is drawn, positions in [m]; the bases are those that the space allows."""
    bases = None if problem is None else [corner.tolist() for corner in base_box(problem.space)]
    return drawn_task(task) | {"names": task.target_names, "bases": bases}


def _meaning(problem: Problem) -> dict[str, str]:
    task, space = problem.task, problem.space
    low, high = space.min_joints, space.max_joints
    constraints = ", ".join(constraint.description for constraint in problem.constraints)
    return {
        "cycle": task.cycle_description or "none",
        "minimised": ", ".join(objective.name for objective in problem.objectives),
        "constraints, stated and implied": constraints or "none",
        "joints": f"{low}" if low == high else f"{low} to {high}",
        "reach of the longest arm": f"{problem.max_reach:.3g} m",
    }
