"""Bounds that the constraints of a task imply for its objectives: every feasible design keeps them."""

from collections.abc import Sequence
from dataclasses import dataclass

from armwright.problem.arm_quantities import (
    orientation_error,
    position_error,
    unreached_targets,
    worst_angle,
    worst_error,
)
from armwright.problem.problem import Problem

TOLERANCES = "tolerances"  # the reason of bounds that all targets must be reached within
MARGIN = 1.1  # of a reference point over a bound, so that designs at the bound count


@dataclass(frozen=True)
class StatedBound:
    """The largest value of an objective that a feasible design can have, and the reason."""

    value: float
    reason: str


def stated_bounds(problem: Problem) -> tuple[StatedBound | None, ...]:
    """Return the tightest bound of each objective above 0; None where the constraints imply none.

    A constraint bounds its own quantity. `unreached_targets <= 0` bounds errors by the tolerances of the targets, and a
    bound of the worst error or angle also bounds the sum of all.
    """
    found: dict[str, StatedBound] = {}

    def bound(name: str, value: float, reason: str) -> None:
        if value > 0.0 and (name not in found or value < found[name].value):
            found[name] = StatedBound(value, reason)

    targets = problem.task.target_arrays
    oriented = targets.n_angular > 0
    for constraint in problem.constraints:
        if constraint.relation == "<=":
            bound(constraint.quantity.name, constraint.bound, constraint.description)
            if constraint.quantity == unreached_targets and constraint.bound < 1.0:
                bound(worst_error.name, targets.tolerance.max(), TOLERANCES)
                bound(position_error.name, float(targets.weight @ targets.tolerance), TOLERANCES)
                if oriented.any():
                    angles = targets.angle_tolerance[oriented]
                    bound(worst_angle.name, angles.max(), TOLERANCES)
                    bound(orientation_error.name, float(targets.weight[oriented] @ angles), TOLERANCES)
    for worst, total, weight in (
        (worst_error, position_error, targets.weight.sum()),
        (worst_angle, orientation_error, targets.weight[oriented].sum()),
    ):
        if worst.name in found:
            bound(total.name, float(weight * found[worst.name].value), found[worst.name].reason)
    return tuple(found.get(objective.name) for objective in problem.objectives)


def with_bounds(reference_point: Sequence[float], bounds: Sequence[StatedBound | None]) -> tuple[float, ...]:
    """Return a reference point with 1.1 times the bound of each objective that has one."""
    return tuple(
        value if bound is None else MARGIN * bound.value for value, bound in zip(reference_point, bounds, strict=True)
    )
