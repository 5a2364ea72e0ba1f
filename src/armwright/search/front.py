"""A search for the whole Pareto front of a problem whose evaluation takes a matrix of designs.

An elitist search over one pool of designs: each generation varies its members, evaluates the children as one batch,
and keeps those that the hypervolume needs. The pool is sorted by structure (the combination of categories, an arm's
joint sequence) and then by the first objective, so that a member's neighbours are designs whose parameters mean the
same and whose values are near: their differences are the steps worth trying.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from armwright.pareto import front_mask, hypervolume
from armwright.search.columns import Array, Columns
from armwright.search.survival import survivors
from armwright.search.variation import offspring
from armwright.seeding import derived_seed
from armwright.space import Parameter

CAPACITY = 300  # designs in the pool
BATCH = 400  # designs a generation
FIRST_BATCH = 2000  # random designs at the start
MARK_SPACING = 1.02  # the hypervolume is noted whenever the evaluations have grown by this factor
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
        if values is not None:
            self._select(self._known, values)
            self._known = self._known[:0]

    @property
    def evaluations(self) -> int:
        """How many designs were evaluated; those that came with their values do not count."""
        return self._evaluations

    @property
    def rows(self) -> Array:
        """(K, P) the designs of the front within the reference box, by rising first objective."""
        return self._rows[self._front()]

    @property
    def values(self) -> Array:
        """(K, M) the values of `rows`."""
        return self._values[self._front()]

    @property
    def hypervolume(self) -> float:
        """Of the front, bounded by the reference point."""
        return hypervolume(self._values, self._reference_point.tolist())

    @property
    def history(self) -> Array:
        """(K, 2) evaluations and hypervolume, noted whenever the evaluations had grown by 2 %."""
        return np.array(self._marks).reshape(-1, 2)

    @property
    def stalled(self) -> bool:
        """Whether the latest half of the evaluations brought less than 0.03 % of hypervolume."""
        evaluations, hypervolumes = self.history.T
        before = np.searchsorted(evaluations, (1.0 - STALL_SHARE) * self._evaluations, side="right") - 1
        return bool(before >= 0 and 0.0 < hypervolumes[-1] <= (1.0 + STALL_GROWTH) * hypervolumes[before])

    def ask(self) -> Array:
        """(N, P) the designs to evaluate next; the same until they are told."""
        rng = np.random.default_rng(derived_seed(self._seed, self._generation))
        if self._generation == 0:
            return np.vstack([self._known, self._columns.random(FIRST_BATCH, rng)])
        return offspring(self._rows, self._columns, BATCH, rng)

    def tell(self, rows: Array, values: Array) -> None:
        """Takes what `ask` gave, evaluated."""
        self._select(np.vstack([self._rows, rows]), np.vstack([self._values, values]))
        self._generation += 1
        self._evaluations += len(rows)
        if not self._marks or self._evaluations >= MARK_SPACING * self._marks[-1][0]:
            self._marks.append((self._evaluations, self.hypervolume))

    def step(self) -> None:
        """One generation: a batch is made, evaluated and selected from."""
        rows = self.ask()
        self.tell(rows, self._evaluate(rows))

    def state(self) -> dict[str, Any]:
        """All that `restore` needs, arrays and numbers."""
        return {
            "generation": self._generation,
            "evaluations": self._evaluations,
            "rows": self._rows,
            "values": self._values,
            "history": self.history,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Goes on from a `state` of a search with the same arguments, to the bit."""
        self._generation = int(state["generation"])
        self._evaluations = int(state["evaluations"])
        self._rows = np.array(state["rows"], dtype=np.float64)
        self._values = np.array(state["values"], dtype=np.float64)
        self._marks = [(int(evaluations), float(value)) for evaluations, value in state["history"]]

    def _select(self, rows: Array, values: Array) -> None:
        kept = survivors(values, self._reference_point, CAPACITY)
        kept = kept[np.lexsort((values[kept, 0], self._columns.structures(rows[kept])))]
        self._rows, self._values = rows[kept], values[kept]

    def _front(self) -> np.ndarray:
        """The rows of the pool that are on the front and within the reference box, by rising first objective."""
        inside = np.all(self._values < self._reference_point, axis=1)
        front = np.flatnonzero(front_mask(self._values) & inside)
        return front[np.argsort(self._values[front, 0], kind="stable")]
