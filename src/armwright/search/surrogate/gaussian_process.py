"""Gaussian process regression with relevance determination, fitted to few observations.

Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006: posterior and marginal likelihood by algorithm 2.1
and equation 5.9, leave-one-out predictions by equations 5.10 to 5.12. The kernel is a Matérn one (equation 4.17) with a
length for each input, plus a noise variance on the diagonal:

    k(x, x') = a (1 + √5 r + 5/3 r²) exp(-√5 r),   r² = Σ (x_i - x'_i)² / l_i²
"""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.linalg.lapack import dtrtri  # pyright: ignore[reportAttributeAccessIssue, reportUnknownVariableType]
from scipy.optimize import minimize  # pyright: ignore[reportUnknownVariableType]
from threadpoolctl import ThreadpoolController

from armwright.arrays import Array

JITTER = 1e-8
NOISE_FLOOR = 1e-5  # of the variance of the observations
ITERATIONS = 60  # of L-BFGS-B
PRIOR_WIDTH = 4.0  # standard deviations within which hyperparameters are searched

# Means and standard deviations of the normal priors of the logarithms of the hyperparameters. The lengths follow
# Hvarfner, Hellsten & Nardi, Vanilla Bayesian Optimization Performs Great in High Dimensions, ICML 2024: longer the
# more inputs there are, so that an input counts only if the observations demand it. Chosen by predictions of simulated
# designs from 10 to 80 others (docs/decisions/030).
AMPLITUDE = (-0.5, 1.0)
NOISE = (-3.0, 1.5)
LENGTH = (2.1, 0.7)  # the mean for one input; it grows by log(F) / 2


@dataclass(frozen=True)
class Hyperparameters:
    """Variances of a process, and the length over which each input changes the response."""

    amplitude: float  # variance of the response
    noise: float  # variance of what the inputs do not explain
    lengths: Array  # (F,) in units of the inputs


@dataclass(frozen=True)
class GaussianProcess:
    """A process conditioned on observations."""

    inputs: Array  # (N, F) of about unit variance
    observations: Array  # (N,) of mean 0 and unit variance
    hyperparameters: Hyperparameters  # of the kernel

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Return the (K,) means and standard deviations of the response at (K, F) inputs, without noise."""
        with _on_one_thread():
            cross = _covariance(inputs, self.inputs, self.hyperparameters)
            explained = ((cross @ self._root.T) ** 2).sum(axis=1)
            variance = np.maximum(self.hyperparameters.amplitude - explained, JITTER)
            return cross @ self._weights, np.sqrt(variance)

    @cached_property
    def left_out(self) -> tuple[Array, Array]:
        """(N,) means and standard deviations of each observation, predicted from all others."""
        precision = (self._root**2).sum(axis=0)
        return self.observations - self._weights / precision, np.sqrt(1.0 / precision)

    @cached_property
    def _root(self) -> Array:
        """Return the lower triangle R for which R^T R is the inverse covariance of the observations."""
        return _inverse_root(_covariance(self.inputs, self.inputs, self.hyperparameters), self.hyperparameters.noise)

    @cached_property
    def _weights(self) -> Array:
        return self._root.T @ (self._root @ self.observations)


def fit(inputs: Array, observations: Array) -> tuple[Hyperparameters, float]:
    """Return the hyperparameters of the largest marginal likelihood times prior, found from two starts.

    The second value is the logarithm of that product, of which the prior is relative to its mode.
    Inputs (N, F) and observations (N,) are scaled as those of a GaussianProcess.
    """
    mean, spread = priors(inputs.shape[1])
    bounds = np.column_stack([mean - PRIOR_WIDTH * spread, mean + PRIOR_WIDTH * spread])
    bounds[1, 0] = np.log(NOISE_FLOOR)
    noisy = mean + np.concatenate([[-0.5, 2.0], np.full(inputs.shape[1], 0.5)])
    with _on_one_thread():
        found: list[Any] = [
            minimize(
                loss,
                start,
                (inputs, observations, mean, spread),
                "L-BFGS-B",
                jac=True,
                bounds=bounds,
                options={"maxiter": ITERATIONS},
            )
            for start in (mean, noisy)
        ]
    best = min(found, key=lambda result: result.fun)
    return _hyperparameters(best.x), -float(best.fun)


def loss(logs: Array, inputs: Array, observations: Array, mean: Array, spread: Array) -> tuple[float, Array]:
    """Return the negative logarithm of marginal likelihood times prior, and its gradient.

    logs: (2 + F,) logarithms of amplitude, noise and lengths.
    mean, spread: (2 + F,) means and standard deviations of their priors.
    """
    found, n = _hyperparameters(logs), len(inputs)
    root = np.sqrt(5.0) * _distances(inputs / found.lengths, inputs / found.lengths)
    decay = np.exp(-root)
    covariance = found.amplitude * (1.0 + root + root**2 / 3.0) * decay
    inverse_root = _inverse_root(covariance, found.noise)
    inverse = inverse_root.T @ inverse_root
    weights = inverse @ observations
    outer = 0.5 * (np.outer(weights, weights) - inverse)
    slope = outer * (5.0 / 3.0 * found.amplitude * (1.0 + root) * decay)
    # Σ_jk slope_jk (x_ji - x_ki)², for all inputs i at once
    by_length = 2.0 * (slope.sum(axis=1) @ inputs**2 - (inputs * (slope @ inputs)).sum(axis=0)) / found.lengths**2
    gradient = np.concatenate([[(outer * covariance).sum(), found.noise * np.trace(outer)], by_length])
    likelihood = -0.5 * observations @ weights + np.log(np.diag(inverse_root)).sum() - 0.5 * n * np.log(2.0 * np.pi)
    off = (logs - mean) / spread
    return float(0.5 * off @ off - likelihood), off / spread - gradient


def _hyperparameters(logs: Array) -> Hyperparameters:
    return Hyperparameters(float(np.exp(logs[0])), float(np.exp(logs[1])), np.exp(logs[2:]))


def priors(n: int) -> tuple[Array, Array]:
    """Return the means and standard deviations of the logarithms of the hyperparameters for n inputs."""
    length, spread = LENGTH
    means = np.concatenate([[AMPLITUDE[0], NOISE[0]], np.full(n, length + 0.5 * np.log(n))])
    return means, np.concatenate([[AMPLITUDE[1], NOISE[1]], np.full(n, spread)])


def _inverse_root(covariance: Array, noise: float) -> Array:
    """Return the inverse of the Cholesky factor of an (N, N) covariance with noise."""
    factor = np.linalg.cholesky(covariance + (noise + JITTER) * np.eye(len(covariance)))
    return np.asarray(dtrtri(factor, lower=1)[0], dtype=np.float64)


def _distances(first: Array, second: Array) -> Array:
    """Return the (N, K) Euclidean distances of two sets of points."""
    squared = (first**2).sum(axis=1)[:, None] + (second**2).sum(axis=1) - 2.0 * first @ second.T
    return np.sqrt(np.maximum(squared, 0.0))


def _covariance(first: Array, second: Array, found: Hyperparameters) -> Array:
    """Return the (N, K) covariances of the response at two sets of inputs."""
    root = np.sqrt(5.0) * _distances(first / found.lengths, second / found.lengths)
    return found.amplitude * (1.0 + root + root**2 / 3.0) * np.exp(-root)


@cache
def _blas() -> Any:
    return ThreadpoolController().select(user_api="blas")


def _on_one_thread() -> AbstractContextManager[Any]:
    """Keep BLAS to one thread: with matrices this small, several threads take over twice as long."""
    return _blas().limit(limits=1)
