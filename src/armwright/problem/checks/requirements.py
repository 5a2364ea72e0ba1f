"""What the objectives and constraints of a problem require of its task and space, found without evaluating a design."""

from armwright.exceptions import SettingsError
from armwright.kinematics.cycle.cycle_loads import check_durations
from armwright.problem.compliance_quantities import require_sections
from armwright.problem.dexterous_volume import NO_DIRECTIONS
from armwright.problem.drive_quantities import RATINGS, require_ratings
from armwright.problem.evaluation import NO_CYCLE, NO_WORKSPACE
from armwright.problem.objectives import (
    DEXTEROUS_VOLUME,
    MOTION_QUANTITIES,
    QUANTITIES,
    STIFFNESS_QUANTITIES,
    TIMED_QUANTITIES,
    UNCOVERED_FRACTION,
    UNDEXTEROUS_FRACTION,
)
from armwright.problem.problem import Problem

N_SAMPLES = 64  # designs whose motors are looked at


def check_requirements(problem: Problem) -> None:
    """Raise SettingsError if a quantity needs actuators, sections, a cycle or a workspace that the problem lacks."""
    quantities = [*problem.objectives, *(constraint.quantity for constraint in problem.constraints)]
    arms = problem.arms(problem.space.matrix(problem.space.sample(N_SAMPLES, seed=0)))
    actuation = arms.actuation
    plan = problem.scenes[0].plan
    for quantity in quantities:
        if quantity.name in RATINGS and quantity is QUANTITIES[quantity.name]:
            require_ratings(actuation, quantity.name)
        if quantity in STIFFNESS_QUANTITIES:
            require_sections(arms, quantity.name)
        if quantity in MOTION_QUANTITIES and plan is None:
            raise SettingsError(NO_CYCLE)
        if quantity in TIMED_QUANTITIES and plan is not None:
            check_durations(actuation, plan)
        if quantity == UNCOVERED_FRACTION and not problem.task.workspace:
            raise SettingsError(NO_WORKSPACE)
        has_directions = any(region.directions for region in problem.task.workspace)
        if quantity in (DEXTEROUS_VOLUME, UNDEXTEROUS_FRACTION) and not has_directions:
            raise SettingsError(NO_DIRECTIONS)
