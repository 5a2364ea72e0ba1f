"""The checks that need no kernels."""

from collections.abc import Iterable

from armwright.exceptions import TaskError
from armwright.problem.checks.base_motor import check_base_motor
from armwright.problem.checks.bounds import check_constraints
from armwright.problem.checks.finding import Finding
from armwright.problem.checks.idle_objectives import check_idle_objectives
from armwright.problem.checks.inside_obstacles import check_obstacles, check_tip_bodies
from armwright.problem.checks.magnitudes import check_magnitudes
from armwright.problem.checks.reach import check_reach
from armwright.problem.checks.requirements import check_requirements
from armwright.problem.checks.strength import check_strength
from armwright.problem.problem import Problem


def check_instantly(problem: Problem) -> list[Finding]:
    """Return what is wrong with a task and its space, the proven faults first.

    Raises SettingsError if a quantity needs actuators, a cycle or a workspace that the problem lacks.
    """
    check_requirements(problem)
    checks = (
        check_reach, check_obstacles, check_tip_bodies, check_base_motor, check_constraints, check_strength,
        check_magnitudes, check_idle_objectives,
    )  # fmt: skip
    findings = [finding for check in checks for finding in check(problem)]
    return sorted(findings, key=lambda finding: not finding.is_proven)


def stop_if_proven(findings: Iterable[Finding]) -> None:
    """Raise a TaskError for findings that are proven; further ones become its notes."""
    proven = [finding for finding in findings if finding.is_proven]
    if not proven:
        return
    error = TaskError(str(proven[0]))
    for finding in proven[1:]:
        error.add_note(f"armwright: {finding}")
    raise error
