"""Constraints: bounds that a design has to keep, as plain sentences such as `torque_utilisation <= 0.8`.

A constraint's value is its violation, divided by the bound's size: satisfied at <= 0.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, cast

from armwright.arrays import Array
from armwright.exceptions import TaskError, did_you_mean
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import OBJECTIVES, RENAMED, TO_BOUND

Relation = Literal["<=", ">="]

SMALLEST_SCALE = 1e-9  # of a bound; one nearer to 0 is no scale for what it bounds
_SENTENCE = re.compile(r"\s*([A-Za-z_]\w*)\s*(<=|>=)\s*(\S+)\s*")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


class Quantity(Protocol):
    """A number per arm that can be bounded; every objective is one."""

    @property
    def name(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def symbol(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def over(self) -> str: ...

    def __call__(self, evaluation: Evaluation) -> Array:
        """Return one value per arm, (N,)."""
        ...


# What a task's constraints may bound. A quantity of which more is better, and which is no objective, belongs here.
QUANTITIES: Mapping[str, Quantity] = {**OBJECTIVES, **{quantity.name: quantity for quantity in TO_BOUND}}


@dataclass(frozen=True)
class Constraint:
    """A bound for a quantity of a design."""

    quantity: Quantity
    relation: Relation
    bound: float

    @property
    def words(self) -> str:
        """The sentence, which is its name: `mass <= 3`."""
        return f"{self.quantity.name} {self.relation} {self.bound:.12g}"

    @property
    def scale(self) -> float:
        """What its value is divided by, so that those of several can be summed: the bound's size, or one unit for 0."""
        return abs(self.bound) if abs(self.bound) > SMALLEST_SCALE else 1.0

    def __call__(self, evaluation: Evaluation) -> Array:
        """Return the (N,) violations of arms, divided by the scale; satisfied at <= 0."""
        excess = self.quantity(evaluation) - self.bound
        return (excess if self.relation == "<=" else -excess) / self.scale

    def measured(self, broken: float) -> float:
        """Return the quantity that has this violation, in its own unit, to 12 digits."""
        excess = self.scale * broken
        return float(f"{self.bound + (excess if self.relation == '<=' else -excess):.12g}")


def read_constraints(sentences: Sequence[str]) -> tuple[Constraint, ...]:
    """Parse the constraints of a task without evaluating them.

    Raises:
        TaskError: a sentence is no constraint, or no design can satisfy all of them.
    """
    constraints = tuple(map(_read, sentences))
    bounds: dict[tuple[str, Relation], Constraint] = {}
    for constraint in constraints:
        name = constraint.quantity.name
        earlier = bounds.setdefault((name, constraint.relation), constraint)
        if earlier is not constraint:
            raise TaskError(
                f'constraints: "{earlier.words}" and "{constraint.words}" bound the same; leave out the weaker one'
            )
        low, high = bounds.get((name, ">=")), bounds.get((name, "<="))
        if low is not None and high is not None and low.bound > high.bound:
            raise TaskError(f'constraints: no design keeps both "{low.words}" and "{high.words}"')
    return constraints


def _read(sentence: str) -> Constraint:
    found = _SENTENCE.fullmatch(sentence)
    if found is None:
        raise TaskError(
            f'constraint "{sentence}": a quantity, <= or >=, and a number without its unit are needed, '
            "such as mass <= 3"
        )
    name, relation, number = found.groups()
    if name not in QUANTITIES:
        raise TaskError(
            f'constraint "{sentence}": unknown quantity "{name}".{did_you_mean(name, QUANTITIES, RENAMED)} '
            f"Quantities: {', '.join(QUANTITIES)}"
        )
    bound = float(number) if _NUMBER.fullmatch(number) else math.nan
    if not math.isfinite(bound):
        raise TaskError(
            f'constraint "{sentence}": "{number}" is not a finite number; {name} is bounded by one in '
            f"{QUANTITIES[name].unit}, such as {name} {relation} 3"
        )
    return Constraint(QUANTITIES[name], cast("Relation", relation), bound)
