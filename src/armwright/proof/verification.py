"""Verification of the designs of a front: the solver is chaotic in places, so a search collects flukes.

Each design is evaluated again in float64: as it is, with its base or one link off by 1 mm, and from 20 other start
postures (docs/method.md §10).

Other start postures do not make a design sensitive: the posture that was found exists, and a controller that knows it
can take it. They show whether the inverse kinematics would find an equally good one by itself. Along a cycle there is
nothing to show: its postures are chosen from many starts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.pareto import masked_objectives
from armwright.problem.problem import Outcomes, Problem, worst_case
from armwright.runs.history import History
from armwright.spaces.parameters import Design
from armwright.spaces.tolerance import perturbed

STARTS = 20
START_SPREAD = 0.05  # [rad], [m] for sliding joints, to either side of the straight start
ALLOWED_SHARE = 0.05  # by which the worst case may exceed a value or the bound of a constraint
ALLOWED_OF_REFERENCE = 0.005  # of the reference point's value; always allowed


@dataclass(frozen=True)
class Verification:
    """Verification of N designs with M objectives."""

    exact: Array  # (N, M) objectives in float64
    moved: Array  # (N, M) the worst in float64 with the base or one link off by 1 mm
    started: Array  # (N, M) the worst in float64 from other start postures
    robust: NDArray[np.bool_]  # (N,) True if neither `exact` nor `moved` exceeds the allowed values and violations
    from_any_start: NDArray[np.bool_]  # (N,) True if `started` does not exceed them, either
    # (N, M) the worst of the search's values, `exact` and `moved`; infinite if a constraint is violated
    worst_case: Array


def verify_front(history: History) -> Verification | None:
    """Verify the designs of the front; None without a reference point or front."""
    if history.reference_point is None or not history.front:
        return None
    designs = [member.design for member in history.front]
    values = np.array([member.values for member in history.front])
    return verify(history.problem, designs, values, history.reference_point)


def verify(
    problem: Problem, designs: Sequence[Design], values: Array, reference_point: Sequence[float]
) -> Verification:
    """Evaluate designs again, and decide which are robust.

    Args:
        problem: The problem.
        designs: N designs.
        values: (N, M) objectives that the search found.
        reference_point: (M,) scale of the allowed differences.
    """
    problem = replace(problem, device="cpu")
    matrix = problem.space.matrix(designs)
    arms = problem.arms(matrix, "float64")
    evaluations = list(problem.cases(arms))
    exact = worst_case(map(problem.outcomes, evaluations))
    near = [evaluation.entry_postures for evaluation in evaluations]
    copies = (problem.arms(rows, "float64") for rows in perturbed(problem.space, matrix))
    moved = worst_case(problem.outcomes(each) for copy in copies for each in problem.cases(copy, near))
    started = exact if _visits_all(problem) else _started(problem, arms)
    allowed = values + np.maximum(ALLOWED_SHARE * values, ALLOWED_OF_REFERENCE * np.asarray(reference_point))
    built = worst_case([exact, moved])
    robust = _within(built, allowed)
    as_built = masked_objectives(np.maximum(values, built.values), built.violations)
    from_any_start = robust & _within(started, allowed)
    return Verification(exact.values, moved.values, started.values, robust, from_any_start, as_built)


def _within(outcomes: Outcomes, allowed: Array) -> NDArray[np.bool_]:
    """Return (N,) True for outcomes within the (N, M) allowed values and the allowed violations."""
    return np.all(outcomes.values <= allowed, axis=1) & np.all(outcomes.violations <= ALLOWED_SHARE, axis=1)


def _visits_all(problem: Problem) -> bool:
    """Return whether the cycle stops at all targets, so that no posture depends on a start posture."""
    plans = [scene.plan for scene in problem.scenes]
    return all(plan is not None and len(set(plan.targets)) == len(problem.task.targets) for plan in plans)


def _started(problem: Problem, arms: ArmArrays) -> Outcomes:
    """Return the worst from other start postures."""
    shape = STARTS, len(problem.task.targets), arms.dof
    starts = np.random.default_rng(0).uniform(-START_SPREAD, START_SPREAD, shape)
    return worst_case(problem.outcomes(each) for start in starts for each in problem.cases(arms, start=start))
