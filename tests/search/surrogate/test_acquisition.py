"""Expected hypervolume gains, against averages of moocore's hypervolume and by properties."""

import moocore
import numpy as np
import pytest

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.search.surrogate.acquisition import Forecast, expected_gain, free_boxes

SAMPLES = 3000
POINTS = {1: 5, 2: 15, 3: 10, 4: 8, 5: 6}


def forecast(n_objectives: int) -> Forecast:
    rng = np.random.default_rng(0)
    return Forecast(rng.normal(0.8, 0.3, (3, n_objectives)), rng.uniform(0.1, 0.5, (3, n_objectives)))


def drawn(forecast: Forecast, design: int) -> Array:
    """Return (SAMPLES, M) objectives drawn from the forecast of a design."""
    mean, deviation = forecast.mean[design], forecast.deviation[design]
    return np.random.default_rng(7).normal(mean, deviation, (SAMPLES, len(mean)))


def volume(values: Array, reference_point: Array) -> float:
    within = values[np.all(values < reference_point, axis=1)]
    return float(moocore.hypervolume(within, ref=reference_point)) if len(within) else 0.0


@pytest.mark.parametrize("n_objectives", [1, 2, 3, 4, 5])
def test_gain_is_the_average_growth_of_the_hypervolume(n_objectives: int) -> None:
    reference_point = np.full(n_objectives, 1.5)
    values = np.random.default_rng(1).uniform(0.7, 1.8, (POINTS[n_objectives], n_objectives))
    found = forecast(n_objectives)
    before = volume(values, reference_point)
    for design, gain in enumerate(expected_gain(found, values, reference_point)):
        growth = [volume(np.vstack([values, row]), reference_point) - before for row in drawn(found, design)]
        assert gain == pytest.approx(np.mean(growth), abs=4.0 * np.std(growth) / SAMPLES**0.5 + 1e-4)


def test_boxes_are_disjoint_and_fill_what_the_front_leaves() -> None:
    rng = np.random.default_rng(3)
    values = rng.random((20, 3))
    front, reference_point = values[front_mask(values)], np.ones(3)
    lower, upper = free_boxes(front, reference_point)
    size = np.prod(upper - np.maximum(lower, 0.0), axis=1).sum()
    assert size == pytest.approx(1.0 - volume(front, reference_point))


def test_without_a_front_the_whole_box_is_to_be_gained() -> None:
    sure = Forecast(np.array([[0.25, 0.5]]), np.full((1, 2), 1e-6))
    assert expected_gain(sure, np.empty((0, 2)), np.ones(2)) == pytest.approx(0.75 * 0.5)
