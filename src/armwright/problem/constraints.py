"""Constraints: bounds on quantities of a design, such as `torque_utilisation <= 0.8`.

A constraint's value is its violation, divided by the bound's size: satisfied at <= 0.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

from armwright.arrays import LARGEST_OBJECTIVE, Array
from armwright.exceptions import TaskError, did_you_mean
from armwright.pareto import NOT_EVALUATED
from armwright.problem.arm_quantities import CLEARANCES
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.tasks.task import Task
from armwright.units import NUMBER

Relation = Literal["<=", ">="]

DRIVE_QUANTITIES = (
    "dynamic_utilisation", "speed_utilisation", "thermal_utilisation", "voltages", "bearing_utilisation",
)  # fmt: skip
MIN_SCALE = 1e-9  # bounds nearer to 0 count as 0
_CONSTRAINT = re.compile(r"\s*([A-Za-z_]\w*)\s*(<=|>=)\s*(\S+)\s*")
_NUMBER = re.compile(NUMBER)


@dataclass(frozen=True)
class Constraint:
    """A bound for a quantity of a design."""

    quantity: Objective
    relation: Relation
    bound: float

    @property
    def description(self) -> str:
        """Its text, which is also its name: `mass <= 3`."""
        return f"{self.quantity.name} {self.relation} {self.bound:.12g}"

    @property
    def scale(self) -> float:
        """The size of the bound, or 1 for 0: the unit in which violations of several constraints can be summed."""
        return abs(self.bound) if abs(self.bound) > MIN_SCALE else 1.0

    def __call__(self, evaluation: Evaluation) -> Array:
        """Return the (N,) violations of arms, divided by the scale; satisfied at <= 0."""
        return self.violation(self.quantity(evaluation))

    def violation(self, values: Array) -> Array:
        """Return the violations of the quantity's values, divided by the scale; satisfied at <= 0."""
        excess = values - self.bound
        return (excess if self.relation == "<=" else -excess) / self.scale

    def measured(self, violation: float) -> float | None:
        """Return the quantity that has this violation, in its own unit, to 12 digits; None if it was not evaluated."""
        if violation >= NOT_EVALUATED:
            return None
        excess = self.scale * violation
        return float(f"{self.bound + (excess if self.relation == '<=' else -excess):.12g}")


def describe_violated(constraints: Sequence[Constraint], violations: Sequence[float]) -> list[str]:
    """Return the violated constraints with what a design has, the largest violation first, not evaluated ones last."""
    pairs = [pair for pair in zip(constraints, violations, strict=True) if pair[1] > 0.0]
    pairs.sort(key=lambda pair: -pair[1] if pair[1] < NOT_EVALUATED else 0.0)
    texts = [(c, f"{c.measured(v):.4g} {c.quantity.unit}" if v < NOT_EVALUATED else "not evaluated") for c, v in pairs]
    return [f"{constraint.description} ({text})" for constraint, text in texts]


def read_constraints(texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Parse constraints without evaluating them; TaskError if a text is none, or no design can satisfy all of them."""
    constraints = tuple(map(_read, texts))
    bounds: dict[tuple[str, Relation], Constraint] = {}
    for constraint in constraints:
        name, text = constraint.quantity.name, constraint.description
        if (name, constraint.relation) in bounds:
            other = bounds[name, constraint.relation].description
            raise TaskError(f'constraints: "{other}" and "{text}" bound the same quantity; leave out the weaker one')
        bounds[name, constraint.relation] = constraint
        low, high = bounds.get((name, ">=")), bounds.get((name, "<="))
        if low is not None and high is not None and low.bound > high.bound:
            raise TaskError(f'constraints: no design satisfies both "{low.description}" and "{high.description}"')
    return constraints


def implied_constraints(task: Task, has_actuators: bool, has_bodies: bool) -> tuple[str, ...]:
    """Return the constraints that a cycle and solid bodies imply, except for quantities that the task bounds itself.

    `has_actuators`: torques and speeds of the joints are limited. `has_bodies`: motors or a column are solid bodies.
    """
    implied: dict[str, float] = {}
    if task.cycle is not None:
        tolerance = task.cycle.tolerance
        implied = {"unreached_targets": 0.0, "path_error": tolerance.largest_distance}
        implied |= {"path_angle": tolerance.largest_angle} if task.target_arrays.oriented else {}
        implied |= {"jumps": 0.0, "collision": 0.0}
        implied |= dict.fromkeys(DRIVE_QUANTITIES, 1.0) if has_actuators else {}
    implied |= {"collision": 0.0} if has_bodies else {}
    own = {constraint.quantity.name for constraint in read_constraints(task.constraints)}
    own |= {"collision"} if own & {quantity.name for quantity in CLEARANCES} else set()
    return tuple(f"{name} <= {bound:.12g}" for name, bound in implied.items() if name not in own)


def _read(text: str) -> Constraint:
    match = _CONSTRAINT.fullmatch(text)
    if match is None:
        raise TaskError(f'constraint "{text}": expected a quantity, <= or >=, and a number without unit; try mass <= 3')
    name, relation, number = match.groups()
    if name not in QUANTITIES:
        raise TaskError(
            f'constraint "{text}": unknown quantity "{name}".{did_you_mean(name, QUANTITIES)} '
            f"Quantities: {', '.join(QUANTITIES)}"
        )
    bound = float(number) if _NUMBER.fullmatch(number) else math.nan
    if not abs(bound) <= LARGEST_OBJECTIVE:
        unit = QUANTITIES[name].unit
        raise TaskError(
            f'constraint "{text}": expected a finite number [{unit}], at most ±{LARGEST_OBJECTIVE:g}, got "{number}"; '
            f"try {name} {relation} 3"
        )
    return Constraint(QUANTITIES[name], cast("Relation", relation), bound)
