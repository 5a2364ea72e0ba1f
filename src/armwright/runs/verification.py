"""Verify which designs of a front are robust: the solver is chaotic in places, so a search collects flukes.

Each design is computed again in float64: as it is, with its base or one link off by 1 mm, and from 20 other start
postures. docs/method.md §10.

Other starts do not make a design sensitive: the posture that was found exists, and a controller that knows it can take
it. They say whether the inverse kinematics would find one as good by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import masked_objectives
from armwright.problem.evaluation import evaluate_arrays
from armwright.problem.problem import Outcomes, Problem, worst_case
from armwright.runs.history import History
from armwright.spaces.batch_builder import stack_designs
from armwright.spaces.parameters import Design
from armwright.spaces.tolerance import perturbed

STARTS = 20
START_SPREAD = 0.05  # [rad], of sliding joints [m], to either side of the straight start
ALLOWED_SHARE = 0.05  # of a value, by which the worst case may be worse; of a bound, by which it may break it
ALLOWED_OF_REFERENCE = 0.005  # of the reference point's value; allowed at least


@dataclass(frozen=True)
class Verification:
    """N designs, M objectives.

    values: (N, M) as the search has them.
    exact: (N, M) in float64.
    moved: (N, M) the worst in float64 with the base or one link off by 1 mm.
    started: (N, M) the worst in float64 from other start postures.
    robust: (N,) whether neither `exact` nor `moved` is worse than is allowed, or breaks a constraint by more than that.
    from_any_start: (N,) whether `started` is not, either.
    worst_case: (N, M) the worst of what a workshop makes of them; infinite where that breaks a constraint.
    """

    values: Array
    exact: Array
    moved: Array
    started: Array
    robust: NDArray[np.bool_]
    from_any_start: NDArray[np.bool_]
    worst_case: Array


def verify_front(history: History) -> Verification | None:
    """Verify the designs of a history's front; None while it has no reference point."""
    if history.reference_point is None or not history.front:
        return None
    designs = [member.design for member in history.front]
    values = np.array([member.values for member in history.front])
    return verify(history.problem, designs, values, history.reference_point)


def verify(
    problem: Problem, designs: Sequence[Design], values: Array, reference_point: Sequence[float]
) -> Verification:
    """Evaluate designs again, and decide which are robust.

    values: (N, M) what the search found.  reference_point: (M,) sets the scale of what is allowed.
    """
    rows = problem.space.matrix(designs)
    exact = _outcomes(problem, rows)
    off = worst_case([_outcomes(problem, copies) for copies in perturbed(problem.space, rows)])
    dof = stack_designs(problem.space, rows).dof
    starts = np.random.default_rng(0).uniform(-START_SPREAD, START_SPREAD, (STARTS, len(problem.task.targets), dof))
    started = worst_case([_outcomes(problem, rows, start) for start in starts])
    worst = values + np.maximum(ALLOWED_SHARE * values, ALLOWED_OF_REFERENCE * np.asarray(reference_point))
    built = worst_case([exact, off])
    robust = np.all(built.values <= worst, axis=1) & np.all(built.violations <= ALLOWED_SHARE, axis=1)
    holds = np.all(started.values <= worst, axis=1) & np.all(started.violations <= ALLOWED_SHARE, axis=1)
    as_built = masked_objectives(np.maximum(values, built.values), built.violations)
    return Verification(values, exact.values, off.values, started.values, robust, robust & holds, as_built)


def _outcomes(problem: Problem, rows: Array, start: Array | None = None) -> Outcomes:
    """Evaluate designs in float64; start: (T, D) angles [rad], None for the straight start."""
    arrays = stack_designs(problem.space, rows, "float64")
    cases = range(len(problem.task.cases))
    return worst_case([problem.outcomes(evaluate_arrays(arrays, problem.scene(case), "cpu", start)) for case in cases])
