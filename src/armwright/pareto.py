"""Pareto fronts, hypervolume and constrained domination of arrays, all objectives minimised.

A constraint is satisfied at a violation <= 0. Deb's rules (Deb et al., A fast and elitist multiobjective genetic
algorithm: NSGA-II, IEEE Trans. Evol. Comput. 6(2), 2002) compare designs: a feasible design dominates an infeasible
one; of two infeasible designs, the one with the smaller total violation; of two feasible ones, by their objectives.
"""

from collections.abc import Sequence

import moocore
import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

PENALTY = 1e100  # of infeasible designs; larger than any objective


def front_mask(values: Array) -> NDArray[np.bool_]:
    """(N,) True where no other row of `values` (N, M) is better or equal in all and better in one.

    Of equal rows the first is kept. Infinite rows, as of infeasible designs (`masked_objectives`), are not on it.

    Examples:
        >>> front_mask([[1.0, 2.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]])
        array([ True,  True, False, False])
    """
    values = np.asarray(values, dtype=np.float64)
    if len(values) == 0:
        return np.zeros(0, dtype=bool)
    return moocore.is_nondominated(values, keep_weakly=False) & np.all(values < np.inf, axis=1)


def front_indices(values: Array) -> list[int]:
    """The rows on the front, by rising first objective."""
    numbers = np.flatnonzero(front_mask(values))
    return numbers[np.argsort(values[numbers, 0], kind="stable")].tolist()


def hypervolume(values: Array, reference_point: Sequence[float]) -> float:
    """The area (volume) dominated by `values` (N, M) and bounded by the reference point.

    Points that are not below the reference point in all objectives count nothing, nor do dominated ones.

    Examples:
        >>> hypervolume([[1.0, 2.0], [2.0, 1.0]], (3.0, 3.0))
        3.0
        >>> hypervolume([[1.0, 2.0], [2.0, 1.0], [2.0, 2.0], [0.0, 3.0]], (3.0, 3.0))
        3.0
    """
    values = np.asarray(values, dtype=np.float64)
    inside = np.all(values < np.asarray(reference_point), axis=1) if len(values) else np.zeros(0, dtype=bool)
    if not inside.any():
        return 0.0
    return float(moocore.hypervolume(values[inside], ref=list(reference_point)))


class FrontTracker:
    """The front of a growing set of points, one point after the other, and its hypervolume."""

    def __init__(self, n_objectives: int, reference_point: Sequence[float] | None) -> None:
        self._front = np.empty((0, n_objectives))
        self._reference_point = reference_point
        self._hypervolume: float | None = None

    @property
    def size(self) -> int:
        """The number of points on the front."""
        return len(self._front)

    @property
    def hypervolume(self) -> float | None:
        """Bounded by the reference point; None as long as there is none."""
        if self._hypervolume is None and self._reference_point is not None:
            self._hypervolume = hypervolume(self._front, self._reference_point)
        return self._hypervolume

    def set_reference_point(self, reference_point: Sequence[float]) -> None:
        """Bounds the hypervolume from now on."""
        self._reference_point, self._hypervolume = reference_point, None

    def add(self, point: Sequence[float]) -> None:
        """One point more; an infinite one, as of an infeasible design, changes nothing."""
        row = np.asarray(point, dtype=np.float64)
        if np.all(row < np.inf) and not np.any(np.all(self._front <= row, axis=1)):
            self._front = np.vstack([self._front[~np.all(row <= self._front, axis=1)], row])
            self._hypervolume = None


def hypervolume_history(values: Array, reference_point: Sequence[float]) -> Array:
    """(N,) the hypervolume of the first 1, 2, …, N rows of `values` (N, M)."""
    tracker = FrontTracker(len(reference_point), reference_point)
    history = np.zeros(len(values))
    for i, row in enumerate(values):
        tracker.add(row)
        history[i] = tracker.hypervolume
    return history


def default_reference_point(values: Array) -> tuple[float, ...]:
    """1.1 times the worst non-dominated values, for a problem that states no reference point."""
    worst = 1.1 * values[front_mask(values)].max(axis=0)
    # A value of 0 would leave no area at all.
    return tuple(np.maximum(worst, 1e-9).tolist())


def knee_index(values: Array, reference_point: Sequence[float]) -> int | None:
    """The row on the front that is farthest below the straight line (plane) between its ends within the reference box.

    None where fewer than three designs of the front lie in the box.

    Examples:
        >>> knee_index(np.array([[0.0, 4.0], [1.0, 1.0], [4.0, 0.0]]), (5.0, 5.0))
        1
    """
    numbers = [n for n in front_indices(values) if np.all(values[n] < np.asarray(reference_point))]
    if len(numbers) < 3:
        return None
    front = values[numbers]
    span = np.ptp(front, axis=0)
    scaled = (front - front.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    return numbers[int(np.argmin(scaled.sum(axis=1)))]


def paper_solution_indices(values: Array, reference_point: Sequence[float]) -> tuple[int, int] | None:
    """Solutions 1 and 2 of the paper's figures: least first, least last objective, within the reference box.

    (Of the paper's objectives: least position error, least torque.)

    None where the front lies wholly outside the box.
    """
    numbers = [n for n in front_indices(values) if np.all(values[n] < np.asarray(reference_point))]
    return (numbers[0], min(numbers, key=lambda n: values[n, -1])) if numbers else None


def feasible_mask(violations: Array) -> NDArray[np.bool_]:
    """Return (N,) True for designs that satisfy all constraints; violations: (N, C)."""
    return np.all(violations <= 0.0, axis=1)


def total_violation(violations: Array) -> Array:
    """Return (N,) the sum of the positive violations (N, C); 0 for feasible designs."""
    return np.maximum(violations, 0.0).sum(axis=1)


def masked_objectives(values: Array, violations: Array) -> Array:
    """Return the objectives (N, M), infinite for infeasible designs, so that these have no part in any front."""
    feasible = feasible_mask(violations)
    return values if feasible.all() else np.where(feasible[:, None], values, np.inf)


def penalised_objectives(values: Array, violations: Array) -> Array:
    """Return (N, M) numbers whose plain domination is constrained domination by Deb's rules.

    Feasible designs keep their values. Infeasible ones are worse than all of these, in the order of their violation.
    """
    penalty = PENALTY * (1.0 + total_violation(violations))
    return np.where(feasible_mask(violations)[:, None], values, penalty[:, None])
