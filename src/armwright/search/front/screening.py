"""Screening of offspring: of many designs, bounds discard some, estimates rank the others, and the best are evaluated.

An estimate follows the cycle roughly, from the postures of the nearest evaluated design with the same joints. A share
of the evaluations goes to designs that the estimates reject, so that no design is out of reach because of them.

The best designs often lie where constraints begin to be violated, and are approached from both sides: some infeasible
designs that would be on the front are parents, too, and a share of the evaluations goes to children like them. (Ray,
Singh, Isaacs and Smith, Infeasibility Driven Evolutionary Algorithm for Constrained Optimization, 2009, keep infeasible
designs for the same reason.)
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import moocore
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from armwright.arrays import Array
from armwright.pareto import feasible_mask, front_mask, total_violation
from armwright.problem.estimates import estimates, lower_bounds
from armwright.problem.outcomes import Outcomes
from armwright.problem.problem import Problem
from armwright.search.encoding import DesignEncoding
from armwright.search.front.selection import Indices
from armwright.search.front.variation import offspring

CANDIDATES = 30  # designs considered for each one to evaluate
REJECTED_SHARE = 0.05  # of the designs to evaluate, at least: drawn from those that the estimates reject
NEAR_SHARE = 0.35  # of the designs to evaluate: ranked with the violation of constraints as one more objective
NEAR_MISSES = 40  # infeasible designs that are parents
REMEMBERED = 2000  # evaluated designs, the latest, whose postures estimates begin with

_ARRAYS = ("matrix", "postures", "feasible", "front", "near_matrix", "near_values")


def pays(problem: Problem) -> bool:
    """Return whether estimates take much less time than evaluations: for tasks with a cycle."""
    return problem.task.cycle is not None


class Screen:
    """Offspring of which the estimates choose; `learn` has to be called with all that is evaluated.

    The problem has a cycle. `reference_point` gives the (M,) values beyond which a design now counts for nothing, and
    `estimator` the `estimates` of designs; by default this process does.
    """

    def __init__(
        self, problem: Problem, reference_point: Callable[[], Sequence[float]],
        estimator: Callable[[Array, Array], Outcomes] | None = None,
    ) -> None:  # fmt: skip
        plan, parameters = problem.scenes[0].plan, problem.space.parameters
        assert plan is not None
        dof = problem.arms(problem.space.matrix(problem.space.sample(1, 0))).dof
        self._problem = problem
        self._estimates = estimator or partial(estimates, problem)
        self._reference_point = reference_point
        self._encoding = DesignEncoding(parameters)
        self._matrix = np.empty((0, len(parameters)))
        self._postures = np.empty((0, len(problem.scenes), len(plan.blocks), dof))
        self._feasible = np.empty(0, dtype=bool)
        self._front = np.empty((0, len(problem.objectives)))
        self._near_matrix: Array = np.empty((0, len(parameters)))
        self._near_values: Array = np.empty((0, len(problem.objectives) + 1))  # the last one is the violation

    def offspring(
        self, pool: Array, ranks: Indices, encoding: DesignEncoding, n: int, rng: np.random.Generator
    ) -> Array:
        """Return an (n, P) matrix of new designs, chosen from many of `variation.offspring`, whose arguments it has."""
        if len(self._front):  # near misses are parents like the best designs
            pool, ranks = np.vstack([pool, self._near_matrix]), np.append(ranks, np.zeros(len(self._near_matrix), int))
            order = np.argsort(encoding.structures(pool), kind="stable")
            pool, ranks = pool[order], ranks[order]
        candidates = offspring(pool, ranks, encoding, CANDIDATES * n, rng)
        hopeless = self._is_hopeless(lower_bounds(self._problem, candidates))
        left, discarded = np.flatnonzero(~hopeless), np.flatnonzero(hopeless)
        best, rejected = self._ranked(candidates[left], n - math.ceil(REJECTED_SHARE * n), rng)
        drawn = rng.permutation(rejected)[: n - len(best)]
        return candidates[np.concatenate([left[best], left[drawn], discarded])[:n]]

    def learn(self, matrix: Array, outcomes: Outcomes) -> None:
        """Remember evaluated designs (N, P) and their outcomes."""
        assert outcomes.entry is not None
        feasible = feasible_mask(outcomes.violations)
        self._matrix = np.vstack([self._matrix, matrix])[-REMEMBERED:]
        self._postures = np.concatenate([self._postures, outcomes.entry])[-REMEMBERED:]
        self._feasible = np.concatenate([self._feasible, feasible])[-REMEMBERED:]
        values = np.vstack([self._front, outcomes.values[feasible]])
        self._front = values[front_mask(values)]
        self._note_near_misses(matrix[~feasible], _relaxed(outcomes)[~feasible])

    def state(self) -> dict[str, Any]:
        """Return the arrays that `restore` needs; later calls do not change them."""
        return {f"screen_{name}": getattr(self, f"_{name}") for name in _ARRAYS}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Resume from the `state` of a screen of the same problem, to the bit."""
        for name in _ARRAYS:
            setattr(self, f"_{name}", np.array(state[f"screen_{name}"]))

    def _note_near_misses(self, matrix: Array, values: Array) -> None:
        """Keep the designs (N, P) with the least violation of those that would enlarge the front without constraints.

        Their values (N, M + 1) end with the violation; none is dominated by another one in all of them.
        """
        matrix, values = np.vstack([self._near_matrix, matrix]), np.vstack([self._near_values, values])
        objectives = values[:, :-1]
        dominated = np.all(self._front <= objectives[:, None], axis=2).any(axis=1)
        useful = np.flatnonzero(~dominated & np.all(objectives < np.asarray(self._reference_point()), axis=1))
        useful = useful[front_mask(values[useful])]
        kept = useful[np.argsort(values[useful, -1], kind="stable")[:NEAR_MISSES]]
        self._near_matrix, self._near_values = matrix[kept], values[kept]

    def _is_hopeless(self, bounds: Outcomes) -> NDArray[np.bool_]:
        """Return (N,) True for designs that are proven to be infeasible, or not to enlarge the front."""
        infeasible = np.any(bounds.violations > 0.0, axis=1)
        if not len(self._front):  # then designs beyond the reference point may be the nearest to it
            return infeasible
        dominated = np.all(self._front <= bounds.values[:, None], axis=2).any(axis=1)
        return infeasible | dominated | np.any(bounds.values >= np.asarray(self._reference_point()), axis=1)

    def _ranked(self, matrix: Array, n: int, rng: np.random.Generator) -> tuple[Indices, Indices]:
        """Return the indices of the n best designs by their estimates, and of the others.

        They are ranked by Pareto rank among each other and the front, and in random order within a rank. A share of
        them is ranked without constraints, but with the violation as one more objective, which comes first within a
        rank.
        """
        if not len(matrix):
            return np.arange(0), np.arange(0)
        found = self._estimates(matrix, self._postures_near(matrix))
        order = np.lexsort((rng.random(len(matrix)), _ranks_behind(self._front, found.penalised)))
        if not len(self._front):
            return order[:n], order[n:]
        n_near = round(NEAR_SHARE * n)
        best, others = order[: n - n_near], order[n - n_near :]
        relaxed = _relaxed(found)[others]
        front = np.column_stack([self._front, np.zeros(len(self._front))])
        others = others[np.lexsort((relaxed[:, -1], _ranks_behind(front, relaxed)))]
        return np.concatenate([best, others[:n_near]]), others[n_near:]

    def _postures_near(self, matrix: Array) -> Array:
        """Return (N, C, B, D) postures of the nearest remembered designs with the same joints, feasible ones if any.

        Without any, they are those of a straight arm.
        """
        near = np.zeros((len(matrix), *self._postures.shape[1:]))
        own, known = self._encoding.units(matrix), self._encoding.units(self._matrix)
        structures, known_structures = self._encoding.structures(matrix), self._encoding.structures(self._matrix)
        for structure in np.unique(structures):
            rows = np.flatnonzero(structures == structure)
            same = known_structures == structure
            same = np.flatnonzero(same & self._feasible if np.any(same & self._feasible) else same)
            if len(same):
                near[rows] = self._postures[same[KDTree(known[same]).query(own[rows])[1]]]
        return near


def _relaxed(outcomes: Outcomes) -> Array:
    """Return (N, M + 1) objectives of designs, whether feasible or not, and their total violation."""
    return np.column_stack([outcomes.values, total_violation(outcomes.violations)])


def _ranks_behind(front: Array, values: Array) -> Indices:
    """Return the (N,) Pareto ranks of `values` (N, K) among each other and a front (F, K)."""
    return moocore.pareto_rank(np.vstack([front, values]))[len(front) :]
