"""A search for the whole Pareto front of a problem whose evaluation takes a matrix of designs.

An elitist search over one pool of designs: each generation varies its members, evaluates the children as one batch,
and keeps those that the hypervolume needs. The pool is small at first, to get near the front, and grows, to resolve it.

The combination of categories (an arm's joint sequence) is a design's structure. A few of the best designs of the most
promising structures stay beside the pool, so that these are not given up because another was good first, and rare
structures have more than their share of children. The pool is sorted by structure and then by the first objective: a
member's neighbours are mostly designs whose parameters mean the same and whose values are near, and their differences
are the steps worth trying.

What a pool has lost it hardly finds again. So a part of the evaluations goes to a side pool, which begins at random,
knows nothing of the main one, and joins it after a while; then the next one begins.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.pareto import hypervolume
from armwright.search.encoding import Columns
from armwright.search.survival import Rows, front, leaders, nearest, survivors, thinned
from armwright.search.variation import offspring
from armwright.seeding import derived_seed
from armwright.spaces.parameters import Parameter

FRONT_LIMITS = (800, 1000)  # designs; a front longer than the second is thinned to the first
CAPACITIES = (100, 1000)  # designs in the pool, at first and at last
EVALUATIONS_A_PLACE = 200  # the pool grows by one design for so many evaluations
SMALLEST_BATCH = 100  # designs a generation; as many as the pool holds once that is more
FIRST_BATCH = 500  # random designs at the start
LEADING = 12  # structures whose best designs stay beside the pool
SIDE_FROM = 25_000  # evaluations
SIDE_SHARE = 0.25  # of the evaluations after these
SIDE_LIFE = 5_000  # evaluations of a side pool until it joins
MARK_SPACING = 1.02  # the hypervolume is noted whenever the evaluations have grown by this factor
STALL_FROM = 20_000  # evaluations; a good beginning looks like a stall at first
STALL_SHARE = 0.5  # of the evaluations, the latest
STALL_GROWTH = 3e-4  # of the hypervolume, relative, over that share


class FrontSearch:
    """The front of `evaluate` over designs as rows, growing with every `step`.

    parameters: of the design space, one for each column of a row.
    evaluate: rows (N, P) to values (N, M), all minimised.
    reference_point: (M,) what lies beyond it in any objective does not count.
    rows, values: known designs to begin with (N, P) and, where they have been evaluated, their values (N, M).

    Nothing depends on time: the same arguments give the same designs, however the search is stopped and restored.
    """

    def __init__(
        self,
        parameters: Sequence[Parameter],
        evaluate: Callable[[Array], Array],
        reference_point: Sequence[float],
        seed: int,
        rows: Array | None = None,
        values: Array | None = None,
    ) -> None:
        self._columns = Columns(parameters)
        self._evaluate = evaluate
        self._reference_point = np.asarray(reference_point, dtype=np.float64)
        self._seed = seed
        self._known = np.empty((0, len(self._columns))) if rows is None else rows
        self._generation = 0
        self._evaluations = 0
        self._rows = np.empty((0, len(self._columns)))
        self._values = np.empty((0, len(self._reference_point)))
        self._marks: list[tuple[int, float]] = []
        self._front_rows, self._front_values = self._rows, self._values
        self._side_rows: Array = self._rows
        self._side_values: Array = self._values
        self._side_evaluations = self._side_age = 0
        if values is not None:
            self._select(self._known, values)
            self._known = self._known[:0]

    @property
    def evaluations(self) -> int:
        """How many designs were evaluated; those that came with their values do not count."""
        return self._evaluations

    @property
    def rows(self) -> Array:
        """(K, P) the designs of the front within the reference box, at most 1000, by rising first objective.

        As long as none lies within: those of the front nearest to it.
        """
        return self._front_rows

    @property
    def values(self) -> Array:
        """(K, M) the values of `rows`."""
        return self._front_values

    @property
    def hypervolume(self) -> float:
        """Of the front, bounded by the reference point."""
        return hypervolume(self._front_values, self._reference_point.tolist())

    @property
    def history(self) -> Array:
        """(K, 2) evaluations and hypervolume, noted whenever the evaluations had grown by 2 %."""
        return np.array(self._marks).reshape(-1, 2)

    @property
    def stalled(self) -> bool:
        """Whether the latest half of the evaluations, 20,000 at least, brought less than 0.03 % of hypervolume."""
        if self._evaluations < STALL_FROM:
            return False
        evaluations, hypervolumes = self.history.T
        before = np.searchsorted(evaluations, (1.0 - STALL_SHARE) * self._evaluations, side="right") - 1
        return bool(before >= 0 and 0.0 < hypervolumes[-1] <= (1.0 + STALL_GROWTH) * hypervolumes[before])

    def ask(self) -> Array:
        """(N, P) the designs to evaluate next; the same until they are told."""
        rng = np.random.default_rng(derived_seed(self._seed, self._generation))
        if self._generation == 0:
            return np.vstack([self._known, self._columns.random(FIRST_BATCH, rng)])
        if not self._is_side_turn:
            return offspring(self._rows, self._columns, max(SMALLEST_BATCH, self._capacity), rng)
        if not len(self._side_rows):
            return self._columns.random(FIRST_BATCH, rng)
        return offspring(self._side_rows, self._columns, SMALLEST_BATCH, rng)

    def tell(self, rows: Array, values: Array) -> None:
        """Takes what `ask` gave, evaluated."""
        side = self._is_side_turn
        self._generation += 1
        self._evaluations += len(rows)
        if side:
            self._side_evaluations += len(rows)
            self._side_age += len(rows)
            self._select_beside(rows, values)
        else:
            self._select(rows, values)
        if not self._marks or self._evaluations >= MARK_SPACING * self._marks[-1][0]:
            self._marks.append((self._evaluations, self.hypervolume))

    def step(self) -> None:
        """One generation: a batch is made, evaluated and selected from."""
        rows = self.ask()
        self.tell(rows, self._evaluate(rows))

    def best(self, most: int) -> Rows:
        """The places in `rows`, rising, of so many designs at most: of those that the hypervolume needs most."""
        if self.hypervolume == 0.0:
            return np.sort(nearest(self._front_values, self._reference_point, most))
        return np.sort(thinned(self._front_values, self._reference_point, most))

    def state(self) -> dict[str, Any]:
        """All that `restore` needs, arrays and numbers; they never change."""
        return {
            "generation": self._generation,
            "evaluations": self._evaluations,
            "rows": self._rows,
            "values": self._values,
            "front_rows": self._front_rows,
            "front_values": self._front_values,
            "side_rows": self._side_rows,
            "side_values": self._side_values,
            "side_evaluations": self._side_evaluations,
            "side_age": self._side_age,
            "history": self.history,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Goes on from a `state` of a search with the same arguments, to the bit."""
        self._generation = int(state["generation"])
        self._evaluations = int(state["evaluations"])
        self._rows, self._values = np.array(state["rows"]), np.array(state["values"])
        self._front_rows, self._front_values = np.array(state["front_rows"]), np.array(state["front_values"])
        self._side_rows, self._side_values = np.array(state["side_rows"]), np.array(state["side_values"])
        self._side_evaluations, self._side_age = int(state["side_evaluations"]), int(state["side_age"])
        self._marks = [(int(evaluations), float(value)) for evaluations, value in state["history"]]

    @property
    def _capacity(self) -> int:
        smallest, largest = CAPACITIES
        return min(max(smallest, self._evaluations // EVALUATIONS_A_PLACE), largest)

    @property
    def _is_side_turn(self) -> bool:
        return self._side_evaluations < SIDE_SHARE * (self._evaluations - SIDE_FROM)

    def _select(self, rows: Array, values: Array) -> None:
        """Takes new designs into the front and the pool, as far as they are good enough."""
        self._keep(rows, values)
        rows, values = np.vstack([self._rows, rows]), np.vstack([self._values, values])
        self._rows, self._values = self._survivors(rows, values, self._capacity)

    def _select_beside(self, rows: Array, values: Array) -> None:
        """The same with the side pool, which joins the other one when it is old enough."""
        self._keep(rows, values)
        rows, values = np.vstack([self._side_rows, rows]), np.vstack([self._side_values, values])
        self._side_rows, self._side_values = self._survivors(rows, values, CAPACITIES[0])
        if self._side_age >= SIDE_LIFE:
            self._select(self._side_rows, self._side_values)
            self._side_rows, self._side_values, self._side_age = rows[:0], values[:0], 0

    def _keep(self, rows: Array, values: Array) -> None:
        """Takes new designs into the front."""
        front_rows, front_values = np.vstack([self._front_rows, rows]), np.vstack([self._front_values, values])
        shortened, longest = FRONT_LIMITS
        kept = front(front_values, self._reference_point)
        if not len(kept):
            kept = nearest(front_values, self._reference_point, shortened)
        elif len(kept) > longest:
            kept = kept[thinned(front_values[kept], self._reference_point, shortened)]
        kept = kept[np.argsort(front_values[kept, 0], kind="stable")]
        self._front_rows, self._front_values = front_rows[kept], front_values[kept]

    def _survivors(self, rows: Array, values: Array, capacity: int) -> tuple[Array, Array]:
        """A pool of these designs, sorted."""
        structures = self._columns.structures(rows)
        best = survivors(values, self._reference_point, capacity)
        leading = leaders(values, structures, self._reference_point, LEADING)
        kept = np.union1d(best, leading)
        kept = kept[np.lexsort((values[kept, 0], structures[kept]))]
        return rows[kept], values[kept]
