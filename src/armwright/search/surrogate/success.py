"""Models of whether evaluations succeed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from armwright.arrays import Array
from armwright.search.surrogate.gaussian_process import GaussianProcess, Hyperparameters, fit

LEAST = 1e-3  # probability of success, so that all designs are comparable


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


def success_labels(failed: NDArray[np.bool_]) -> Array:
    """Return (N,) 1 for evaluations that succeeded, -1 for others."""
    return np.where(failed, -1.0, 1.0)


def choose_success_model(inputs: Mapping[str, Array], failed: NDArray[np.bool_]) -> tuple[str, Hyperparameters]:
    """Return the set of inputs (N, F) and the hyperparameters under which `failed` (N,) is most probable."""
    labels = success_labels(failed)
    fitted = {name: fit(table, labels) for name, table in inputs.items()}
    best = max(fitted, key=lambda name: GaussianProcess(inputs[name], labels, fitted[name]).log_posterior)
    return best, fitted[best]
