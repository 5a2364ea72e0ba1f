"""Expected hypervolume gain of designs whose objectives are independent normal variables.

The region that a front does not dominate, bounded by the reference point, is a union of disjoint boxes. The expected
gain is the integral of P(y <= z) over it, which is exact in closed form (Emmerich, Giannakoglou & Naujoks, IEEE Trans.
Evol. Comput. 10(4), 2006; boxes as in Yang et al., J. Global Optimization 75, 2019):

    E[gain] = Σ_boxes Π_m (I_m(upper) - I_m(lower)),   I_m(z) = E[max(0, z - y_m)]

With one objective this is the expected improvement.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.search.front.selection import thinned

LONGEST_FRONT = {1: 1, 2: 200, 3: 30, 4: 14, 5: 8}  # by number of objectives; more points make too many boxes


@dataclass(frozen=True)
class Forecast:
    """Predicted objectives of N designs, independent."""

    mean: Array  # (N, M) of each objective
    deviation: Array  # (N, M) standard deviations

    def shortfall(self, objective: int, bounds: Array) -> Array:
        """Return (N, K) the expectations of max(0, z - y) for K bounds z of an objective y."""
        is_finite = np.isfinite(bounds)
        deviation = self.deviation[:, [objective]]
        distance = (np.where(is_finite, bounds, 0.0) - self.mean[:, [objective]]) / deviation
        density = np.exp(-0.5 * distance**2) / np.sqrt(2.0 * np.pi)
        return np.where(is_finite, deviation * (distance * ndtr(distance) + density), 0.0)


def expected_gain(forecast: Forecast, values: Array, reference_point: Array) -> Array:
    """Return (N,) the expected gain of hypervolume by each design over (K, M) values of the feasible ones so far."""
    n_objectives = len(reference_point)
    within = values[np.all(values < reference_point, axis=1)]
    front = within[front_mask(within)]
    front = front[thinned(front, reference_point, LONGEST_FRONT[n_objectives])]
    lower, upper = free_boxes(front, reference_point)
    gain = np.ones((len(forecast.mean), len(lower)))
    for objective in range(n_objectives):
        bounds, index = np.unique(np.concatenate([lower[:, objective], upper[:, objective]]), return_inverse=True)
        shortfall = forecast.shortfall(objective, bounds)
        gain *= shortfall[:, index[len(lower) :]] - shortfall[:, index[: len(lower)]]
    return np.maximum(gain, 0.0).sum(axis=1)


def free_boxes(front: Array, reference_point: Array) -> tuple[Array, Array]:
    """Return the (B, M) lower and upper corners of disjoint boxes that fill what a front (K, M) does not dominate.

    The front lies within the reference point, the upper bound of all boxes; the lower one is -inf.
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
