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
NOT_EVALUATED = 1e9  # violation of a constraint on what means nothing of an arm, such as torques on a path that jumps
LARGEST_VIOLATION = 1e7  # of a constraint that was evaluated, where others may not be: all of them sum up to less


def front_mask(values: Array) -> NDArray[np.bool_]:
    """Return (N,) True for non-dominated rows of `values` (N, M).

    Of equal rows only the first is kept. Infinite rows, as of infeasible designs (`masked_objectives`), are excluded.

    Examples:
        >>> front_mask([[1.0, 2.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]])
        array([ True,  True, False, False])
    """
    values = np.asarray(values, dtype=np.float64)
    if len(values) == 0:
        return np.zeros(0, dtype=bool)
    return moocore.is_nondominated(values, keep_weakly=False) & np.all(values < np.inf, axis=1)


def front_indices(values: Array) -> list[int]:
    """Return the indices of the non-dominated rows, by increasing first objective."""
    indices = np.flatnonzero(front_mask(values))
    return indices[np.argsort(values[indices, 0], kind="stable")].tolist()


def hypervolume(values: Array, reference_point: Sequence[float]) -> float:
    """Return the volume dominated by `values` (N, M) and bounded by the reference point (M,).

    Points that are not below the reference point in all objectives do not contribute.

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
    """The front and hypervolume of a growing set of points."""

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
        """Volume bounded by the reference point; None without one."""
        if self._hypervolume is None and self._reference_point is not None:
            self._hypervolume = hypervolume(self._front, self._reference_point)
        return self._hypervolume

    def set_reference_point(self, reference_point: Sequence[float]) -> None:
        """Set the point that bounds the hypervolume."""
        self._reference_point, self._hypervolume = reference_point, None

    def add(self, point: Sequence[float]) -> None:
        """Add a point; an infinite one, as of an infeasible design, changes nothing."""
        row = np.asarray(point, dtype=np.float64)
        if np.all(row < np.inf) and not np.any(np.all(self._front <= row, axis=1)):
            self._front = np.vstack([self._front[~np.all(row <= self._front, axis=1)], row])
            self._hypervolume = None


def hypervolume_history(values: Array, reference_point: Sequence[float]) -> Array:
    """Return (N,) the hypervolumes of the first 1, 2, …, N rows of `values` (N, M)."""
    tracker = FrontTracker(len(reference_point), reference_point)
    history = np.zeros(len(values))
    for i, row in enumerate(values):
        tracker.add(row)
        history[i] = tracker.hypervolume
    return history


def default_reference_point(values: Array) -> tuple[float, ...]:
    """Return 1.1 times the worst non-dominated values, for a problem without a reference point."""
    worst = 1.1 * values[front_mask(values)].max(axis=0)
    # A value of 0 would leave no volume at all.
    return tuple(np.maximum(worst, 1e-9).tolist())


def _bounded_front(values: Array, reference_point: Sequence[float]) -> list[int]:
    """Return the indices of the front's points that are below the reference point in all objectives."""
    return [i for i in front_indices(values) if np.all(values[i] < np.asarray(reference_point))]


def knee_index(values: Array, reference_point: Sequence[float]) -> int | None:
    """Return the index of the knee: the point of the front farthest below the plane through its ends.

    Only points within the reference point count; None if fewer than three do.

    Examples:
        >>> knee_index(np.array([[0.0, 4.0], [1.0, 1.0], [4.0, 0.0]]), (5.0, 5.0))
        1
    """
    indices = _bounded_front(values, reference_point)
    if len(indices) < 3:
        return None
    front = values[indices]
    span = np.ptp(front, axis=0)
    scaled = (front - front.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    return indices[int(np.argmin(scaled.sum(axis=1)))]


def paper_solution_indices(values: Array, reference_point: Sequence[float]) -> tuple[int, int] | None:
    """Return the indices of solutions 1 and 2 of the paper's figures: least first and least last objective.

    Only points of the front within the reference point count; None if there are none.
    """
    indices = _bounded_front(values, reference_point)
    return (indices[0], min(indices, key=lambda i: values[i, -1])) if indices else None


def feasible_mask(violations: Array) -> NDArray[np.bool_]:
    """Return (N,) True for designs that satisfy all constraints; violations: (N, C)."""
    return np.all(violations <= 0.0, axis=1)


def total_violation(violations: Array) -> Array:
    """Return (N,) the sum of the positive violations (N, C); 0 for feasible designs.

    It orders designs by the stage that their evaluation reached, then by the violations known.
    """
    return np.maximum(violations, 0.0).sum(axis=1)


def masked_objectives(values: Array, violations: Array) -> Array:
    """Return the objectives (N, M), infinite for infeasible designs, so that these have no part in any front."""
    feasible = feasible_mask(violations)
    return values if feasible.all() else np.where(feasible[:, None], values, np.inf)


def penalised_objectives(values: Array, violations: Array) -> Array:
    """Return (N, M) indices whose plain domination is constrained domination by Deb's rules.

    Feasible designs keep their values. Infeasible ones are worse than all of these, in the order of their violation.
    """
    penalty = PENALTY * (1.0 + total_violation(violations))
    return np.where(feasible_mask(violations)[:, None], values, penalty[:, None])
