"""Choice of a reference point that the task leaves open, during a direct search."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.pareto import feasible_mask, front_mask, hypervolume_history
from armwright.problem.outcomes import Outcomes
from armwright.problem.problem import Problem
from armwright.problem.stated_bounds import MARGIN, stated_bounds, with_bounds
from armwright.runs.history import found_reference_point

N_SAMPLE, N_OF_CYCLE = 10, 200  # random designs that give the provisional point: of a cycle, most are not evaluated
N_FEASIBLE = 1000  # feasible designs that give the final one
RANGE_MARGIN = 0.5  # of the range of their front: later designs reach beyond it


class ReferenceSurvey:
    """The reference point of a direct search.

    Where the constraints of the task imply a bound of an objective, the coordinate is 1.1 times the bound. The others
    come from the front of the first 1000 feasible designs that the search evaluates. Until then (`is_open`) the search
    is bounded by a provisional point, from random designs, which matters little: infeasible designs rank by their
    violation.
    """

    def __init__(self, problem: Problem, seed: int) -> None:
        self._bounds = stated_bounds(problem)
        self.is_open = problem.reference_point is None and None in self._bounds
        self._n_evaluated = self._n_feasible = 0
        self._joined = np.empty((0, 1 + len(problem.objectives)))  # number and values of each design that joined
        self._is_stated = problem.reference_point is not None
        if problem.reference_point is not None:
            self.point = problem.reference_point
        elif self.is_open:
            n = N_SAMPLE if problem.task.cycle is None else N_OF_CYCLE
            random = problem.evaluate(problem.space.sample(n, seed))
            self.point = with_bounds(found_reference_point(random.values, random.violations), self._bounds)
        else:
            self.point = with_bounds([0.0] * len(self._bounds), self._bounds)

    @property
    def _front(self) -> Array:
        """(K, M) values of the front of the feasible designs."""
        values = self._joined[:, 1:]
        return values[front_mask(values)]

    def add(self, outcomes: Outcomes) -> None:
        """Note evaluated designs while the point is open."""
        if not self.is_open:
            return
        feasible = np.flatnonzero(feasible_mask(outcomes.violations))
        numbers = (self._n_evaluated + 1 + feasible).astype(np.float64)
        rows = np.column_stack([numbers, outcomes.values[feasible]])
        front = self._front
        is_new = front_mask(np.vstack([front, rows[:, 1:]]))[len(front) :]
        self._joined = np.vstack([self._joined, rows[is_new]])
        self._n_evaluated += len(outcomes.values)
        self._n_feasible += len(feasible)

    def history(self, point: Sequence[float]) -> list[tuple[int, float]]:
        """Return evaluations and hypervolume, bounded by a point, whenever a design joined the front."""
        volumes = hypervolume_history(self._joined[:, 1:], point)
        return list(zip(self._joined[:, 0].astype(int).tolist(), volumes.tolist(), strict=True))

    def close(self) -> bool:
        """Set the point if enough feasible designs are known; return whether it changed."""
        if not self.is_open or self._n_feasible < N_FEASIBLE or len(self._front) < len(self._bounds):
            return False
        self.point, self.is_open = self._found(), False
        return True

    def best_point(self) -> tuple[float, ...]:
        """Return the point, or the best one so far if it is open."""
        return self._found() if self.is_open and len(self._joined) else self.point

    @property
    def origins(self) -> list[str]:
        """Where each coordinate of `best_point` comes from."""
        if self._is_stated:
            return ["task"] * len(self._bounds)
        others = "random designs" if self.is_open and not len(self._joined) else "feasible designs"
        return [others if bound is None else bound.reason for bound in self._bounds]

    def state(self) -> dict[str, Any]:
        """Return what `restore` needs."""
        return {
            "survey_point": np.array(self.point),
            "survey_open": self.is_open,
            "survey_evaluated": self._n_evaluated,
            "survey_feasible": self._n_feasible,
            "survey_joined": self._joined,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Resume from a `state`."""
        self.point = tuple(state["survey_point"].tolist())
        self.is_open = bool(state["survey_open"])
        self._n_evaluated, self._n_feasible = int(state["survey_evaluated"]), int(state["survey_feasible"])
        self._joined = np.array(state["survey_joined"])

    def _found(self) -> tuple[float, ...]:
        front = self._front
        worst, best = front.max(axis=0), front.min(axis=0)
        point = worst + np.maximum((MARGIN - 1.0) * worst, RANGE_MARGIN * (worst - best))
        return with_bounds(np.maximum(point, 1e-9).tolist(), self._bounds)
