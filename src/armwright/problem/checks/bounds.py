"""Constraints that no design can satisfy, by intervals of what they bound.

Price, mass, length and number of joints have an interval for each number of modules. Constraints contradict each other
if every number of modules violates at least one.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from armwright.arrays import Array
from armwright.problem.arm_quantities import CLEARANCES, FAR, joints, length, mass
from armwright.problem.checks.finding import PROVEN, Finding
from armwright.problem.constraints import Constraint
from armwright.problem.drive_quantities import price
from armwright.problem.estimates import motionless
from armwright.problem.objectives import OBJECTIVES
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter
from armwright.tasks.moments import MAX_MASS
from armwright.tasks.targets import position_targets

ROUNDING = 1e-5  # relative, of quantities in single precision
COUNTED = ("joints", "targets", "voltages")  # units that their quantity names already
SUMS = (price, mass, length, joints)  # to which each module adds its own share, whatever the others are
OF_MODULE = ("joint", "link", "tube", "motor", "stroke")  # parameters that such a share depends on
NOWHERE = Scene(np.zeros((1, 3)), np.zeros(1), position_targets(1))


@dataclass(frozen=True)
class Interval:
    """The smallest and the largest value that a quantity can have."""

    low: float
    high: float = math.inf

    def excludes(self, constraint: Constraint) -> bool:
        """Return whether no value satisfies a constraint."""
        slack = ROUNDING * max(constraint.scale, abs(constraint.bound))
        if constraint.relation == "<=":
            return self.low * (1.0 - ROUNDING) > constraint.bound + slack
        return self.high * (1.0 + ROUNDING) < constraint.bound - slack


def check_constraints(problem: Problem) -> Iterator[Finding]:
    """Find constraints that no design satisfies, alone or together."""
    fixed, by_size = _intervals_of_task(problem), intervals_by_modules(problem)
    for constraint in problem.constraints:
        interval = fixed.get(constraint.quantity.name)
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
        known = [intervals[constraint.quantity.name] for intervals in by_size.values()]
        interval = Interval(min(one.low for one in known), max(one.high for one in known))
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


@lru_cache(maxsize=1)  # several checks of a problem ask
def intervals_by_modules(problem: Problem) -> Mapping[int, Mapping[str, Interval]]:
    """Return the intervals of price [USD], mass [kg], length [m] and joints, for each number of modules.

    A quantity is left out if it is not known of all arms. Ties are ignored, as if tied parameters were free.
    """
    section = problem.space.link_section.model_copy(update={"per_link": True})  # a tube of its own for each link
    space = problem.space.model_copy(update={"link_section": section})

    def values(rows: Array) -> Array:
        arms = stack_designs(space, rows, problem.task.tool, "float64")
        return np.column_stack([quantity.known(motionless(NOWHERE, arms))[0] for quantity in SUMS])

    start = values(combinations(space, ()))[0]
    groups = [("origin_z",), *(tuple(f"{k}_{j}" for k in OF_MODULE) for j in range(1, space.max_joints + 1))]
    shares = [values(combinations(space, names)) - start for names in groups]
    low, high = (np.cumsum([end(share, axis=0) for share in shares], axis=0) for end in (np.min, np.max))
    sizes = combinations(space, ("n_joints",))
    found: dict[int, dict[str, Interval]] = {}
    for design, own in zip(space.designs(sizes), values(sizes), strict=True):
        n = len(design.joints)
        ends = zip(SUMS, (own + low[n]).tolist(), (own + high[n]).tolist(), strict=True)
        found[n] = {quantity.name: Interval(*interval) for quantity, *interval in ends if math.isfinite(interval[0])}
    return found


def combinations(space: DesignSpace, names: Sequence[str]) -> Array:
    """Return (V, P) designs with all choices and both ends of the ranges of these parameters, combined.

    All other parameters have their defaults, and the number of modules is the largest. Names that the space lacks are
    left out.
    """
    values: list[Sequence[float]] = []
    for p in space.parameters:
        ends = range(len(p.choices)) if isinstance(p, CategoricalParameter) else (p.low, p.high)
        default = ends[-1] if p.name == "n_joints" else p.encode(p.default)
        values.append(ends if p.name in names else [default])
    return np.array(list(product(*values)), dtype=np.float64)


def _intervals_of_task(problem: Problem) -> Mapping[str, Interval]:
    """Return the intervals of quantities that do not depend on the space."""
    intervals = dict.fromkeys(OBJECTIVES.keys() - {quantity.name for quantity in SUMS}, Interval(0.0))
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
