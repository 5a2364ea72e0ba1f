"""Fronts and hypervolumes against pymoo, and their properties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pymoo.indicators.hv import HV
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from armwright.pareto import (
    FrontTracker,
    default_reference_point,
    front_indices,
    front_mask,
    hypervolume,
    hypervolume_history,
    knee_index,
    paper_solution_indices,
)

REFERENCE = (5.0, 5.0)

# A coarse grid, so that duplicates, ties in one objective and points on the box's edge are common.
POINTS = arrays(float, st.tuples(st.integers(1, 25), st.just(2)), elements=st.integers(0, 24).map(lambda i: i / 4))
# And points anywhere, in and out of the box.
ANYWHERE = arrays(float, st.tuples(st.integers(1, 40), st.just(2)), elements=st.floats(0.0, 10.0))


@given(POINTS | ANYWHERE)
def test_front_agrees_with_pymoo(values: np.ndarray) -> None:
    front = set(NonDominatedSorting().do(values, only_non_dominated_front=True).tolist())
    first = {i for i in front if not any(np.array_equal(values[i], values[k]) for k in range(i))}
    assert set(np.flatnonzero(front_mask(values)).tolist()) == first


@given(POINTS | ANYWHERE)
def test_hypervolume_agrees_with_pymoo(values: np.ndarray) -> None:
    inside = values[np.all(values < REFERENCE, axis=1)]
    expected = HV(ref_point=np.array(REFERENCE))(inside) if len(inside) else 0.0
    assert hypervolume(values, REFERENCE) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(POINTS | ANYWHERE, st.randoms(use_true_random=False))
def test_front_and_hypervolume_ignore_order_and_duplicates(values: np.ndarray, random: object) -> None:
    order = list(range(len(values))) * 2
    random.shuffle(order)
    again = values[order]
    assert hypervolume(again, REFERENCE) == pytest.approx(hypervolume(values, REFERENCE), rel=1e-12)
    assert {tuple(row) for row in again[front_mask(again)]} == {tuple(row) for row in values[front_mask(values)]}
    assert front_mask(again).sum() == front_mask(values).sum()


@given(POINTS | ANYWHERE)
def test_tracker_matches_the_front_after_every_point(values: np.ndarray) -> None:
    tracker = FrontTracker(2, None)
    for i, row in enumerate(values):
        tracker.add(row)
        assert tracker.hypervolume is None
        assert tracker.size == front_mask(values[: i + 1]).sum()
    for bound in (REFERENCE, (3.0, 8.0)):
        tracker.set_reference_point(bound)
        assert tracker.hypervolume == pytest.approx(hypervolume(values, bound), rel=1e-12)


def test_pareto_functions_accept_no_points() -> None:
    nothing = np.empty((0, 2))
    assert front_mask(nothing).shape == (0,)
    assert front_indices(nothing) == []
    assert hypervolume(nothing, REFERENCE) == 0.0
    assert hypervolume_history(nothing, REFERENCE).shape == (0,)
    assert knee_index(nothing, REFERENCE) is None
    assert paper_solution_indices(nothing, REFERENCE) is None
    assert FrontTracker(2, REFERENCE).size == 0
    assert FrontTracker(2, REFERENCE).hypervolume == 0.0


@given(POINTS | ANYWHERE)
def test_default_reference_point_bounds_the_front(values: np.ndarray) -> None:
    """The point is 1.1 times the worst values of the front and never 0."""
    point = default_reference_point(values)
    front = NonDominatedSorting().do(values, only_non_dominated_front=True)
    assert point == pytest.approx(np.maximum(1.1 * values[front].max(axis=0), 1e-9), rel=1e-12)
    assert default_reference_point(values[front]) == point
    assert min(point) > 0.0
    if values[front].min() > 1e-6:
        assert hypervolume(values, point) > 0.0


@given(POINTS | ANYWHERE)
def test_paper_solutions_are_the_ends_of_the_front_in_the_box(values: np.ndarray) -> None:
    """docs/method.md §7: the front's designs of least E_pos and of least E_torque within the reference box."""
    inside = [i for i in np.flatnonzero(front_mask(values)) if np.all(values[i] < REFERENCE)]
    solutions = paper_solution_indices(values, REFERENCE)
    if not inside:
        assert solutions is None
        return
    assert solutions == (min(inside, key=lambda i: values[i, 0]), min(inside, key=lambda i: values[i, 1]))
    assert all(type(number) is int for number in solutions)


@given(POINTS | ANYWHERE)
def test_knee_is_farthest_below_the_line_between_the_ends(values: np.ndarray) -> None:
    inside = [i for i in front_indices(values) if np.all(values[i] < REFERENCE)]
    knee = knee_index(values, REFERENCE)
    if len(inside) < 3:
        assert knee is None
        return
    first, last = values[inside[0]], values[inside[-1]]
    normal = np.array([first[1] - last[1], last[0] - first[0]])  # towards greater values, in the units of both
    below = {i: float((first - values[i]) @ normal) / float(normal[0] * normal[1]) for i in inside}
    assert knee in inside
    assert below[knee] == pytest.approx(max(below.values()), abs=1e-9)
