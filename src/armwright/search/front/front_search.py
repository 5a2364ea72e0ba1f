"""Direct search for the whole Pareto front of a problem that evaluates a matrix of designs at once.

The search is elitist and keeps one pool of designs. Each generation varies its members, evaluates the children as one
batch, and keeps those with the largest hypervolume contributions. The pool starts small, to approach the front quickly,
and grows, to resolve it.

The structure of a design is its joint sequence. Three rules keep structures alive that are not the best at first. Some
of the best designs of each number of joints and of the leading structures stay in the pool. Numbers of joints and
structures with few members have more than their share of children. And the pool is sorted by structure and first
objective: the neighbours of a member then mostly have the same structure and similar values, so that the differences
between them make good steps.

A pool hardly ever recovers a structure it has lost. A part of the evaluations therefore goes to a side pool that starts
at random, evolves on its own and joins the main pool after a while. Then the next one starts. While nothing is found
that counts, such as a feasible design, side pools start earlier and live shorter: the main pool may be stuck.

Random designs would take most of a short search. Its first generation may be cut: the remaining random designs are
added to later generations. Longer searches end lower that way, probably because evolved designs displace newcomers.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.pareto import hypervolume
from armwright.search.encoding import DesignEncoding
from armwright.search.front.selection import Indices, best_of_each, front, leaders, nearest, ranks, survivors, thinned
from armwright.search.front.variation import offspring
from armwright.seeding import derived_seed
from armwright.spaces.parameters import Parameter

FRONT_LIMITS = (800, 1000)  # designs; a front longer than the second is thinned to the first
CAPACITIES = (100, 1000)  # designs in the pool: first and final
EVALUATIONS_PER_MEMBER = 200  # the pool grows by one design per so many evaluations
SMALLEST_BATCH = 100  # designs per generation; later as many as the pool holds
FIRST_BATCH = 500  # random designs at the start
LATE_SHARE = 0.5  # of the smallest generation: random designs that the first one lacks
PER_NUMBER = 20  # designs of each number of joints that stay in the pool, though all may be infeasible
LEADING = 12  # structures whose best designs stay in the pool
SIDE_FROM = 25_000  # evaluations
SIDE_SHARE = 0.25  # of the evaluations after these
SIDE_LIFE = 5_000  # evaluations of a side pool until it joins
LOST_FROM, LOST_SHARE, LOST_LIFE = 2_000, 0.5, 1_500  # the same while no design lies within the reference box
RECORD_SPACING = 1.02  # the hypervolume is recorded whenever the evaluations have grown by this factor
STALL_FROM = 20_000  # evaluations; an early plateau is not a stall
STALL_SHARE = 0.5  # of the evaluations, the latest
STALL_GROWTH = 3e-4  # of the hypervolume, relative, over that share

# Attributes of a search, without the leading underscore, that make up its state.
_COUNTERS = ("generation", "evaluations", "random_left", "side_evaluations", "side_age")
_ARRAYS = ("history", "matrix", "values", "front_matrix", "front_values", "side_matrix", "side_values")
_STATE = (*_COUNTERS, *_ARRAYS, "reference_point")


class FrontSearch:
    """Pareto front of `evaluate` over a design space, improved by every `step`.

    Nothing depends on time: equal arguments give equal designs, even if the search is stopped and restored in between.

    Args:
        parameters: P parameters of the design space.
        evaluate: maps an (N, P) matrix of designs to (N, M) values, all minimised.
        reference_point: (M,) bound of the hypervolume; points beyond it in any objective do not count.
        known: (N, P) designs that the first batch includes.
        vary: makes new designs from a pool, as `variation.offspring` does.
    """

    def __init__(
        self,
        parameters: Sequence[Parameter],
        evaluate: Callable[[Array], Array],
        reference_point: Sequence[float],
        seed: int,
        known: Array | None = None,
        vary: Callable[[Array, Indices, DesignEncoding, int, np.random.Generator], Array] = offspring,
    ) -> None:
        self._encoding = DesignEncoding(parameters)
        self._evaluate = evaluate
        self._vary = vary
        self._random_left = 0
        self._reference_point = np.asarray(reference_point, dtype=np.float64)
        self._seed = seed
        self._known = np.empty((0, len(self._encoding))) if known is None else known
        self._generation = 0
        self._evaluations = 0
        self._matrix = np.empty((0, len(self._encoding)))
        self._values = np.empty((0, len(self._reference_point)))
        self._history = np.empty((0, 2))
        self._front_matrix, self._front_values = self._matrix, self._values
        self._side_matrix: Array = self._matrix
        self._side_values: Array = self._values
        self._side_evaluations = self._side_age = 0

    @property
    def evaluations(self) -> int:
        """Number of designs evaluated."""
        return self._evaluations

    @property
    def matrix(self) -> Array:
        """(K, P) designs of the front within the reference box, at most 1000, sorted by first objective.

        If none lies within, the designs of the front nearest to it.
        """
        return self._front_matrix

    @property
    def values(self) -> Array:
        """(K, M) values of `matrix`."""
        return self._front_values

    @property
    def hypervolume(self) -> float:
        """Hypervolume of the front, bounded by the reference point."""
        return hypervolume(self._front_values, self._reference_point.tolist())

    @property
    def history(self) -> Array:
        """(K, 2) evaluations and hypervolume, recorded whenever the evaluations had grown by 2 %."""
        return self._history

    @property
    def stalled(self) -> bool:
        """True if the latest half of at least 20,000 evaluations added less than 0.03 % of hypervolume."""
        if self._evaluations < STALL_FROM:
            return False
        evaluations, hypervolumes = self.history.T
        before = np.searchsorted(evaluations, (1.0 - STALL_SHARE) * self._evaluations, side="right") - 1
        return bool(before >= 0 and 0.0 < hypervolumes[-1] <= (1.0 + STALL_GROWTH) * hypervolumes[before])

    def ask(self) -> Array:
        """Return the (N, P) designs to evaluate next; the same ones until `tell` is called."""
        rng = np.random.default_rng(derived_seed(self._seed, self._generation))
        if self._generation == 0:
            return np.vstack([self._known, self._encoding.random(FIRST_BATCH, rng)])
        if not self._is_side_generation:
            children = self._offspring(self._matrix, self._values, self._n_children, rng)
            n_random = self._late_random
            return np.vstack([children, self._encoding.random(n_random, rng)]) if n_random else children
        if not len(self._side_matrix):
            return self._encoding.random(FIRST_BATCH, rng)
        return self._offspring(self._side_matrix, self._side_values, SMALLEST_BATCH, rng)

    def tell(self, matrix: Array, values: Array) -> None:
        """Select from the designs that `ask` returned, or the first of them, given their (N, M) values."""
        is_side_generation = self._is_side_generation
        if self._generation == 0:
            self._random_left = FIRST_BATCH - max(0, len(matrix) - len(self._known))
        elif not is_side_generation:
            self._random_left -= max(0, len(matrix) - self._n_children)
        self._generation += 1
        self._evaluations += len(matrix)
        if is_side_generation:
            self._side_evaluations += len(matrix)
            self._side_age += len(matrix)
            self._select_side(matrix, values)
        else:
            self._select(matrix, values)
        if not len(self._history) or self._evaluations >= RECORD_SPACING * self._history[-1, 0]:
            self._history = np.vstack([self._history, (self._evaluations, self.hypervolume)])

    def step(self, limit: int | None = None) -> None:
        """Run one generation, limited to its first designs if a limit is given."""
        matrix = self.ask()[:limit]
        self.tell(matrix, self._evaluate(matrix))

    def move_reference_point(self, reference_point: Sequence[float], history: Iterable[tuple[int, float]] = ()) -> None:
        """Replace the reference point; history: earlier evaluations and hypervolumes, bounded by this point."""
        self._reference_point = np.asarray(reference_point, dtype=np.float64)
        self._update_front(self._matrix, self._values)
        earlier = [(n, volume) for n, volume in history if n < self._evaluations]
        self._history = np.array([*earlier, (self._evaluations, self.hypervolume)])

    def state(self) -> dict[str, Any]:
        """Return the arrays and numbers that `restore` needs; later steps do not change them."""
        return {name: getattr(self, f"_{name}") for name in _STATE}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Resume from the `state` of a search with the same arguments, to the bit."""
        for name in _STATE:
            setattr(self, f"_{name}", int(state[name]) if name in _COUNTERS else np.array(state[name]))

    @property
    def _capacity(self) -> int:
        smallest, largest = CAPACITIES
        return min(max(smallest, self._evaluations // EVALUATIONS_PER_MEMBER), largest)

    @property
    def _late_random(self) -> int:
        """Number of random designs in a generation of children."""
        return min(self._random_left, round(LATE_SHARE * SMALLEST_BATCH))

    @property
    def _n_children(self) -> int:
        return max(SMALLEST_BATCH, self._capacity) - self._late_random

    @property
    def _is_side_generation(self) -> bool:
        start, share = (LOST_FROM, LOST_SHARE) if self._is_lost else (SIDE_FROM, SIDE_SHARE)
        return self._side_evaluations < share * (self._evaluations - start)

    @property
    def _is_lost(self) -> bool:
        """True while no design lies within the reference box."""
        return not np.any(np.all(self._front_values < self._reference_point, axis=1))

    def _offspring(self, matrix: Array, values: Array, n: int, rng: np.random.Generator) -> Array:
        return self._vary(matrix, ranks(values, self._reference_point), self._encoding, n, rng)

    def _select(self, matrix: Array, values: Array) -> None:
        """Update the front and the main pool with new designs."""
        self._update_front(matrix, values)
        matrix, values = np.vstack([self._matrix, matrix]), np.vstack([self._values, values])
        self._matrix, self._values = self._survivors(matrix, values, self._capacity)

    def _select_side(self, matrix: Array, values: Array) -> None:
        """Update the front and the side pool, which joins the main pool when it is old enough."""
        was_lost = self._is_lost
        self._update_front(matrix, values)
        matrix, values = np.vstack([self._side_matrix, matrix]), np.vstack([self._side_values, values])
        self._side_matrix, self._side_values = self._survivors(matrix, values, CAPACITIES[0])
        is_found = was_lost and not self._is_lost
        if is_found or self._side_age >= (LOST_LIFE if was_lost else SIDE_LIFE):
            self._select(self._side_matrix, self._side_values)
            self._side_matrix, self._side_values, self._side_age = matrix[:0], values[:0], 0

    def _update_front(self, matrix: Array, values: Array) -> None:
        matrix, values = np.vstack([self._front_matrix, matrix]), np.vstack([self._front_values, values])
        shortened, longest = FRONT_LIMITS
        kept = front(values, self._reference_point)
        if not len(kept):
            kept = nearest(values, self._reference_point, shortened)
        elif len(kept) > longest:
            kept = kept[thinned(values[kept], self._reference_point, shortened)]
        kept = kept[np.argsort(values[kept, 0], kind="stable")]
        self._front_matrix, self._front_values = matrix[kept], values[kept]

    def _survivors(self, matrix: Array, values: Array, capacity: int) -> tuple[Array, Array]:
        """Return the pool selected from these designs, sorted by structure and first objective."""
        structures = self._encoding.structures(matrix)
        best = survivors(values, self._reference_point, capacity)
        leading = leaders(values, structures, self._reference_point, LEADING)
        kept = np.union1d(best, leading)
        numbers = self._encoding.n_joints(matrix)
        if np.ptp(numbers):
            kept = np.union1d(kept, best_of_each(values, numbers, self._reference_point, PER_NUMBER))
        kept = kept[np.lexsort((values[kept, 0], structures[kept]))]
        return matrix[kept], values[kept]
