"""Refinement: the real parameters of designs, each tuned by a small CMA-ES of its own, all side by side.

Hansen, The CMA Evolution Strategy: A Tutorial, 2016 (arXiv:1604.00772), with its default constants. Categories stay as
they are. A design is replaced only by one that is better in every objective.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.search.encoding import Columns
from armwright.spaces.parameters import Parameter

POPULATION = 12  # samples a design and generation
FIRST_STEP = 0.05  # of a parameter's range
LONGEST_STEP = 0.3


@dataclass(frozen=True)
class Refined:
    """N designs and what they became.

    rows, values: (N, P) and (N, M); unchanged where nothing better was found.
    improved: (N,) whether something was.
    evaluations: how many were spent in all.
    """

    rows: Array
    values: Array
    improved: np.ndarray
    evaluations: int


def refine(
    parameters: Sequence[Parameter],
    evaluate: Callable[[Array], Array],
    rows: Array,
    values: Array,
    scale: Sequence[float],
    budget: int,
    seed: int,
) -> Refined:
    """Designs that are better than `rows` in all objectives, by the same amount of each one's scale.

    rows, values: (N, P) designs and (N, M) their values, all minimised.
    scale: (M,) what counts as much in one objective as in another, such as the reference point.
    budget: evaluations for each design.
    """
    columns = Columns(parameters)
    if not len(columns.real):
        return Refined(rows, values, np.zeros(len(rows), dtype=bool), 0)
    best_rows, best_values = rows.copy(), values.copy()
    best = np.zeros(len(rows))  # how much worse than the given design, in the objective that lost most
    strategy = _Strategies(columns.units(rows), np.random.default_rng(seed))
    generations = budget // POPULATION
    every = np.arange(len(rows))
    for _ in range(generations):
        units = strategy.ask()  # (N, K, R)
        samples = np.repeat(rows[:, None], POPULATION, axis=1)
        samples[..., columns.real] = columns.from_units(units)
        found = evaluate(samples.reshape(-1, rows.shape[1])).reshape(len(rows), POPULATION, -1)
        loss = np.max((found - values[:, None]) / np.asarray(scale), axis=-1)  # (N, K)
        first = loss.argmin(axis=1)
        better = loss[every, first] < best
        best[better] = loss[every, first][better]
        best_rows[better] = samples[every, first][better]
        best_values[better] = found[every, first][better]
        strategy.tell(units, loss)
    return Refined(best_rows, best_values, best < 0.0, generations * POPULATION * len(rows))


class _Strategies:
    """N strategies in R dimensions, on the unit cube."""

    def __init__(self, means: Array, rng: np.random.Generator) -> None:
        n, dims = means.shape
        self._rng = rng
        self._mean, self._sigma = means.copy(), np.full(n, FIRST_STEP)
        self._covariance = np.tile(np.eye(dims), (n, 1, 1))
        self._path, self._sigma_path = np.zeros((2, n, dims))
        self._generation = 0
        half = POPULATION // 2
        weights = math.log(half + 0.5) - np.log(np.arange(1, half + 1))
        self._weights = weights / weights.sum()
        mass = 1.0 / np.sum(self._weights**2)  # variance-effective selection mass
        self._mass = mass
        self._c_path = (4 + mass / dims) / (dims + 4 + 2 * mass / dims)
        self._c_sigma = (mass + 2) / (dims + mass + 5)
        self._c_one = 2 / ((dims + 1.3) ** 2 + mass)
        self._c_mu = min(1 - self._c_one, 2 * (mass - 2 + 1 / mass) / ((dims + 2) ** 2 + mass))
        self._damping = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (dims + 1)) - 1) + self._c_sigma
        self._expected = math.sqrt(dims) * (1 - 1 / (4 * dims) + 1 / (21 * dims**2))  # length of a normal vector

    def ask(self) -> Array:
        """(N, K, R) samples, clipped to the unit cube."""
        spread, self._axes = np.linalg.eigh(self._covariance)
        self._lengths = np.sqrt(np.maximum(spread, 1e-14))
        n, dims = self._mean.shape
        normal = self._rng.standard_normal((n, POPULATION, dims))
        steps = np.einsum("nij,nkj->nki", self._axes * self._lengths[:, None], normal)
        return np.clip(self._mean[:, None] + self._sigma[:, None, None] * steps, 0.0, 1.0)

    def tell(self, units: Array, loss: Array) -> None:
        """Adapts means, steps and covariances to samples (N, K, R) and their losses (N, K)."""
        self._generation += 1
        order = np.argsort(loss, axis=1, kind="stable")[:, : len(self._weights), None]
        steps = (np.take_along_axis(units, order, axis=1) - self._mean[:, None]) / self._sigma[:, None, None]
        step = np.einsum("k,nki->ni", self._weights, steps)
        self._mean = self._mean + self._sigma[:, None] * step

        whitened = np.einsum("nij,nj->ni", self._axes, np.einsum("nji,nj->ni", self._axes, step) / self._lengths)
        c = self._c_sigma
        self._sigma_path = (1 - c) * self._sigma_path + math.sqrt(c * (2 - c) * self._mass) * whitened
        length = np.linalg.norm(self._sigma_path, axis=1)
        # Where steps grow fast the path of the covariance stands still, as it would grow too fast.
        settled = math.sqrt(1 - (1 - c) ** (2 * self._generation))
        follows = length / settled < (1.4 + 2 / (step.shape[1] + 1)) * self._expected
        growth = np.exp(c / self._damping * (length / self._expected - 1))
        self._sigma = np.clip(self._sigma * growth, 1e-6, LONGEST_STEP)

        c = self._c_path
        self._path = (1 - c) * self._path + follows[:, None] * math.sqrt(c * (2 - c) * self._mass) * step
        rank_one = self._path[:, :, None] * self._path[:, None, :]
        rank_mu = np.einsum("k,nki,nkj->nij", self._weights, steps, steps)
        kept = 1 - self._c_one - self._c_mu
        self._covariance = kept * self._covariance + self._c_one * rank_one + self._c_mu * rank_mu
