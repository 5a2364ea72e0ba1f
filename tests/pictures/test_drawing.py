"""Limits of planes of two objectives."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armwright.pareto import front_mask
from armwright.pictures.drawing import plane_limits

designs = arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=st.floats(1e-6, 1e3))
points = st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))


@given(designs, points)
def test_designs_fill_the_plane(values: np.ndarray, reference: tuple[float, float]) -> None:
    (x_low, x_high), (y_low, y_high) = plane_limits(values, reference, 1.35)
    low, high = np.array([x_low, y_low]), np.array([x_high, y_high])
    within = values[np.all(values <= 1.35 * np.array(reference), axis=1)]
    shown = within if len(within) else values[front_mask(values)]
    assert np.all((low <= shown) & (shown <= high))
    worst = shown.max(axis=0)
    # Both axes reach to the reference point, or no farther than the designs need them to.
    assert np.all(high >= reference) or np.all(high <= 1.11 * worst)
    assert np.all(high <= 2.71 * worst + 1e-12)


def test_a_plane_without_designs_shows_the_reference_point() -> None:
    assert plane_limits(np.empty((0, 2)), (5.0, 2.0), 1.5).tolist() == [[0.0, 7.5], [0.0, 3.0]]
