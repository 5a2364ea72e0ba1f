"""The recommended designs of a front: its knee and its two ends, each verified in the simulator.

For each it is stated whether its verdict holds if assumed values of its actuators are halved or doubled.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from armwright.exceptions import MissingExtraError, SettingsError
from armwright.runs.assumed_changes import FACTORS, AssumedVerdict, vary_assumed
from armwright.runs.history import History
from armwright.runs.ranking import knee_first
from armwright.runs.simulated_run import Simulator
from armwright.runs.simulation import PASS

MAX_TRIED = 10  # designs for each role
VERIFIED, NOT_SIMULATED = "verified", "not simulated"
OUT_OF_TIME = f"{NOT_SIMULATED}: the time is up"


@dataclass(frozen=True)
class Demoted:
    """A design that was chosen first and failed in the simulator."""

    design: int
    reason: str


@dataclass(frozen=True)
class Recommendation:
    """A recommended design.

    Attributes:
        role: Why it is recommended: knee, or least OBJECTIVE.
        design: Its number.
        status: `verified`, `not verified: reason` if each design that was tried failed, or `not simulated`, with the
            reason if the time was up.
        demoted: The designs tried before.
        assumed: Whether this holds with assumed values halved and doubled; None without assumed values.
    """

    role: str
    design: int
    status: str
    demoted: tuple[Demoted, ...] = ()
    assumed: AssumedVerdict | None = None


def candidates(history: History) -> dict[str, list[int]]:
    """Return the designs of the front by role, the best first."""
    if not history.front:
        return {}
    roles = {"knee": [member.number for member in knee_first(history, history.front)]}
    objectives = history.problem.objectives
    for index in (0, len(objectives) - 1):
        by_value = sorted(history.front, key=lambda member: member.values[index])
        roles[f"least {objectives[index].name}"] = [member.number for member in by_value]
    return roles


def recommend(
    history: History, simulator: Simulator | None = None, has_time: Callable[[int], bool] = lambda _: True
) -> list[Recommendation]:
    """Return the recommended designs: simulated, unless MuJoCo is missing or a duration of the cycle is not known.

    Args:
        history: The trials.
        simulator: Keeps what it simulates; None for a new one.
        has_time: Returns whether there is time for a number of simulations.
    """
    try:
        simulator = simulator or Simulator(history)
        chosen = [_verified(role, numbers, simulator, has_time) for role, numbers in candidates(history).items()]
    except (MissingExtraError, SettingsError):
        chosen = [Recommendation(role, numbers[0], NOT_SIMULATED) for role, numbers in candidates(history).items()]
    changed = {one.design for one in chosen if one.status == VERIFIED}
    if not has_time(len(FACTORS) * len(changed)):
        changed = set[int]()
    verified = {one.design: one.design in changed for one in chosen}
    assumed = vary_assumed(history, verified)
    return [replace(one, assumed=assumed.get(one.design)) for one in chosen]


def _verified(
    role: str, numbers: Sequence[int], simulator: Simulator, has_time: Callable[[int], bool]
) -> Recommendation:
    demoted: list[Demoted] = []
    for number in numbers[:MAX_TRIED]:
        if not has_time(1) and number not in simulator.members:
            return Recommendation(role, number, OUT_OF_TIME, tuple(demoted))
        result = simulator(number).result
        if result.verdict == PASS:
            return Recommendation(role, number, VERIFIED, tuple(demoted))
        demoted.append(Demoted(number, result.reasons[0]))
    first, *others = demoted
    return Recommendation(role, first.design, f"not verified: {first.reason}", tuple(others))
