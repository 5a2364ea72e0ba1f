"""The screen of proposals: which designs of others the surrogate expects too little of."""

import numpy as np

from armwright.arrays import Array
from armwright.search.surrogate.surrogate import Observations, Screen, Surrogate

LEAST_TRIALS = 15  # evaluations that succeeded; fewer teach too little
LEAST_QUALITY = 0.5  # share of the variance of each objective that is predicted if each value is left out
LEAST_GAIN = 0.1  # of the best candidate's; such a proposal is worth less than a tenth of the sampler's own design


def rejection(
    surrogate: Surrogate, observations: Observations, row: Array, seed: int
) -> tuple[float, tuple[float, ...]] | None:
    """Return why a design (P,) is not worth an evaluation; None if it is, or if too little is known to tell.

    Returns:
        Its expected gain of hypervolume, as a share of the best candidate's, and its predicted objectives.
    """
    if np.count_nonzero(~observations.failed) < LEAST_TRIALS:
        return None
    screen = Screen(surrogate, observations)
    if screen.quality.min() < LEAST_QUALITY:
        return None
    best = float(screen.gain(surrogate.considered(observations, screen, seed)[1]).max())
    known = surrogate.describe_known(row[None])
    gain = float(screen.gain(known)[0])
    if gain >= LEAST_GAIN * best:
        return None
    return round(gain / best, 6), tuple(screen.predicted(known)[0].tolist())
