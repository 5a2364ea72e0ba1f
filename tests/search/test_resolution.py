"""Designs of a front that a user can tell apart."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armwright.arrays import Array
from armwright.pareto import front_mask, hypervolume
from armwright.search.front.resolution import distinct, resolution_of


def random_front(seed: int, n_objectives: int) -> np.ndarray:
    """Points near a sphere around (1, …, 1), within the reference point (1.1, …)."""
    rng = np.random.default_rng(seed)
    directions = np.abs(rng.standard_normal((300, n_objectives)))
    points = 1.0 - directions / np.linalg.norm(directions, axis=1)[:, None] * rng.uniform(0.9, 1.0, (300, 1))
    return points[front_mask(points)]


fronts = st.builds(random_front, st.integers(0, 10_000), st.integers(1, 4))
sizes = st.floats(0.001, 0.5)


@given(fronts, sizes, st.integers(0, 5))
def test_kept_designs_stand_for_all_others(front: np.ndarray, size: float, seed: int) -> None:
    m: int = front.shape[1]
    reference = (1.1,) * m
    resolution: Array = size * np.linspace(1.0 / m, 1.0, m)
    rank = np.random.default_rng(seed).integers(3, size=len(front))
    kept = distinct(front, resolution, rank)
    others = front[kept]
    # The best of each objective stays. Each design has a kept one that is as good, and similar or of lower rank.
    assert np.array_equal(others.min(axis=0), front.min(axis=0))
    near = np.all(np.abs(front[:, None] - others) <= resolution * (1.0 + 1e-9), axis=2)
    as_good = np.all(others <= front[:, None] + resolution * (1.0 + 1e-9), axis=2)
    assert (near | (as_good & (rank[kept] < rank[:, None]))).any(axis=1).all()
    # Only the best ones of two objectives may be near each other.
    assert (near[kept].sum() - len(kept)) / 2 <= m * (m - 1) / 2
    # The loss of hypervolume has the documented bound.
    sides = np.array(reference) - front.min(axis=0)
    bound = float((resolution / sides).sum() * sides.prod())
    assert -1e-12 <= hypervolume(front, reference) - hypervolume(others, reference) <= bound + 1e-12
    assert np.array_equal(distinct(others, resolution, np.zeros(len(others), dtype=int)), np.arange(len(others)))


def test_of_equal_designs_the_lowest_rank_stays() -> None:
    front = np.array([[0.0, 1.0], [0.5, 0.50], [0.51, 0.49], [1.0, 0.0]])
    resolution = np.array([0.1, 0.1])
    assert distinct(front, resolution, np.array([4, 6, 5, 4])).tolist() == [0, 2, 3]
    assert distinct(front, resolution, np.array([4, 5, 6, 4])).tolist() == [0, 1, 3]


def test_a_higher_rank_needs_an_advantage_above_the_resolution() -> None:
    front = np.array([[0.0, 1.0], [0.10, 0.60], [0.15, 0.40], [1.0, 0.0]])
    resolution = np.array([0.1, 0.1])
    assert distinct(front, resolution, np.array([4, 6, 5, 4])).tolist() == [0, 2, 3]
    assert distinct(front, resolution, np.array([4, 5, 5, 4])).tolist() == [0, 1, 2, 3]


def test_resolution_is_stated_or_a_share_of_the_range() -> None:
    values = np.array([[0.001, 300.0], [0.002, 200.0]])
    assert resolution_of({"price": 5.0}, ("worst_error", "price"), values, (0.003, 700.0)).tolist() == [
        0.01 * 0.002,
        5.0,
    ]
