"""Expected hypervolume gain of designs whose objectives are independent normal variables, or logarithms are.

The region that a front does not dominate, bounded by the reference point, is a union of disjoint boxes. The expected
gain is the integral of P(y <= z) over it, which is exact in closed form (Emmerich, Giannakoglou & Naujoks, IEEE Trans.
Evol. Comput. 10(4), 2006; boxes as in Yang et al., J. Global Optimization 75, 2019):

    E[gain] = Σ_boxes Π_m (I_m(upper) - I_m(lower)),   I_m(z) = E[max(0, z - y_m)]

With one objective this is the expected improvement. Objectives keep their units, so that scaling one of them scales all
gains alike.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.search.survival import thinned

LONGEST_FRONT = {1: 1, 2: 200, 3: 30, 4: 14, 5: 8}  # by number of objectives; more points make too many boxes


@dataclass(frozen=True)
class Forecast:
    """Predicted objectives of N designs, independent.

    Attributes:
        mean: (N, M) of each objective, or of log(objective + shift) where `is_log`.
        deviation: (N, M) standard deviations of the same.
        is_log: (M,) True for objectives whose logarithms are normal.
        shift: (M,) added before the logarithm.
    """

    mean: Array
    deviation: Array
    is_log: tuple[bool, ...]
    shift: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.mean)

    @property
    def medians(self) -> Array:
        """(N, M) medians of the objectives."""
        medians = self.mean.copy()
        for column, (is_log, shift) in enumerate(zip(self.is_log, self.shift, strict=True)):
            if is_log:
                medians[:, column] = np.exp(medians[:, column]) - shift
        return medians

    def shortfall(self, objective: int, bounds: Array) -> Array:
        """Return (N, K) the expected excess E[max(0, z - y)] of K bounds z over an objective y."""
        mean, deviation = self.mean[:, [objective]], self.deviation[:, [objective]]
        if not self.is_log[objective]:
            distance = (np.where(np.isfinite(bounds), bounds, 0.0) - mean) / deviation
            density = np.exp(-0.5 * distance**2) / np.sqrt(2.0 * np.pi)
            excess = deviation * (distance * ndtr(distance) + density)
            return np.where(np.isfinite(bounds), excess, 0.0)
        shifted = bounds + self.shift[objective]
        positive = np.where(shifted > 0.0, shifted, 1.0)  # also 1 for -inf
        distance = (np.log(positive) - mean) / deviation
        average = np.exp(np.minimum(mean + 0.5 * deviation**2, 700.0))
        excess = positive * ndtr(distance) - average * ndtr(distance - deviation)
        return np.where(shifted > 0.0, np.maximum(excess, 0.0), 0.0)


def expected_gain(forecast: Forecast, values: Array, reference_point: Array) -> Array:
    """Return (N,) the expected gain of hypervolume by each design.

    Args:
        forecast: of N designs.
        values: (K, M) objectives of the feasible designs so far.
        reference_point: (M,) bound of the hypervolume.
    """
    n_objectives = len(reference_point)
    within = values[np.all(values < reference_point, axis=1)]
    front = within[front_mask(within)]
    front = front[thinned(front, reference_point, LONGEST_FRONT[n_objectives])]
    lower, upper = free_boxes(front, reference_point)
    gain = np.ones((len(forecast), len(lower)))
    for objective in range(n_objectives):
        bounds, index = np.unique(np.concatenate([lower[:, objective], upper[:, objective]]), return_inverse=True)
        shortfall = forecast.shortfall(objective, bounds)
        gain *= shortfall[:, index[len(lower) :]] - shortfall[:, index[: len(lower)]]
    return np.maximum(gain, 0.0).sum(axis=1)


def free_boxes(front: Array, reference_point: Array) -> tuple[Array, Array]:
    """Return the (B, M) lower and upper corners of disjoint boxes that fill what a front does not dominate.

    Args:
        front: (K, M) points that do not dominate each other, within the reference point.
        reference_point: (M,) upper bound of all boxes; the lower one is -inf.
    """
    if len(reference_point) == 1:
        upper = min(float(front.min(initial=np.inf)), float(reference_point[0]))
        return np.array([[-np.inf]]), np.array([[upper]])
    order = np.argsort(front[:, -1], kind="stable")
    front = front[order]
    edges = np.unique(np.concatenate([front[:, -1], reference_point[-1:]]))
    lowers: list[Array] = []
    uppers: list[Array] = []
    for low, high in zip(np.concatenate([[-np.inf], edges[:-1]]), edges, strict=True):
        below = front[front[:, -1] <= low, :-1]
        lower, upper = free_boxes(below[front_mask(below)], reference_point[:-1])
        lowers.append(np.column_stack([lower, np.full(len(lower), low)]))
        uppers.append(np.column_stack([upper, np.full(len(upper), high)]))
    return np.concatenate(lowers), np.concatenate(uppers)
