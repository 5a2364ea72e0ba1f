"""pymoo's NSGA-II on our problems, as benchmarks compare with it.

It works on the same columns, with its default operators; a joint type is the whole part of a real number. Designs are
evaluated in batches by the same kernels, and everything that it ever found counts, not only its last population.
"""

import time

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem as PymooProblem
from pymoo.core.termination import Termination
from pymoo.optimize import minimize

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.problem.problem import Problem
from armwright.spaces.parameters import FloatParameter


class Nsga2:
    """One run of it.

    rows, values: the front of all designs that it evaluated.
    course: (evaluations, seconds, front's values) after each generation; the keeping of that front takes no time here.
    own_seconds: without those in the kernels.
    """

    def __init__(
        self, problem: Problem, seed: int, population: int, evaluations: float = np.inf, seconds: float = np.inf
    ) -> None:
        self._problem = problem
        self._categorical = [not isinstance(p, FloatParameter) for p in problem.space.parameters]
        self._most_evaluations, self._most_seconds = evaluations, seconds
        self._kernels = self._keeping = 0.0
        self._started = time.perf_counter()
        self.evaluations = 0
        self.rows = np.empty((0, len(self._categorical)))
        self.values = np.empty((0, len(problem.objectives)))
        self.course: list[tuple[int, float, Array]] = []
        # A copy of the termination would watch a copy of this run, which never ends.
        minimize(_Columns(self), NSGA2(pop_size=population), _Over(self), copy_termination=False, seed=seed)
        self.own_seconds = self._seconds - self._kernels

    @property
    def is_over(self) -> bool:
        return self.evaluations >= self._most_evaluations or self._seconds >= self._most_seconds

    @property
    def _seconds(self) -> float:
        return time.perf_counter() - self._started - self._keeping

    def evaluate(self, x: Array) -> Array:
        rows = np.where(self._categorical, np.floor(x), x)
        started = time.perf_counter()
        values = self._problem.evaluate(rows).penalised
        done = time.perf_counter()
        self._kernels += done - started
        self.evaluations += len(rows)
        everything, worth = np.vstack([self.rows, rows]), np.vstack([self.values, values])
        kept = front_mask(worth)
        self.rows, self.values = everything[kept], worth[kept]
        self._keeping += time.perf_counter() - done
        self.course.append((self.evaluations, self._seconds, self.values))
        return values

    @property
    def ranges(self) -> Array:
        """(P, 2) the limits of each column."""
        return np.array(
            [
                (p.low, p.high) if isinstance(p, FloatParameter) else (0.0, len(p.choices) - 1e-9)
                for p in self._problem.space.parameters
            ]
        )


class _Columns(PymooProblem):
    def __init__(self, run: Nsga2) -> None:
        low, high = run.ranges.T
        super().__init__(n_var=len(low), n_obj=run.values.shape[1], xl=low, xu=high)
        self._run = run

    def _evaluate(self, x: Array, out: dict[str, Array], *args: object, **kwargs: object) -> None:
        out["F"] = self._run.evaluate(x)


class _Over(Termination):
    def __init__(self, run: Nsga2) -> None:
        super().__init__()
        self._run = run

    def _update(self, algorithm: object) -> float:
        return 1.0 if self._run.is_over else 0.0
