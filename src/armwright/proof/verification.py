"""Verification of the designs of a front: the solver is chaotic in places, so a search collects flukes.

Each design is evaluated again in float64: as it is, and with its base or one link off by 1 mm (docs/method.md §10).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import masked_objectives
from armwright.problem.outcomes import Outcomes, worst_case
from armwright.problem.problem import Problem
from armwright.proof.perturbations import MOVED, Changed, Survival, load_changes, survival_of, survivals
from armwright.runs.history import History

ALLOWED_SHARE = 0.05  # by which the worst case may exceed a value or the bound of a constraint
ALLOWED_OF_REFERENCE = 0.005  # of the reference point's value; always allowed


@dataclass(frozen=True)
class Verification:
    """Verification of N designs with M objectives."""

    exact: Array  # (N, M) objectives in float64
    moved: Array  # (N, M) the worst in float64 with the base or one link off by 1 mm
    robust: NDArray[np.bool_]  # (N,) True if neither `exact` nor `moved` exceeds the allowed values and violations
    # (N, M) the worst of the search's values, `exact` and `moved`; infinite if a constraint is violated
    worst_case: Array
    survival: tuple[Survival, ...] = ()  # of each, if the task has constraints


def verify_front(history: History) -> Verification | None:
    """Verify the designs of the front; None without a reference point or front."""
    if history.reference_point is None or not history.front:
        return None
    numbers = [member.number for member in history.front]
    values = np.array([member.values for member in history.front])
    entry = history.entry(numbers)
    return verify(history.problem, history.matrix(numbers), values, history.reference_point, entry)


def front_survival(history: History, verification: Verification | None) -> dict[int, Survival]:
    """Return the survival of the designs of the front by number; empty without constraints.

    With a custom evaluator, our perturbations do not say what it would measure.
    """
    problem, front = history.problem, history.front
    if not front or not problem.constraints or problem.evaluator is not None:
        return {}
    numbers = [member.number for member in front]
    found = survival_of(history, numbers) if verification is None else verification.survival
    return dict(zip(numbers, found, strict=True))


def verify(
    problem: Problem, matrix: Array, values: Array, reference_point: Sequence[float], entry: Array | None = None
) -> Verification:
    """Evaluate N designs again, and decide which are robust.

    matrix: (N, P) designs.  values: (N, M) objectives that the search found.  reference_point: (M,) scale of the
    allowed differences.  entry: (N, C, B, D) postures that the search found (`Outcomes`); None to choose them anew.
    """
    problem = replace(problem, device="cpu")
    evaluations = problem.cases(problem.arms(matrix, "float64"), entry)
    exact = worst_case(map(problem.outcomes, evaluations))
    copies: list[Outcomes] = []

    def changes() -> Iterator[Changed]:
        for changed in load_changes(problem, matrix, evaluations):
            copies.extend(map(problem.outcomes, changed.evaluations) if changed.perturbation == MOVED else ())
            yield changed

    survival = survivals(problem, evaluations, changes())
    moved = worst_case(copies)
    allowed = values + np.maximum(ALLOWED_SHARE * values, ALLOWED_OF_REFERENCE * np.asarray(reference_point))
    built = worst_case([exact, moved])
    robust = _within(built, allowed)
    as_built = masked_objectives(np.maximum(values, built.values), built.violations)
    return Verification(exact.values, moved.values, robust, as_built, tuple(survival))


def _within(outcomes: Outcomes, allowed: Array) -> NDArray[np.bool_]:
    """Return (N,) True for outcomes within the (N, M) allowed values and the allowed violations."""
    return np.all(outcomes.values <= allowed, axis=1) & np.all(outcomes.violations <= ALLOWED_SHARE, axis=1)
