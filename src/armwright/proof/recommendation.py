"""The recommended designs of a front: its knee, its ends, the cheapest and the stiffest, verified in the simulator.

They hold (perturbations.py), if the front has such designs. If these are far from the best ones, the cheapest design
that does is the safe one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.arm_quantities import orientation_error, position_error, torque
from armwright.problem.compliance_quantities import deflection
from armwright.problem.drive_quantities import price
from armwright.problem.facts import fact_of
from armwright.problem.objective import Objective
from armwright.proof.perturbations import Survival, evaluate_survival
from armwright.proof.ranking import knee_first
from armwright.proof.simulated_run import Simulator
from armwright.proof.simulation import PASS
from armwright.runs.history import History
from armwright.runs.trial import Count

MAX_TRIED = 10  # designs for each role
NEAR = 1.1  # times each objective of the best design for a role, up to which one that holds is taken instead
SAFE = "safe"  # role of the cheapest design that holds, if others do not
BY_DEFAULT = (position_error.name, orientation_error.name, torque.name)  # objectives of tasks that state none
VERIFIED, NOT_SIMULATED = "verified", "not simulated"
BY_EVALUATOR = f"{NOT_SIMULATED}: a custom evaluator measured it"
OUT_OF_TIME = f"{NOT_SIMULATED}: the time is up"


def unlimited() -> float:
    """Return the time that is left if there is no limit [s]."""
    return math.inf


@dataclass(frozen=True)
class Demoted:
    """A design that was chosen first and failed in the simulator, or does not hold."""

    design: Count
    reason: str


@dataclass(frozen=True)
class Recommendation:
    """A recommended design."""

    role: str  # why it is recommended: knee, least QUANTITY or safe
    design: Count
    # `verified`, `not verified: reason` if each design that was tried failed, or `not simulated`, with the reason if
    # the time was up or a custom evaluator measured the design
    status: str
    demoted: tuple[Demoted, ...] = ()  # the designs tried before
    survival: Survival | None = None  # whether it holds; None without constraints, or if the time was up
    costs: str = ""  # of the safe design: what it costs more than one that does not hold


def candidates(history: History) -> dict[str, list[int]]:
    """Return the designs of the front by role, the best first.

    The roles are the knee, the least first and last objective, and the least price and deflection if the built-in
    physics knows them for all designs. If it knows both, and the task has a cycle, whose constraints see to errors and
    torques, the least error or holding torque is no role.
    """
    if not history.front:
        return {}
    numbers = [member.number for member in knee_first(history, history.front)]  # equal ones follow it
    objectives = [objective.name for objective in history.problem.objectives]
    known = {quantity.name: values for quantity, values in _known(history, numbers).items()}
    roles = [objectives[0], objectives[-1]]
    if {price.name, deflection.name} <= set(known) and history.problem.task.cycle is not None:
        roles = [name for name in roles if name not in BY_DEFAULT]
    roles += [quantity.name for quantity in (price, deflection) if quantity.name in known]
    ranked = {least(name): np.argsort(known[name], kind="stable") for name in roles}
    return {"knee": numbers, **{role: [numbers[row] for row in rows] for role, rows in ranked.items()}}


def least(name: str) -> str:
    """Return the role of the design with the least of a quantity."""
    return f"least {name.replace('_', ' ')}"


def _known(history: History, numbers: Sequence[int]) -> dict[Objective, Array]:
    """Return the (N,) objectives of designs, and prices [USD] and deflections [m] if known of all of them."""
    columns = dict(zip(history.problem.objectives, history.values[numbers].T, strict=True))
    if history.problem.evaluator is not None:
        return columns
    first = history.evaluation(numbers[:1])
    asked = [one for one in (price, deflection) if one not in columns and not one.known(first)[1]]
    evaluation = history.evaluation(numbers) if asked else first
    found = {quantity: quantity.known(evaluation) for quantity in asked}
    return columns | {quantity: values for quantity, (values, reason) in found.items() if not reason}


def unsafe_roles(history: History, survival: Mapping[int, Survival]) -> dict[str, int]:
    """Return the roles whose designs do not hold, with these; survival: of designs, as far as it is known."""
    first = {role: _preferred(history, numbers, survival)[0] for role, numbers in candidates(history).items()}
    return {role: number for role, number in first.items() if number in survival and not survival[number].holds}


def cheapest_first(history: History, numbers: Sequence[int]) -> list[int]:
    """Return designs by price if it is known, else by the first objective; of equal ones, the nearest to the corner."""
    if not numbers:
        return []
    known, scale = _known(history, numbers), np.array(history.reference_point or 1.0)
    cost = known.get(price, next(iter(known.values())))
    far = np.linalg.norm(history.values[numbers] / scale, axis=1)
    return [numbers[row] for row in np.lexsort((far, np.round(cost, 6)))]


def _preferred(history: History, numbers: Sequence[int], survival: Mapping[int, Survival]) -> list[int]:
    """Return the designs for a role, with those that hold before the others if one of them is near the first one."""
    bound = NEAR * history.values[numbers[0]]
    holding = [number for number in numbers if number in survival and survival[number].holds]
    near = [number for number in holding if np.all(history.values[number] <= bound)]
    return sorted(numbers, key=lambda number: (number not in near, number not in holding)) if near else list(numbers)


def recommend(
    history: History,
    survival: Mapping[int, Survival],
    simulator: Simulator | None = None,
    left: Callable[[], float] = unlimited,
) -> list[Recommendation]:
    """Return the recommended designs: simulated, unless a cycle, its durations or the time for it are missing.

    With a custom evaluator neither our simulation nor our perturbations say what it would measure.

    survival: Of the designs of the front, and of a safe design beside it.  left: Returns the time that is left [s].
    """
    roles = {role: _preferred(history, numbers, survival) for role, numbers in candidates(history).items()}
    failing = unsafe_roles(history, survival)
    holding = cheapest_first(history, [number for number, one in survival.items() if one.holds])
    if failing and holding:
        cost = price.name if least(price.name) in roles else history.problem.objectives[0].name
        on_front = {role: [n for n in roles[role] if n in holding and role != least(cost)] for role in failing}
        roles = {role: numbers for role, numbers in (roles | on_front).items() if numbers} | {SAFE: holding}
    if history.problem.evaluator is not None:
        return [Recommendation(role, numbers[0], BY_EVALUATOR) for role, numbers in roles.items()]
    try:
        simulator = simulator or Simulator(history)
        chosen = [_verified(role, numbers, simulator, left) for role, numbers in roles.items()]
    except SettingsError:
        chosen = [Recommendation(role, numbers[0], NOT_SIMULATED) for role, numbers in roles.items()]
    numbers = list(dict.fromkeys(one.design for one in chosen))
    found = evaluate_survival(history, numbers, survival) if left() >= 0.0 else survival
    chosen = [replace(one, survival=found.get(one.design)) for one in chosen]
    return [_compared(history, one, failing, survival) if one.role == SAFE else one for one in chosen]


def _compared(
    history: History, safe: Recommendation, failing: Mapping[str, int], survival: Mapping[int, Survival]
) -> Recommendation:
    """Return the safe design with the designs that it replaces, and what it costs more than the first of them."""
    replaced = list(dict.fromkeys(failing.values()))
    changes = [
        f"{quantity.label.lower()} {'+' if own >= other else '-'}{fact_of(quantity, abs(float(own - other))).text}"
        for quantity, (own, other) in _known(history, [safe.design, replaced[0]]).items()
        if quantity != deflection
    ]
    demoted = (*safe.demoted, *(Demoted(number, survival[number].verdict) for number in replaced))
    return replace(safe, demoted=demoted, costs=f"compared with #{replaced[0]} (does not hold): {', '.join(changes)}")


def _verified(role: str, numbers: Sequence[int], simulator: Simulator, left: Callable[[], float]) -> Recommendation:
    """Return the first design that passes in the simulator."""
    demoted: list[Demoted] = []
    for number in numbers[:MAX_TRIED]:
        if number not in simulator.members and left() < simulator.seconds:
            return Recommendation(role, number, OUT_OF_TIME, tuple(demoted))
        result = simulator(number).result
        if result.verdict == PASS:
            return Recommendation(role, number, VERIFIED, tuple(demoted))
        demoted.append(Demoted(number, result.reasons[0]))
    first, *others = demoted
    return Recommendation(role, first.design, f"not verified: {first.reason}", tuple(others))
