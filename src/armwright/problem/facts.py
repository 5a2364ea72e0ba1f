"""What is known of an arm: each quantity with its value, or the reason why it is not known.

Facts are computed once, when a run ends, and written to the `design.json` of each design of the front. Tables, pages
and sheets read them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import ConfigDict, Field

from armwright.arrays import LARGEST_OBJECTIVE, Array, finite_or_none
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.problem.over_reach import ReachLine
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.spaces.parameters import Design
from armwright.tasks.moments import MAX_MASS
from armwright.text import significant

REACH, PAYLOAD_AT_FULL_REACH, VOLTAGE = "reach", "payload_at_full_reach", "voltage"
# What an engineer asks of an arm, in this order. Views show what is known of it.
ASKED = (
    REACH, PAYLOAD_AT_FULL_REACH, "price", "mass", "payload_capacity", "cycle_time", "worst_error", "deflection",
    "backlash_error", "torque_utilisation", "dynamic_utilisation", "thermal_utilisation", "reserve", "clearance",
    "tilting_moment", "peak_current", "mean_current",
)  # fmt: skip
FARTHEST = "The largest horizontal distance of the tip from the first joint."
_RATINGS = sorted({rating for quantity in QUANTITIES.values() for rating in quantity.ratings})
_SHOWN: Mapping[str, tuple[str, float]] = {  # unit in texts, and how many of it are one of the quantity's unit
    "m": (" mm", 1e3),
    "rad": ("°", math.degrees(1.0)),
    "of allowed": (" % of allowed", 100.0),
    "fraction": (" %", 100.0),
}


@dataclass(frozen=True)
class Fact:
    """A quantity of an arm."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(allow_inf_nan=False)  # of files, which may be a stranger's

    label: str
    unit: str
    explanation: str
    value: Annotated[float, Field(ge=-LARGEST_OBJECTIVE, le=LARGEST_OBJECTIVE)] | None = None
    reason: str = ""  # why the value is None
    digits: int = 3  # significant ones that texts show

    @property
    def text(self) -> str:
        """The value with its unit, or why it is not known."""
        if self.value is None:
            return f"not stated ({self.reason})"
        if self.unit == "kg" and self.value >= MAX_MASS:
            return "any"
        if self.unit == "USD":
            return f"{self.value:,.2f} USD"
        unit, factor = _SHOWN.get(self.unit, (f" {self.unit}", 1.0))
        return f"{significant(factor * self.value, self.digits)}{unit.replace(' x ', ' × ')}".rstrip()


Facts = Mapping[str, Fact]  # by the name of the quantity, as `pick` has it


def fact_of(quantity: Objective, value: float | None, reason: str = "") -> Fact:
    """Return a fact with the value of a quantity, or the reason why it is not known."""
    return Fact(quantity.label, quantity.unit, quantity.explanation, value, reason)


def facts_of(
    evaluation: Evaluation,
    arms: Sequence[Arm],
    known: Callable[[Objective, Evaluation], tuple[Array, str]] = Objective.known,
) -> list[Facts]:
    """Return the facts of each arm of an evaluation; what is not known of one is not known of any.

    `known` returns values, or the reason why they are not known, as `Objective.known` does.
    """
    columns = [(quantity, *known(quantity, evaluation)) for quantity in QUANTITIES.values()]
    return [
        {
            **{q.name: fact_of(q, finite_or_none(v[row]), reason * bool(np.isnan(v[row]))) for q, v, reason in columns},
            "mass": mass_fact(arm),  # which arrays have in the precision of the kernels
            VOLTAGE: _voltage(evaluation, row),
        }
        for row, arm in enumerate(arms)
    ]


def mass_fact(arm: Arm) -> Fact:
    """Return the mass of an arm, exact to the last digit."""
    return fact_of(QUANTITIES["mass"], None if arm.no_mass else arm.mass, arm.no_mass)


def reach_facts(arm: Arm, farthest: ReachLine) -> Facts:
    """Return what an arm reaches and holds there, from the last of its `reach_lines`."""
    held = farthest.payload
    found = "no posture was found there, or the torque of an actuator is not known"
    reason = "" if held is not None else arm.no_mass or found
    return {
        REACH: Fact("Reach", "m", FARTHEST, farthest.distance),
        PAYLOAD_AT_FULL_REACH: Fact(
            "Payload at full reach",
            "kg",
            "The mass that the actuators hold at that distance in every posture found, with the safety factor, and "
            "that their bearings carry.",
            held,
            reason,
        ),
    }


def alike(problem: Problem, designs: Sequence[Design]) -> list[list[int]]:
    """Return the indices of designs in groups of whose actuators the same ratings are known."""
    groups: dict[tuple[bool, ...], list[int]] = {}
    actuation = problem.arms(problem.space.matrix(designs)).actuation
    for row in range(len(designs)):
        key = () if actuation is None else tuple(bool(np.isnan(getattr(actuation, r)[row]).any()) for r in _RATINGS)
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def as_json(facts: Facts) -> dict[str, dict[str, Any]]:
    """Return facts in JSON types; those without a value end with the reason."""
    return {
        name: {key: value for key, value in asdict(fact).items() if key != "reason" or fact.reason}
        for name, fact in facts.items()
    }


def describe_supply(facts: Facts) -> str:
    """Return the currents along the cycle on one line; empty if they are not known."""
    peak, mean, voltage = facts["peak_current"], facts["mean_current"], facts[VOLTAGE]
    if peak.value is None:
        return ""
    at = voltage.reason if voltage.value is None else f"at {voltage.value:g} V"
    return f"{peak.text} peak, {mean.text} mean, {at}"


def _voltage(evaluation: Evaluation, row: int) -> Fact:
    """Return the voltage of the supply of an arm."""
    actuation = evaluation.arms.actuation
    stated = np.zeros(0) if actuation is None else actuation.voltage[row]
    voltages = np.unique(stated[stated > 0.0])
    value = float(voltages[0]) if len(voltages) == 1 else None
    reason = "at several voltages" if len(voltages) > 1 else "" if len(voltages) else "no voltage is known"
    return Fact("Supply voltage", "V", "The voltage of all actuators.", value, reason)
