"""Gaussian processes, against scikit-learn's and against their definitions."""

from typing import Any

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from armwright.arrays import Array
from armwright.search.surrogate.gaussian_process import JITTER, GaussianProcess, Hyperparameters, fit, loss, priors

SETTINGS = Hyperparameters(amplitude=1.7, noise=0.03, lengths=np.array([0.5, 2.0, 30.0]))


def data(n: int, seed: int = 0) -> tuple[Array, Array]:
    inputs = np.random.default_rng(seed).standard_normal((n, 3))
    values = np.sin(2.0 * inputs[:, 0]) + 0.3 * inputs[:, 1]
    return inputs, (values - values.mean()) / values.std()


def noisy(deviation: Array) -> Array:
    """Return standard deviations of observations, not of the response."""
    return np.hypot(deviation, np.sqrt(SETTINGS.noise))


def logs_of(settings: Hyperparameters) -> Array:
    return np.log([settings.amplitude, settings.noise, *settings.lengths])


def test_posterior_and_likelihood_equal_those_of_scikit_learn() -> None:
    inputs, observations = data(25)
    lengths: Any = SETTINGS.lengths  # the stubs know one length only
    kernel: Any = ConstantKernel(SETTINGS.amplitude) * Matern(lengths, nu=2.5) + WhiteKernel(SETTINGS.noise)
    oracle: Any = GaussianProcessRegressor(kernel, alpha=JITTER, optimizer=None)  # pyright: ignore[reportArgumentType]
    oracle.fit(inputs, observations)
    process = GaussianProcess(inputs, observations, SETTINGS)
    there = data(40, seed=1)[0]
    mean, deviation = oracle.predict(there, return_std=True)
    found_mean, found_deviation = process.predict(there)
    assert found_mean == pytest.approx(mean, abs=1e-6)
    assert noisy(found_deviation) == pytest.approx(deviation, rel=1e-5)
    without_prior = loss(logs_of(SETTINGS), inputs, observations, np.zeros(5), np.full(5, np.inf))[0]
    assert -without_prior == pytest.approx(oracle.log_marginal_likelihood(), rel=1e-8)


def test_left_out_predictions_equal_those_without_the_observation() -> None:
    inputs, observations = data(12)
    mean, deviation = GaussianProcess(inputs, observations, SETTINGS).left_out
    for i in range(12):
        others = np.delete(np.arange(12), i)
        process = GaussianProcess(inputs[others], observations[others], SETTINGS)
        own_mean, own_deviation = process.predict(inputs[[i]])
        assert mean[i] == pytest.approx(own_mean[0], abs=1e-6)
        assert deviation[i] == pytest.approx(noisy(own_deviation)[0], rel=1e-5)


def test_gradient_is_the_derivative_of_the_loss() -> None:
    inputs, observations = data(15)
    mean, spread = np.zeros(5), np.full(5, 2.0)
    point = np.array([0.2, -2.0, 0.1, 0.5, 1.5])

    steps = 1e-5 * np.eye(5)
    above, below = (
        np.array([loss(point + sign * step, inputs, observations, mean, spread)[0] for step in steps])
        for sign in (1.0, -1.0)
    )
    gradient = loss(point, inputs, observations, mean, spread)[1]
    assert gradient == pytest.approx((above - below) / 2e-5, abs=1e-5)


def test_fit_has_the_largest_posterior() -> None:
    inputs, observations = data(20)
    found, best = fit(inputs, observations)
    assert -loss(logs_of(found), inputs, observations, *priors(3))[0] == pytest.approx(best, rel=1e-9)
    for index in range(5):
        for factor in (0.8, 1.25):
            logs = logs_of(found)
            logs[index] += np.log(factor)
            assert -loss(logs, inputs, observations, *priors(3))[0] < best


def test_lengths_tell_inputs_that_matter_from_one_that_does_not() -> None:
    lengths = fit(*data(60))[0].lengths
    assert lengths[0] < lengths[1] < lengths[2]


def test_equal_inputs_and_constant_observations_have_a_fit() -> None:
    inputs = np.zeros((8, 2))
    process = GaussianProcess(inputs, np.zeros(8), fit(inputs, np.zeros(8))[0])
    assert process.predict(inputs)[0] == pytest.approx(0.0)
