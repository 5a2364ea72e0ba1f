"""Bootstrap intervals, paired tests and their correction for multiple comparisons, on scipy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.arrays import Array

LEVEL = 0.05  # of a test
RESAMPLES = 10_000


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % bootstrap interval; both ends equal the mean if all values are equal."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class PairedTest:
    """One method against another on the same seeds; positive numbers favour the first.

    n: number of pairs; equal pairs do not count in the test.
    difference: mean of the paired differences, with its interval.
    better: number of pairs in which the first is larger.
    p: of the two-sided Wilcoxon signed-rank test; 1 if all pairs are equal.
    effect: matched-pairs rank-biserial correlation (Kerby, Comprehensive Psychology 3:1, 2014), -1 to 1: the share of
        the rank sum that favours the first, minus the share that favours the second.
    """

    n: int
    difference: Interval
    better: int
    p: float
    effect: float


def interval(values: Sequence[float] | Array, seed: int = 0) -> Interval:
    """Return the mean of (N,) values and its bias-corrected and accelerated bootstrap interval (Efron 1987)."""
    sample = np.asarray(values, dtype=np.float64)
    mean = float(sample.mean())
    if np.ptp(sample) == 0.0:
        return Interval(mean, mean, mean)
    rng = np.random.default_rng(seed)
    result = _stats().bootstrap((sample,), np.mean, n_resamples=RESAMPLES, method="BCa", rng=rng).confidence_interval
    return Interval(mean, float(result.low), float(result.high))


def paired_test(first: Sequence[float] | Array, second: Sequence[float] | Array) -> PairedTest:
    """Compare (N,) values of one method with those of another, paired by seed."""
    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    unequal = differences[differences != 0.0]
    stats = _stats()
    ranks = stats.rankdata(np.abs(unequal))
    p = float(stats.wilcoxon(unequal).pvalue) if len(unequal) else 1.0
    effect = (
        float(ranks[unequal > 0.0].sum() - ranks[unequal < 0.0].sum()) / float(ranks.sum()) if len(unequal) else 0.0
    )
    return PairedTest(len(differences), interval(differences), int(np.sum(differences > 0.0)), p, effect)


def holm(p_values: Sequence[float] | Array) -> Array:
    """Return (N,) p values corrected for their number (Holm, Scand. J. Statist. 6:65, 1979)."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return corrected


def least_p(n: int) -> float:
    """Return the smallest p of the two-sided signed-rank test with n pairs: all signs equal."""
    return min(1.0, 2.0 ** (1 - n))


def can_reject(n: int) -> bool:
    """Return whether n pairs can show a difference at 5 %: six or more can."""
    return least_p(n) <= LEVEL


def _stats() -> Any:
    """Import scipy.stats on first use: it takes half a second, and the page of a single run needs none of it."""
    from scipy import stats

    return stats
