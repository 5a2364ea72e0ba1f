"""The designs that a direct search reports: distinct ones, without joints that never move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.problem.problem import Problem
from armwright.problem.reduction import reduced
from armwright.search.front.resolution import distinct, resolution_of
from armwright.search.front.selection import Indices, nearest, thinned


@dataclass(frozen=True)
class ReportedFront:
    """K designs of a front, sorted by the first objective."""

    matrix: Array  # (K, P) designs
    values: Array  # (K, M) objectives
    found: int  # designs that a user can tell apart, of which K were affordable


def reported_front(
    problem: Problem, matrix: Array, values: Array, reference_point: Sequence[float], n: int
) -> ReportedFront:
    """Select at most `n` designs of a front to report, and remove the joints that they never move until none is left.

    A reduced design replaces its parent if it is not worse in any objective. Otherwise both compete. The
    front is (N, P) designs and (N, M) objectives, penalties for infeasible ones; the reference point is (M,).
    """
    kept, n_distinct = _selected(problem, matrix, values, reference_point, n)
    matrix, values = matrix[kept], values[kept]
    known = {row.tobytes() for row in matrix}
    parents = kept_designs = matrix
    while len(candidates := np.array([row for row in reduced(problem, parents) if row.tobytes() not in known])):
        known |= {row.tobytes() for row in candidates}
        # The new designs come first: of designs with equal values, the first one stays on the front.
        values = np.vstack([problem.evaluate(candidates).penalised, values])
        matrix = np.vstack([candidates, matrix])
        on_front = front_mask(values)
        parents = candidates[on_front[: len(candidates)]]
        matrix, values = matrix[on_front], values[on_front]
    if parents is not kept_designs:
        kept, n_distinct = _selected(problem, matrix, values, reference_point, n)
        matrix, values = matrix[kept], values[kept]
    order = np.argsort(values[:, 0], kind="stable")
    matrix, values = matrix[order], values[order]
    return ReportedFront(matrix, values, n_distinct)


def _selected(
    problem: Problem, matrix: Array, values: Array, reference_point: Sequence[float], n: int
) -> tuple[Indices, int]:
    """Return the indices of at most n designs of a front that a user can tell apart, and how many there are."""
    point = np.asarray(reference_point)
    within = np.flatnonzero(np.all(values < point, axis=1))
    if not len(within):
        return nearest(values, point, n), len(values)
    matrix, values = matrix[within], values[within]
    names = [objective.name for objective in problem.objectives]
    designs = problem.space.designs(matrix)
    joints = np.array([sum(module.is_actuated for module in design.modules) for design in designs])
    kept = distinct(values, resolution_of(dict(problem.task.resolution), names, values, reference_point), joints)
    return within[kept[thinned(values[kept], point, n)]], len(kept)
