"""Which designs of a front are solid: the solver is chaotic in places, so a search collects flukes.

Each design is computed again in float64: as it is, with its base or one link off by 1 mm, and from 20 other start
postures. docs/method.md §10.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.evaluation import Array, evaluate_arrays
from armwright.history import History
from armwright.kinematics.arrays import arrays_of
from armwright.problem import Problem
from armwright.space import Design
from armwright.tolerance import moved

STARTS = 20
START_SPREAD = 0.05  # [rad] to either side of the straight start
ALLOWED_SHARE = 0.02  # of a value, by which the worst case may be worse
ALLOWED_OF_REFERENCE = 0.005  # of the reference point's value; allowed at least


@dataclass(frozen=True)
class Verification:
    """N designs, M objectives.

    values: (N, M) as the search has them.
    exact: (N, M) in float64.
    moved: (N, M) the worst in float64 with the base or one link off by 1 mm.
    started: (N, M) the worst in float64 from other start postures, of which each target has one.
    solid: (N,) whether none of these is worse than is allowed.
    """

    values: Array
    exact: Array
    moved: Array
    started: Array
    solid: NDArray[np.bool_]

    @property
    def worst(self) -> Array:
        """(N, M) the worst of all."""
        return np.max([self.values, self.exact, self.moved, self.started], axis=0)

    @property
    def spread(self) -> Array:
        """(N, M) by how much the worst is worse than the search's value."""
        return self.worst - self.values


def verify_front(history: History) -> Verification | None:
    """The designs of a history's front; None as long as it has no reference point."""
    if history.reference_point is None or not history.front:
        return None
    designs = [member.design for member in history.front]
    values = np.array([member.values for member in history.front])
    return verify(history.problem, designs, values, history.reference_point)


def verify(
    problem: Problem, designs: Sequence[Design], values: Array, reference_point: Sequence[float]
) -> Verification:
    """Computes designs again, and says which are solid.

    values: (N, M) what the search found.  reference_point: (M,) sets the scale of what is allowed.
    """
    rows = problem.space.matrix(designs)
    copies = moved(problem.space, rows)
    n, k = copies.shape[:2]
    exact = _values(problem, rows)
    off = _values(problem, copies.reshape(n * k, -1)).reshape(n, k, -1)
    shape = (STARTS, len(problem.task.targets), problem.space.joints)
    starts = np.random.default_rng(0).uniform(-START_SPREAD, START_SPREAD, shape)
    started = _values(problem, np.repeat(rows, STARTS, axis=0), np.tile(starts, (n, 1, 1))).reshape(n, STARTS, -1)
    allowed = np.maximum(ALLOWED_SHARE * values, ALLOWED_OF_REFERENCE * np.asarray(reference_point))
    found = Verification(values, exact, off.max(axis=1), started.max(axis=1), np.zeros(n, dtype=bool))
    solid = np.all(found.spread <= allowed, axis=1)
    return Verification(found.values, found.exact, found.moved, found.started, solid)


def _values(problem: Problem, rows: Array, start: Array | None = None) -> Array:
    """(N, M) in float64.  start: (N, T, D) angles [rad]; None for the straight start."""
    arrays = arrays_of(problem.space, rows, "float64")
    return problem.values(evaluate_arrays(arrays, problem.task.points, start=start))
