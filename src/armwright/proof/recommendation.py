"""The recommended designs of a front: its knee, its ends, the cheapest and the stiffest, verified in the simulator."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.objectives import deflection, orientation_error, position_error, price, torque
from armwright.proof.perturbations import FACTORS, Survival, evaluate_survival
from armwright.proof.ranking import knee_first
from armwright.proof.simulated_run import Simulator
from armwright.proof.simulation import PASS
from armwright.runs.history import History
from armwright.runs.trial import Count

MAX_TRIED = 10  # designs for each role
BY_DEFAULT = (position_error.name, orientation_error.name, torque.name)  # objectives of tasks that state none
VERIFIED, NOT_SIMULATED = "verified", "not simulated"
BY_EVALUATOR = f"{NOT_SIMULATED}: a custom evaluator measured it"
OUT_OF_TIME = f"{NOT_SIMULATED}: the time is up"


def unlimited() -> float:
    """Return the time that is left if there is no limit [s]."""
    return math.inf


@dataclass(frozen=True)
class Demoted:
    """A design that was chosen first and failed in the simulator."""

    design: Count
    reason: str


@dataclass(frozen=True)
class Recommendation:
    """A recommended design."""

    role: str  # why it is recommended: knee, or least QUANTITY
    design: Count
    # `verified`, `not verified: reason` if each design that was tried failed, or `not simulated`, with the reason if
    # the time was up or a custom evaluator measured the design
    status: str
    demoted: tuple[Demoted, ...] = ()  # the designs tried before
    survival: Survival | None = None  # which perturbations it survives; None without constraints, or if the time was up


def candidates(history: History) -> dict[str, list[int]]:
    """Return the designs of the front by role, the best first.

    The roles are the knee, the least first and last objective, and the least price and deflection if the built-in
    physics knows them for all designs. If it knows both, and the task has a cycle, whose constraints see to errors and
    torques, the least error or holding torque is no role.
    """
    if not history.front:
        return {}
    order = knee_first(history, history.front)  # equal ones follow it
    objectives = [objective.name for objective in history.problem.objectives]
    columns = dict(zip(objectives, np.array([member.values for member in order]).T, strict=True))
    known = columns | _price_and_deflection(history, [member.number for member in order])
    roles = [objectives[0], objectives[-1]]
    if {price.name, deflection.name} <= set(known) and history.problem.task.cycle is not None:
        roles = [name for name in roles if name not in BY_DEFAULT]
    roles += [quantity.name for quantity in (price, deflection) if quantity.name in known]
    return {
        "knee": [member.number for member in order],
        **{f"least {name}": [order[row].number for row in np.argsort(known[name], kind="stable")] for name in roles},
    }


def _price_and_deflection(history: History, numbers: Sequence[int]) -> dict[str, Array]:
    """Return by name the (N,) prices [USD] and deflections [m] that are no objectives and known of all designs."""
    if history.problem.evaluator is not None:
        return {}
    first = history.evaluation(numbers[:1])
    others = [quantity for quantity in (price, deflection) if quantity not in history.problem.objectives]
    asked = [quantity for quantity in others if not quantity.known(first)[1]]
    evaluation = history.evaluation(numbers) if asked else first
    found = {quantity.name: quantity.known(evaluation) for quantity in asked}
    return {name: values for name, (values, reason) in found.items() if not reason}


def recommend(
    history: History, simulator: Simulator | None = None, left: Callable[[], float] = unlimited
) -> list[Recommendation]:
    """Return the recommended designs: simulated, unless a cycle, its durations or the time for it are missing.

    With a custom evaluator neither our simulation nor our perturbations say what it would measure.

    left: Returns the time that is left [s].
    """
    roles = candidates(history)
    if history.problem.evaluator is not None:
        return [Recommendation(role, numbers[0], BY_EVALUATOR) for role, numbers in roles.items()]
    seconds = 0.0  # of a simulation
    try:
        simulator = simulator or Simulator(history)
        chosen = [_verified(role, numbers, simulator, left) for role, numbers in roles.items()]
        seconds = simulator.seconds
    except SettingsError:
        chosen = [Recommendation(role, numbers[0], NOT_SIMULATED) for role, numbers in roles.items()]
    if left() < 0.0:
        return chosen
    verified = {one.design: one.status == VERIFIED for one in chosen}
    if left() < len(FACTORS) * sum(verified.values()) * seconds:
        verified = dict.fromkeys(verified, False)
    survival = evaluate_survival(history, verified)
    return [replace(one, survival=survival.get(one.design)) for one in chosen]


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
