"""Notes on what a task holds, what its objectives leave out, and on figures that cannot be drawn."""

import shlex
from collections.abc import Mapping, Set
from pathlib import Path

from rich.console import Console

from armwright.extras import install_command, missing_packages
from armwright.problem.objective import Need
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.spaces.design_space import paper_space
from armwright.tasks.task import Task

# Parts of tasks, and the needs of quantities that use them
PARTS: Mapping[str, Set[Need]] = {"obstacles": {"clearance"}, "workspace": {"workspace", "directions"}}


def can_draw(console: Console, wanted: bool = True) -> bool:
    """Return whether figures are wanted and can be drawn; print what to install if only the latter fails."""
    missing = wanted and missing_packages("figures")
    if missing:
        console.print(f"no figures without {missing[0]}: {install_command('figures')}", soft_wrap=True)
    return wanted and not missing


def unused_parts(problem: Problem) -> list[str]:
    """Return a note for each part of the task that neither an objective nor a constraint uses."""
    return [
        f"no objective or constraint uses the task's {part}; quantities for it: "
        + ", ".join(name for name, quantity in QUANTITIES.items() if needs & {*quantity.needs})
        for part, needs in PARTS.items()
        if getattr(problem.task, part) and not problem.uses(*needs)
    ]


def space_note(problem: Problem) -> str:
    """Return which space the task brings, or an empty string if it is the paper's."""
    name = problem.space.name
    return "" if name == paper_space().name else f"design space: {name}, the task's own; --space names another"


def design_note(problem: Problem, task: str, space: Path | None) -> str:
    """Return that `armwright design` suits a problem better than `optimize`, or an empty string if it does not.

    It does if the kernels compute all objectives and there are constraints, which few of 200 designs satisfy.

    Args:
        problem: The problem.
        task: The task as it was given.
        space: The space file as it was given.
    """
    if problem.evaluator is not None or not problem.constraints:
        return ""
    command = shlex.join(["armwright", "design", task, *([] if space is None else ["--space", str(space)])])
    return f"`{command}` suits this task better: it evaluates thousands of designs in the same time"


def payload_note(task: Task) -> str:
    """Return the payload at the tip [kg], or an empty string without one."""
    payloads = task.payloads
    if not payloads.any():
        return ""
    low, high = payloads.min(), payloads.max()
    return f"payload {low:g} kg" if low == high else f"payloads {low:g} to {high:g} kg"
