"""Statistics of few runs, against scipy and statsmodels."""

import gc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.multitest import multipletests

from armwright.experiments.statistics import can_reject, holm, interval, least_p, paired_test

VALUES = st.floats(-1e3, 1e3).map(lambda x: round(x, 3))


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_correction_agrees_with_statsmodels(p_values: list[float]) -> None:
    gc.freeze()  # each call of theirs collects, which takes long after many other tests
    assert holm(p_values) == pytest.approx(multipletests(p_values, method="holm")[1], abs=1e-12)


@given(st.lists(VALUES, min_size=3, max_size=15), st.integers(0, 2**32 - 1))
def test_interval_contains_its_mean_and_is_reproducible(values: list[float], seed: int) -> None:
    found = interval(values, seed)
    assert found.mean == pytest.approx(np.mean(values))
    assert min(values) - 1e-9 <= found.low <= found.mean + 1e-9
    assert found.mean - 1e-9 <= found.high <= max(values) + 1e-9
    assert interval(values, seed) == found


def test_intervals_have_nearly_nominal_coverage() -> None:
    rng = np.random.default_rng(0)
    found = [interval(rng.normal(2.0, 1.0, 20)) for _ in range(100)]
    assert 88 <= sum(one.low <= 2.0 <= one.high for one in found) <= 99


@pytest.mark.parametrize("values", [[3.0], [2.0, 2.0, 2.0]])
def test_equal_values_have_a_zero_width_interval(values: list[float]) -> None:
    found = interval(values)
    assert (found.low, found.high) == (values[0], values[0])


@pytest.mark.parametrize("n", range(1, 12))
def test_smallest_p_value_is_that_of_unanimous_pairs(n: int) -> None:
    test = paired_test(np.arange(n) + 1.0 + np.arange(n), np.arange(n))
    assert test.p == pytest.approx(least_p(n))
    assert (test.better, test.effect) == (n, 1.0)
    assert can_reject(n) == (n >= 6) == (test.p <= 0.05)


def test_paired_test_agrees_with_scipy() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(0.4, 1.0, (2, 20)) + np.array([[0.3], [0.0]])
    test = paired_test(first, second)
    theirs = stats.wilcoxon(first, second)
    assert test.p == pytest.approx(theirs.pvalue)
    against = theirs.statistic  # the smaller of the two rank sums
    assert abs(test.effect) == pytest.approx(1.0 - 2.0 * against / (20 * 21 / 2))
    assert test.difference.mean == pytest.approx(np.mean(first - second))


def test_equal_pairs_have_no_effect() -> None:
    for first, second, expected in (([1.0, 2.0], [1.0, 2.0], (2, 0, 0.0)), ([1.0, 5.0, 2.0], [1.0] * 3, (3, 2, 1.0))):
        test = paired_test(first, second)
        assert (test.n, test.better, test.effect) == expected


def test_swapped_pairs_reverse_the_effect() -> None:
    one, other = paired_test([3.0, 1.0, 5.0], [1.0, 2.0, 2.0]), paired_test([1.0, 2.0, 2.0], [3.0, 1.0, 5.0])
    assert one.effect == -other.effect
    assert one.p == other.p
    assert one.difference.mean == -other.difference.mean
