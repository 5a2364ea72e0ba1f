"""Symmetry planes of known and of random mirrored sets."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from armwright.tasks.catalogue import random_task
from armwright.tasks.symmetry import centre, distance_to_planes, symmetry_planes

MILLIMETRES = st.integers(-1000, 1000).map(lambda mm: mm / 1000)
POINTS = arrays(float, st.tuples(st.integers(2, 8), st.just(3)), elements=MILLIMETRES)
ROTATIONS = arrays(float, (4,), elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 0.1)


def rotation(quaternion: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(quaternion).as_matrix()


def has(normals: np.ndarray, normal: np.ndarray) -> bool:
    return bool(np.any(np.abs(normals @ normal) > 1.0 - 1e-9))


@given(POINTS, ROTATIONS, arrays(float, (3,), elements=MILLIMETRES))
def test_rotated_mirrored_set_has_its_plane(half: np.ndarray, quaternion: np.ndarray, shift: np.ndarray) -> None:
    points = np.vstack([half, half * (1.0, -1.0, 1.0)])
    assume(np.abs(half[:, 1]).max() > 0.01)
    turn = rotation(quaternion)
    normals = symmetry_planes(points @ turn.T + shift)
    assert has(normals, turn @ (0.0, 1.0, 0.0))
    assert distance_to_planes(turn @ (0.3, 0.0, 0.7) + shift, points @ turn.T + shift, normals) < 1e-6


@given(POINTS, ROTATIONS)
def test_every_plane_mirrors_the_set_onto_itself(half: np.ndarray, quaternion: np.ndarray) -> None:
    assume(np.abs(half[:, 1]).max() > 0.01)
    points = np.vstack([half, half * (1.0, -1.0, 1.0)]) @ rotation(quaternion).T
    offsets = points - centre(points)
    planes = symmetry_planes(points)
    assert len(planes) > 0
    for normal in planes:
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        mirrored = offsets - 2.0 * np.outer(offsets @ normal, normal)
        apart = np.linalg.norm(mirrored[:, None] - offsets[None], axis=2)
        assert apart.min(axis=1).max() <= 1e-6 + 1e-12


@given(POINTS, st.randoms(use_true_random=False))
def test_planes_do_not_depend_on_order_and_duplicates(points: np.ndarray, random: object) -> None:
    order = [0, *range(len(points))]
    random.shuffle(order)  # type: ignore[attr-defined]
    assert symmetry_planes(points[order]).tolist() == symmetry_planes(points).tolist()


def test_random_sets_have_no_symmetry_plane() -> None:
    for seed in range(30):
        assert len(symmetry_planes(random_task(seed).target_positions)) == 0


def test_point_moved_beyond_the_tolerance_breaks_symmetry() -> None:
    rng = np.random.default_rng(0)
    half = rng.uniform(-1.0, 1.0, (5, 3))
    points = np.vstack([half, half * (1.0, -1.0, 1.0)])
    for moved, planes in ((1e-7, 1), (3e-5, 0)):
        points[0, 2] = half[0, 2] + moved
        assert len(symmetry_planes(points)) == planes


def test_line_has_its_bisecting_plane_and_a_point_none() -> None:
    """Planes through a line contain every point and are therefore omitted."""
    line = np.array([[0.1, 0.2, 0.3]]) + np.arange(5)[:, None] * np.array([[0.0, 0.3, 0.4]])
    assert symmetry_planes(line) == pytest.approx(np.array([[0.0, 0.6, 0.8]]))
    assert len(symmetry_planes(np.vstack([line, line[4] + np.array([0.0, 0.9, 1.2])]))) == 0
    assert symmetry_planes(line[:1]).shape == (0, 3)
    assert symmetry_planes(np.repeat(line[:1], 3, axis=0)).shape == (0, 3)
    assert distance_to_planes(line[0], line[:1], np.empty((0, 3))) == np.inf


def test_planes_of_many_points_are_found() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.full(120, 0.3)])
    assert len(symmetry_planes(ring)) == 121
    steps = np.arange(9) * 0.05
    grid = np.stack(np.meshgrid(steps, steps, 2 * steps), axis=-1).reshape(-1, 3)
    assert len(symmetry_planes(grid)) == 5
