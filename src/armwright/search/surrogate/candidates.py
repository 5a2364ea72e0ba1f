"""Designs among which the surrogate chooses: random ones, good ones by the built-in physics, and variations."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.problem.problem import Problem
from armwright.runs.history import found_reference_point
from armwright.search.encoding import DesignEncoding
from armwright.search.front.front_search import FrontSearch
from armwright.search.front.selection import ranks
from armwright.search.front.variation import offspring
from armwright.seeding import derived_seed

RANDOM = 2000  # designs uniform in the space
NEAR_FRONT = 1000  # variations of the front of the built-in objectives, besides at most 1000 of its designs
FRONT_EVALUATIONS = 20_000  # evaluations of the built-in objectives to find their front
SURVEY = 500  # random designs that bound the front of the built-in objectives
CYCLE_SHARE = 0.05  # of all these numbers for tasks with a cycle, whose designs take a hundred times longer


@dataclass(frozen=True)
class Candidates:
    """Sources of candidates for a problem."""

    problem: Problem  # the problem; its evaluator is never called

    def scaled(self, n: int) -> int:
        """Return how many of n designs there is time for."""
        return n if self.problem.task.cycle is None else round(CYCLE_SHARE * n)

    def screened(self, seed: int) -> Array:
        """Return (N, P) random designs, the front of the built-in objectives, and variations of it."""
        encoding = DesignEncoding(self.problem.space.parameters)
        rng = np.random.default_rng(derived_seed(seed, 1))
        front = self._front(derived_seed(seed, 2))
        near = offspring(front, np.zeros(len(front), dtype=np.int64), encoding, self.scaled(NEAR_FRONT), rng)
        random = encoding.random(self.scaled(RANDOM), rng)
        return self.problem.space.normalised(np.vstack([random, front, near]))

    def variations(self, matrix: Array, values: Array, n: int, rng: np.random.Generator) -> Array:
        """Return (n, P) variations of designs (N, P), of which those of a low Pareto rank are more often parents."""
        encoding = DesignEncoding(self.problem.space.parameters)
        order = np.lexsort((values[:, 0], encoding.structures(matrix)))
        worst = np.full(values.shape[1], np.inf)
        return self.problem.space.normalised(offspring(matrix[order], ranks(values[order], worst), encoding, n, rng))

    def _front(self, seed: int) -> Array:
        """Return the front of the built-in objectives, found with a fixed number of evaluations."""
        problem = self._built_in
        space = problem.space
        survey = problem.evaluate(space.matrix(space.sample(self.scaled(SURVEY), seed)))
        bound = found_reference_point(survey.values, survey.violations)

        def evaluate(matrix: Array) -> Array:
            return problem.evaluate(matrix).penalised

        search = FrontSearch(space.parameters, evaluate, bound, seed)
        while search.evaluations < self.scaled(FRONT_EVALUATIONS):
            search.step()
        return search.matrix

    @property
    def _built_in(self) -> Problem:
        """Return the problem with built-in objectives."""
        problem = self.problem
        if problem.evaluator is None:
            return problem
        own = {o.name for o in problem.evaluator.objectives}
        objectives = tuple(o for o in problem.objectives if o.name not in own)
        task = problem.task.model_copy(update={"objectives": None, "reference_point": None, "resolution": ()})
        return Problem(task, problem.space, device=problem.device, objectives=objectives if len(objectives) > 1 else ())
