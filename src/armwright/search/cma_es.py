"""CMA-ES for many designs at once: one small strategy per design tunes its real parameters, categories stay.

Hansen, The CMA Evolution Strategy: A Tutorial, 2016 (arXiv:1604.00772), with its default constants. A design is
replaced only by one that is better in every objective.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.search.encoding import DesignEncoding
from armwright.spaces.parameters import Parameter

POPULATION = 12  # samples per design and generation
INITIAL_STEP = 0.05  # of a parameter's range
MAX_STEP = 0.3


@dataclass(frozen=True)
class Refined:
    """N refined designs.

    Attributes:
        matrix: (N, P) designs, unchanged if none better was found.
        values: (N, M) their objective values.
        improved: (N,) whether a better one was found.
        evaluations: number of evaluations spent in all.
    """

    matrix: Array
    values: Array
    improved: NDArray[np.bool_]
    evaluations: int


def refine(
    parameters: Sequence[Parameter],
    evaluate: Callable[[Array], Array],
    matrix: Array,
    values: Array,
    scale: Sequence[float],
    budget: int,
    seed: int,
) -> Refined:
    """Search for designs that are better than the given ones in every objective.

    The loss is the largest increase of an objective, relative to its scale.

    Args:
        parameters: P parameters of the design space.
        evaluate: maps an (N, P) matrix of designs to (N, M) values, all minimised.
        matrix: (N, P) designs.
        values: (N, M) values of `matrix`.
        scale: (M,) amounts that weigh the same in each objective, such as the reference point.
        budget: evaluations per design.
        seed: of all random numbers.
    """
    encoding = DesignEncoding(parameters)
    if not len(encoding.real):
        return Refined(matrix, values, np.zeros(len(matrix), dtype=bool), 0)
    best_matrix, best_values = matrix.copy(), values.copy()
    best_loss = np.zeros(len(matrix))
    strategies = _Strategies(encoding.units(matrix), np.random.default_rng(seed))
    generations = budget // POPULATION
    every = np.arange(len(matrix))
    for _ in range(generations):
        units = strategies.ask()  # (N, K, R)
        samples = np.repeat(matrix[:, None], POPULATION, axis=1)
        samples[..., encoding.real] = encoding.from_units(units)
        sampled = evaluate(samples.reshape(-1, matrix.shape[1])).reshape(len(matrix), POPULATION, -1)
        loss = np.max((sampled - values[:, None]) / np.asarray(scale), axis=-1)  # (N, K)
        first = loss.argmin(axis=1)
        better = loss[every, first] < best_loss
        best_loss[better] = loss[every, first][better]
        best_matrix[better] = samples[every, first][better]
        best_values[better] = sampled[every, first][better]
        strategies.tell(units, loss)
    return Refined(best_matrix, best_values, best_loss < 0.0, generations * POPULATION * len(matrix))


class _Strategies:
    """N independent CMA-ES strategies in R dimensions, on the unit cube."""

    def __init__(self, means: Array, rng: np.random.Generator) -> None:
        n, dims = means.shape
        self._rng = rng
        self._mean, self._sigma = means.copy(), np.full(n, INITIAL_STEP)
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
        """Draw (N, K, R) samples, clipped to the unit cube."""
        spread, self._axes = np.linalg.eigh(self._covariance)
        self._lengths = np.sqrt(np.maximum(spread, 1e-14))
        n, dims = self._mean.shape
        normal = self._rng.standard_normal((n, POPULATION, dims))
        steps = np.einsum("nij,nkj->nki", self._axes * self._lengths[:, None], normal)
        return np.clip(self._mean[:, None] + self._sigma[:, None, None] * steps, 0.0, 1.0)

    def tell(self, units: Array, loss: Array) -> None:
        """Adapt means, step sizes and covariances to samples (N, K, R) and their losses (N, K)."""
        self._generation += 1
        order = np.argsort(loss, axis=1, kind="stable")[:, : len(self._weights), None]
        steps = (np.take_along_axis(units, order, axis=1) - self._mean[:, None]) / self._sigma[:, None, None]
        step = np.einsum("k,nki->ni", self._weights, steps)
        self._mean = self._mean + self._sigma[:, None] * step

        whitened = np.einsum("nij,nj->ni", self._axes, np.einsum("nji,nj->ni", self._axes, step) / self._lengths)
        c = self._c_sigma
        self._sigma_path = (1 - c) * self._sigma_path + math.sqrt(c * (2 - c) * self._mass) * whitened
        length = np.linalg.norm(self._sigma_path, axis=1)
        # The covariance path pauses while the step size grows fast, or it would grow too fast (h_sigma).
        normaliser = math.sqrt(1 - (1 - c) ** (2 * self._generation))
        h_sigma = length / normaliser < (1.4 + 2 / (step.shape[1] + 1)) * self._expected
        growth = np.exp(c / self._damping * (length / self._expected - 1))
        self._sigma = np.clip(self._sigma * growth, 1e-6, MAX_STEP)

        c = self._c_path
        self._path = (1 - c) * self._path + h_sigma[:, None] * math.sqrt(c * (2 - c) * self._mass) * step
        rank_one = self._path[:, :, None] * self._path[:, None, :]
        rank_mu = np.einsum("k,nki,nkj->nij", self._weights, steps, steps)
        kept = 1 - self._c_one - self._c_mu
        self._covariance = kept * self._covariance + self._c_one * rank_one + self._c_mu * rank_mu
