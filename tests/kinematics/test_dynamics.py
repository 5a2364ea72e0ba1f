"""Inverse dynamics against Pinocchio."""

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays, stack_arms
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.robot.arm import Arm
from tests.support.dynamics import inverse_dynamics
from tests.support.exported_arms import carrying_peer, odd_arms
from tests.support.reference_kinematics import Array


def random_states(seed: int, k: int) -> tuple[list[Arm], ArmArrays, Array, Array, Array]:
    """Arms with all kinds of joints and loads, and k postures, velocities and accelerations (N, k, D) of each."""
    arms = [arm for dof in range(1, 7) for arm in odd_arms(5, dof, seed)]
    arrays, rng = stack_arms(arms, "float64"), np.random.default_rng(seed)
    moves = (arrays.motion < FIXED)[:, None]
    q, v, a = (np.where(moves, rng.uniform(-size, size, (len(arms), k, arrays.dof)), 0.0) for size in (1.5, 3.0, 9.0))
    assert {joint.kind for arm in arms for joint in arm.joints} == {"revolute", "prismatic", "fixed"}
    return arms, arrays, q, v, a


def point_mass(mass: float) -> pinocchio.Inertia:
    return pinocchio.Inertia(mass, np.zeros(3), np.zeros((3, 3)))


def test_torques_agree_with_pinocchio() -> None:
    arms, arrays, q, v, a = random_states(1, 4)
    payload = np.array([0.0, 0.5, 1.0, 2.0])
    ours = inverse_dynamics(arrays, q, v, a, payload)
    for row, arm in enumerate(arms):
        moves = arrays.motion[row] < FIXED
        for k, mass in enumerate(payload):
            peer = carrying_peer(arm, point_mass(mass))
            theirs = pinocchio.rnea(peer.model, peer.data, *(some[row, k, moves] for some in (q, v, a)))
            # Files have ten digits, and small torques are what is left of large forces.
            size = max(1.0, np.abs(theirs).max())
            assert ours[row, k, moves] == pytest.approx(theirs, rel=1e-9, abs=1e-8 * size)
            assert not ours[row, k, ~moves].any()


def test_inertia_matrices_agree_with_pinocchio() -> None:
    arms, arrays, q, _, _ = random_states(11, 3)
    payload = np.array([0.0, 0.5, 2.0])
    ours = inertia_matrices(arrays, q, payload / 2.0, 2.0)
    for row, arm in enumerate(arms):
        moves = arrays.motion[row] < FIXED
        for k, mass in enumerate(payload):
            theirs = carrying_peer(arm, point_mass(mass)).mass_matrix(q[row, k, moves])
            mine = ours[row, k]
            assert mine[np.ix_(moves, moves)] == pytest.approx(theirs, rel=1e-9, abs=1e-9 * np.abs(theirs).max())
            assert not mine[~moves].any()
            assert not mine[:, ~moves].any()
