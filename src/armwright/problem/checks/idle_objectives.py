"""Objectives that are 0 for every feasible design, so that a search cannot improve them."""

import numpy as np

from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.constraints import Constraint
from armwright.problem.ignored_errors import ANGLES, LINES, POSITIONS, stated_tolerance
from armwright.problem.objective import Objective
from armwright.problem.objectives import UNREACHED_TARGETS
from armwright.problem.problem import Problem


def check_idle_objectives(problem: Problem) -> list[Finding]:
    """Find objectives whose errors the constraints keep below the stated tolerances."""
    findings: list[Finding] = []
    for objective in problem.objectives:
        for constraint in problem.constraints:
            if _is_idle(problem, objective, constraint):
                findings.append(
                    Finding(
                        f'objective {objective.name} is 0 for every feasible design: "{constraint.description}" keeps '
                        f"errors within the stated tolerances, below which they count as 0; try objectives without "
                        f"{objective.name}, or leave out the tolerances",
                        SUSPECTED,
                    )
                )
    return findings


def _is_idle(problem: Problem, objective: Objective, constraint: Constraint) -> bool:
    """Return whether a constraint keeps an error objective at 0."""
    name, task = objective.name, problem.task
    if name in LINES:
        tolerance = stated_tolerance(task, objective)
        return constraint.quantity == objective and constraint.bound <= float(tolerance.min(initial=0.0))
    if name not in (*POSITIONS, *ANGLES) or constraint.quantity != UNREACHED_TARGETS or constraint.bound >= 1.0:
        return False
    relevant = task.target_arrays.n_angular > 0 if name in ANGLES else np.full(len(task.targets), True)
    return bool((stated_tolerance(task, objective)[relevant] > 0.0).all())
