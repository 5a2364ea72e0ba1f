"""What may be said of a few runs: intervals, paired tests and their correction. Arrays alone, on scipy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.arrays import Array

LEVEL = 0.05  # of a test
RESAMPLES = 10_000


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % bootstrap interval; both ends are the mean where there is a single value."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class PairedTest:
    """One method against another on the same seeds; positive numbers speak for the first.

    n: pairs, of which those that are equal tell nothing.
    difference: mean of the paired differences, with its interval.
    better: pairs in which the first is larger.
    p: of the two-sided Wilcoxon signed-rank test; 1 where all pairs are equal.
    effect: matched-pairs rank-biserial correlation (Kerby, Comprehensive Psychology 3:1, 2014), -1 to 1: the share of
        the rank sum that speaks for the first, less the share that speaks against it.
    """

    n: int
    difference: Interval
    better: int
    p: float
    effect: float


def interval(values: Sequence[float] | Array, seed: int = 0) -> Interval:
    """The mean of (N,) values and its interval by the bias-corrected and accelerated bootstrap (Efron 1987)."""
    sample = np.asarray(values, dtype=np.float64)
    mean = float(sample.mean())
    if np.ptp(sample) == 0.0:
        return Interval(mean, mean, mean)
    rng = np.random.default_rng(seed)
    found = _stats().bootstrap((sample,), np.mean, n_resamples=RESAMPLES, method="BCa", rng=rng).confidence_interval
    return Interval(mean, float(found.low), float(found.high))


def paired_test(first: Sequence[float] | Array, second: Sequence[float] | Array) -> PairedTest:
    """Compares (N,) values of one method with those of another, seed by seed."""
    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    told = differences[differences != 0.0]
    stats = _stats()
    ranks = stats.rankdata(np.abs(told))
    p = float(stats.wilcoxon(told).pvalue) if len(told) else 1.0
    effect = float(ranks[told > 0.0].sum() - ranks[told < 0.0].sum()) / float(ranks.sum()) if len(told) else 0.0
    return PairedTest(len(differences), interval(differences), int(np.sum(differences > 0.0)), p, effect)


def holm(p_values: Sequence[float] | Array) -> Array:
    """(N,) p values corrected for their number (Holm, Scand. J. Statist. 6:65, 1979)."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return corrected


def least_p(n: int) -> float:
    """The smallest p that the two-sided signed-rank test can give with n pairs: all signs alike."""
    return min(1.0, 2.0 ** (1 - n))


def can_reject(n: int) -> bool:
    """Whether n pairs can ever show a difference at 5 %: from six on."""
    return least_p(n) <= LEVEL


def _stats() -> Any:
    """scipy.stats, which takes half a second to load; the page of a single run needs none of it."""
    from scipy import stats

    return stats
