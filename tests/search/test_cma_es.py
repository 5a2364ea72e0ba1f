"""CMA-ES from several starts: convergence, never worse, counts and determinism."""

import numpy as np
import pytest

from armwright.arrays import Array
from armwright.search.cma_es import POPULATION, minimize
from armwright.spaces.parameters import FloatParameter

BOX = tuple(FloatParameter(f"x_{i}", -1.0, 3.0, "m") for i in range(5))
STARTS = np.random.default_rng(0).uniform(-1.0, 3.0, (7, 5))


def bowl(rows: Array) -> Array:
    """An ill-conditioned, rotated bowl with its least value 0 at (0.5, …)."""
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((5, 5)))
    return ((rows - 0.5) @ axes) ** 2 @ 10.0 ** np.linspace(0.0, 3.0, 5)


def test_every_start_reaches_the_minimum_of_an_ill_conditioned_bowl() -> None:
    points, losses = minimize(BOX, bowl, STARTS, bowl(STARTS), 6000, 0)
    assert points == pytest.approx(np.full((7, 5), 0.5), abs=1e-3)
    assert losses == pytest.approx(bowl(points), rel=1e-9)


@pytest.mark.parametrize("budget", [0, POPULATION, 400])
def test_result_is_never_worse_and_evaluations_are_counted(budget: int) -> None:
    counted: list[int] = []

    def evaluate(samples: Array) -> Array:
        counted.append(len(samples))
        assert np.all((samples >= -1.0) & (samples <= 3.0))
        return bowl(samples)

    points, losses = minimize(BOX, evaluate, STARTS, bowl(STARTS), budget, 3)
    assert sum(counted) == 7 * POPULATION * (budget // POPULATION)
    assert np.all(losses <= bowl(STARTS))
    is_better = losses < bowl(STARTS)
    assert is_better.any() == (budget > 0)
    assert np.array_equal(points[~is_better], STARTS[~is_better])
    assert losses == pytest.approx(bowl(points), rel=1e-9)


def test_start_that_cannot_improve_stays() -> None:
    points, losses = minimize(BOX, lambda rows: np.ones(len(rows)), STARTS, np.ones(7), 240, 0)
    assert np.array_equal(points, STARTS)
    assert np.array_equal(losses, np.ones(7))


def test_same_seed_gives_the_same_points() -> None:
    first, again, other = (minimize(BOX, bowl, STARTS, bowl(STARTS), 240, seed)[0] for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
