"""CMA-ES from several starts at once: one small strategy for each, side by side.

Hansen, The CMA Evolution Strategy: A Tutorial, 2016 (arXiv:1604.00772), with its default constants.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from armwright.arrays import Array
from armwright.search.encoding import DesignEncoding
from armwright.spaces.parameters import FloatParameter

POPULATION = 12  # samples per start and generation
INITIAL_STEP = 0.05  # of a parameter's range
MAX_STEP = 0.3


def minimize(
    parameters: Sequence[FloatParameter],
    evaluate: Callable[[Array], Array],
    matrix: Array,
    losses: Array,
    budget: int,
    seed: int,
) -> tuple[Array, Array]:
    """Return the best points found from each start, (N, P), and their losses, (N,): the start itself if none is better.

    Args:
        parameters: the P parameters.
        evaluate: maps points (N, P) to losses (N,).
        matrix: (N, P) starts.
        losses: (N,) losses of the starts.
        budget: evaluations per start.
        seed: of all random numbers.
    """
    encoding = DesignEncoding(parameters)
    best, best_loss = matrix.copy(), losses.copy()
    strategies = _Strategies(encoding.units(matrix), np.random.default_rng(seed))
    every = np.arange(len(matrix))
    for _ in range(budget // POPULATION):
        units = strategies.ask()  # (N, K, P)
        samples = encoding.from_units(units)
        loss = evaluate(samples.reshape(-1, matrix.shape[1])).reshape(len(matrix), POPULATION)
        first = loss.argmin(axis=1)
        better = loss[every, first] < best_loss
        best_loss[better] = loss[every, first][better]
        best[better] = samples[every, first][better]
        strategies.tell(units, loss)
    return best, best_loss


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
