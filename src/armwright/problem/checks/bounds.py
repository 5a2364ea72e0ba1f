"""Constraints that no design can satisfy, by intervals of what they bound.

Price, mass, length and number of joints have an interval for each number of modules. Constraints contradict each other
if every number of modules violates at least one.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from armwright.problem.checks.finding import PROVEN, Finding
from armwright.problem.constraints import Constraint
from armwright.problem.objectives import CLEARANCES, FAR, OBJECTIVES
from armwright.problem.problem import Problem
from armwright.robot.arm import Actuator
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import MODULES, JointType
from armwright.spaces.parameters import CategoricalParameter, FloatParameter, Parameter
from armwright.tasks.moments import MAX_MASS

ROUNDING = 1e-5  # relative, of quantities in single precision
COUNTED = ("joints", "targets", "voltages")  # units that their quantity names already


@dataclass(frozen=True)
class Interval:
    """The smallest and the largest value that a quantity can have."""

    low: float
    high: float = math.inf

    def __add__(self, other: "Interval") -> "Interval":
        return Interval(self.low + other.low, self.high + other.high)

    def excludes(self, constraint: Constraint) -> bool:
        """Return whether no value satisfies a constraint."""
        slack = ROUNDING * max(constraint.scale, abs(constraint.bound))
        if constraint.relation == "<=":
            return self.low * (1.0 - ROUNDING) > constraint.bound + slack
        return self.high * (1.0 + ROUNDING) < constraint.bound - slack


NOTHING = Interval(0.0, 0.0)


def check_constraints(problem: Problem) -> Iterator[Finding]:
    """Find constraints that no design satisfies, alone or together."""
    fixed, by_size = _intervals_of_task(problem), intervals_by_modules(problem)
    for constraint in problem.constraints:
        name = constraint.quantity.name
        interval = None if name in by_size[problem.space.max_joints] else fixed.get(name)
        if interval is not None and interval.excludes(constraint):
            yield Finding(_describe(constraint, interval), PROVEN)
    violated = {
        n: [c for c in problem.constraints if c.quantity.name in known and known[c.quantity.name].excludes(c)]
        for n, known in by_size.items()
    }
    if not all(violated.values()):
        return
    always = [c for c in problem.constraints if all(c in broken for broken in violated.values())]
    for constraint in always:
        interval = _hull([known[constraint.quantity.name] for known in by_size.values()])
        yield Finding(f"{_describe(constraint, interval)} in this space; loosen it, or widen the space", PROVEN)
    if not always:
        together = [
            f'"{c.description}"' for c in problem.constraints if any(c in broken for broken in violated.values())
        ]
        why = [
            f"with {n} modules, {_limit(broken[0], by_size[n][broken[0].quantity.name])}"
            for n, broken in violated.items()
        ]
        yield Finding(f"constraints: no design satisfies {' and '.join(together)} together: {'; '.join(why)}", PROVEN)


def intervals_by_modules(problem: Problem) -> dict[int, dict[str, Interval]]:
    """Return the intervals of price [USD], mass [kg], length [m] and joints, for each number of modules."""
    space, actuators = problem.space, {actuator.name: actuator for actuator in problem.space.arm_actuators}
    known = {parameter.name: parameter for parameter in space.parameters}
    totals = {"joints": NOTHING, "length": NOTHING, "price": NOTHING, "mass": NOTHING}
    totals["mass"] = Interval(problem.task.tool.mass, problem.task.tool.mass)
    if space.column is not None:
        heights = cast("FloatParameter", known["origin_z"])
        low, high = space.column.lengths(np.array([heights.low, heights.high])).tolist()
        totals["mass"] += Interval(space.column.mass_per_metre * low, space.column.mass_per_metre * high)
        totals["price"] += Interval(space.column.price_per_metre * low, space.column.price_per_metre * high)
    found: dict[int, dict[str, Interval]] = {}
    for module in range(1, space.max_joints + 1):
        letters = cast("CategoricalParameter", known[f"joint_{module}"]).choices
        link = cast("FloatParameter", known[f"link_{module}"])
        motors = known.get(f"motor_{module}")
        names = motors.choices if isinstance(motors, CategoricalParameter) else tuple(actuators)[:1]
        stroke = known.get(f"stroke_{module}")
        strokes = (
            (stroke.low, stroke.high) if isinstance(stroke, FloatParameter) else (space.min_stroke, space.min_stroke)
        )
        tubes = _tubes(space, known, module)
        choices = [_of_letter(space, cast("JointType", x), [actuators[name] for name in names], strokes, tubes)
                   for x in letters]  # fmt: skip
        own = {name: _hull([choice[name] for choice in choices]) for name in ("joints", "price", "mass")}
        own["length"] = Interval(link.low, link.high)
        own["mass"] += _mass(space, (link.low, link.high), tubes)
        prices = [space.link_section.options[tube].price_per_metre for tube in tubes]
        own["price"] += Interval(min(prices) * link.low, max(prices) * link.high)
        totals = {name: totals[name] + own[name] for name in totals}
        if module >= space.min_joints:
            found[module] = totals
    if not actuators or any(actuator.price is None for actuator in actuators.values()):
        found = {n: {name: i for name, i in one.items() if name != "price"} for n, one in found.items()}
    return found


def _tubes(space: DesignSpace, known: Mapping[str, Parameter], module: int) -> list[int]:
    """Return the indices of the tubes that a module may have, given the parameters of the space."""
    parameter = known.get(f"tube_{module}", known.get("tube"))
    names = parameter.choices if isinstance(parameter, CategoricalParameter) else space.tube_names[:1]
    return [space.tube_names.index(name) for name in names]


def _mass(space: DesignSpace, lengths: tuple[float, float], tubes: list[int]) -> Interval:
    """Return the interval of the mass of links or rails of these lengths [m] and tubes [kg]."""
    low, high = ([float(space.link_mass(length, tube)) for tube in tubes] for length in lengths)
    return Interval(min(low), max(high))


def _of_letter(
    space: DesignSpace, letter: JointType, motors: list[Actuator], strokes: tuple[float, float], tubes: list[int]
) -> dict[str, Interval]:
    """Return the intervals of a module of this type, without its link."""
    module = MODULES[letter]
    n = len(module.joints) if module.is_actuated else 0
    prices = [n * (motor.price or 0.0) for motor in motors] or [0.0]
    masses = [n * (mass + space.bracket_mass) for mass in [motor.mass for motor in motors] or [0.0]]
    rail = _mass(space, strokes, tubes) if module.is_prismatic else NOTHING
    return {
        "joints": Interval(n, n),
        "price": Interval(min(prices), max(prices)),
        "mass": Interval(min(masses), max(masses)) + rail,
    }


def _hull(intervals: list[Interval]) -> Interval:
    return Interval(min(i.low for i in intervals), max(i.high for i in intervals))


def _intervals_of_task(problem: Problem) -> Mapping[str, Interval]:
    """Return the intervals of quantities that do not depend on the space."""
    intervals = dict.fromkeys(OBJECTIVES, Interval(0.0))
    n = float(len(problem.task.targets))
    intervals |= {"unreached_targets": Interval(0.0, n), "jumps": Interval(0.0, n), "manipulability": Interval(0.0)}
    intervals["payload_capacity"] = Interval(0.0, MAX_MASS)
    shares = ("uncovered_fraction", "undexterous_fraction", "dexterous_volume", "anisotropy")
    intervals |= dict.fromkeys(shares, Interval(0.0, 1.0))
    intervals |= {quantity.name: Interval(-math.inf, FAR) for quantity in CLEARANCES}
    voltages = {actuator.voltage for actuator in problem.space.arm_actuators}
    intervals["voltages"] = Interval(0.0, float(len(voltages)))
    plan = problem.scenes[0].plan
    if plan is not None:
        stated = {motion.step: plan.times[motion.step] or 0.0 for motion in plan.motions}
        intervals["cycle_time"] = Interval(sum(stated.values()) + sum(plan.dwells))
    return intervals


def _describe(constraint: Constraint, interval: Interval) -> str:
    """Return that an interval excludes a constraint, and why."""
    return f'constraints: no design satisfies "{constraint.description}": {_limit(constraint, interval)}'


def _limit(constraint: Constraint, interval: Interval) -> str:
    """Return the bound of an interval that excludes a constraint."""
    side, value = ("least", interval.low) if constraint.relation == "<=" else ("most", interval.high)
    unit = "" if constraint.quantity.unit in COUNTED else f" {constraint.quantity.unit}"
    return f"{constraint.quantity.name} is at {side} {value:.4g}{unit}"
