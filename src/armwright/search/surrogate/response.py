"""Models of one objective, and of the success of evaluations: which inputs, which transform, and what they predict."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from armwright.arrays import Array
from armwright.search.surrogate.gaussian_process import GaussianProcess, Hyperparameters, fit

SHIFT = 0.03  # of the median, added before a logarithm, so that a value near 0 does not stand out
SMALLEST = 1e-100  # median of values whose logarithms are taken
LARGEST_LOG = 700.0  # of a prediction, so that it is finite
LEAST = 1e-3  # probability of success, so that all designs are comparable


@dataclass(frozen=True)
class Transform:
    """Standardised values, or standardised logarithms of them."""

    is_log: bool  # whether the logarithm is taken
    shift: float  # added before
    mean: float  # subtracted after it
    deviation: float  # divided by after that

    @classmethod
    def of(cls, values: Array, is_log: bool) -> "Transform":
        """Return the transform of values (N,) to mean 0 and variance 1."""
        shift = SHIFT * float(np.median(values)) if is_log else 0.0
        shaped = np.log(values + shift) if is_log else values
        deviation = float(shaped.std())
        return cls(is_log, shift, float(shaped.mean()), deviation if deviation > 0.0 else 1.0)

    def __call__(self, values: Array) -> Array:
        """Return the (N,) transformed values."""
        shaped = np.log(np.maximum(values, 0.0) + self.shift) if self.is_log else values
        return (shaped - self.mean) / self.deviation

    def inverse(self, transformed: Array) -> Array:
        """Return the (N,) values that have these transformed values."""
        shaped = transformed * self.deviation + self.mean
        return np.exp(np.minimum(shaped, LARGEST_LOG)) - self.shift if self.is_log else shaped

    def log_slopes(self, values: Array) -> float:
        """Return the sum of the logarithms of the transform's slopes at values (N,)."""
        slopes = -np.log(self.deviation) * len(values)
        return float(slopes - np.log(values + self.shift).sum() if self.is_log else slopes)


@dataclass(frozen=True)
class ResponseModel:
    """A model of one objective."""

    inputs: str  # name of its set of inputs
    transform: Transform  # of its values
    hyperparameters: Hyperparameters  # of its process
    log_posterior: float  # of its hyperparameters and the values


@dataclass(frozen=True)
class SuccessModel:
    """The probability that the evaluation of a design succeeds.

    Least-squares classification: Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, section 6.5.
    """

    inputs: str  # name of its set of inputs
    process: GaussianProcess  # of success (1) and failure (-1)

    def probability(self, inputs: Mapping[str, Array]) -> Array:
        """Return (N,) the probabilities of designs with these inputs, (N, F) of each set."""
        mean, deviation = self.process.predict(inputs[self.inputs])
        return np.maximum(ndtr(mean / np.hypot(deviation, np.sqrt(self.process.hyperparameters.noise))), LEAST)


def choose_model(inputs: Mapping[str, Array], values: Array) -> ResponseModel:
    """Return the model under which the values (N,) of an objective are most probable.

    The transform is chosen with the first set of inputs (N, F), then the set.
    """
    first, *others = inputs
    transforms = [Transform.of(values, is_log=False)]
    if values.min() >= 0.0 and np.median(values) > SMALLEST:
        transforms.append(Transform.of(values, is_log=True))
    best = max((_fitted(first, inputs, values, t) for t in transforms), key=lambda model: model.log_posterior)
    models = [best, *(_fitted(name, inputs, values, best.transform) for name in others)]
    return max(models, key=lambda model: model.log_posterior)


def choose_success_model(inputs: Mapping[str, Array], failed: NDArray[np.bool_]) -> ResponseModel:
    """Return the model, by its set of inputs (N, F), under which `failed` (N,) is most probable."""
    labels, as_it_is = success_labels(failed), Transform(is_log=False, shift=0.0, mean=0.0, deviation=1.0)
    return max((_fitted(name, inputs, labels, as_it_is) for name in inputs), key=lambda model: model.log_posterior)


def success_labels(failed: NDArray[np.bool_]) -> Array:
    """Return (N,) 1 for evaluations that succeeded, -1 for others."""
    return np.where(failed, -1.0, 1.0)


def _fitted(name: str, inputs: Mapping[str, Array], values: Array, transform: Transform) -> ResponseModel:
    hyperparameters, log_posterior = fit(inputs[name], transform(values))
    return ResponseModel(name, transform, hyperparameters, log_posterior + transform.log_slopes(values))
