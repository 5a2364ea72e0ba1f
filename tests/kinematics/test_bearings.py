"""Loads across the axes of joints, against Pinocchio's joint wrenches, and payloads that bearings carry."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.cycle.torque_terms import torque_terms
from armwright.problem.compliance_quantities import payload_capacity
from armwright.problem.drive_quantities import (
    axial_force,
    bearing_utilisation,
    radial_force,
    tilting_moment,
    torque_utilisation,
)
from armwright.problem.evaluation import Evaluation, evaluate
from armwright.robot.arm import GRAVITY, Actuator, Arm, Joint, uniform_link
from armwright.tasks.moments import MAX_MASS
from tests.support.arms import moving_arms
from tests.support.cycles import DRIVE, Case, own_joints, random_case
from tests.support.exported_arms import Peer, carrying_peer, moving, peer_of
from tests.support.reference_kinematics import Array

PAYLOAD = {"mass": 0.8, "center": [0.02, -0.01, 0.05], "size": [0.06, 0.04, 0.1]}
OFFSET = 0.02  # [m] of the bearings
MOTOR = replace(DRIVE, bearing_offset=OFFSET, tilting_limit=30.0, axial_limit=90.0)
CASES = [(4, "axis", 7), (6, "orientation", 10), (6, "axis", 11), (6, "axis", 8)]  # of arms that follow their cycle


@cache
def case(dof: int, kind: str, seed: int) -> tuple[Case, Evaluation]:
    found = random_case(dof, kind, seed, n=1, drive=MOTOR, time=1.5, picks=True, payload=PAYLOAD, dwell=0.3)
    return found, evaluate(found.arms, found.task)


def loaded_peer(found: Case, row: int, carries: bool) -> Peer:
    payload = found.task.payload
    body = pinocchio.Inertia(payload.mass, np.array(payload.center), payload.mass * np.diag(payload.shape.gyration))
    return carrying_peer(found.arms[row], body) if carries else peer_of(found.arms[row])


def joint_wrenches(peer: Peer, q: Array, v: Array, a: Array) -> Array:
    """(S, D, 6) of the joints that move in S states: force and moment on what they move, in its frame [N], [N m]."""
    found: list[Array] = []
    for state in zip(q, v, a, strict=True):
        pinocchio.rnea(peer.model, peer.data, *state)
        found.append([peer.data.f[joint].vector.copy() for joint in range(1, peer.model.njoints)])
    return np.array(found)


def rates(share: Array, time: float) -> tuple[Array, Array]:
    """(S,) s' and s'' of the profile 10 τ³ - 15 τ⁴ + 6 τ⁵ where it is at these shares of the way."""
    profile = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    tau = np.interp(share, profile(fine := np.linspace(0.0, 1.0, 100_001)), fine)
    return profile.deriv()(tau) / time, profile.deriv(2)(tau) / time**2


@pytest.mark.parametrize(("dof", "kind", "seed"), CASES)
def test_wrenches_along_a_whole_cycle_agree_with_pinocchio(dof: int, kind: str, seed: int) -> None:
    """About the joints, at the samples that instants need, without and with the payload."""
    found, evaluation = case(dof, kind, seed)
    of_groups = torque_terms(evaluation.paths, found.task.payload.mass, wrenches=True)
    for group, own in zip(evaluation.paths.loaded, of_groups, strict=True):
        picked, begin = group.picks(evaluation.paths), np.cumsum([0, *group.counts])
        for (at, row), i in product(enumerate(group.index), range(len(group.paths))):
            if group.source[at, i] != i:
                continue
            arm, path, samples = found.arms[row], group.paths[i], picked.motion_of == i
            rows = picked.sample[samples] - begin[i]
            s, ss = rates(path.share[rows], evaluation.loads.durations[row, i])
            values = [np.broadcast_to(path.at(path.share, n), path.q.shape)[at, rows] for n in range(3)]
            q, q_s, q_ss = (own_joints(arm, each) for each in values)
            acceleration = q_ss * s[:, None] ** 2 + q_s * ss[:, None]
            gravity, drag, push = (own.wrenches[at, samples, n::3] for n in range(3))  # (P, 2, D, 6) arm and payload
            parts = gravity + drag * (s**2)[:, None, None, None] + push * ss[:, None, None, None]
            for carries in (False, True):
                theirs = joint_wrenches(loaded_peer(found, row, carries), q, q_s * s[:, None], acceleration)
                ours = parts[:, 0] + carries * parts[:, 1]
                ours = ours[:, [number - 1 for number, _ in moving(arm)]].reshape(theirs.shape)
                assert np.abs(ours - theirs).max() <= 1e-6 * max(1.0, np.abs(theirs).max())


@pytest.mark.parametrize(("dof", "kind", "seed"), CASES)
def test_largest_loads_are_those_of_pinocchio_about_the_bearings(dof: int, kind: str, seed: int) -> None:
    """Of paths without sharp parts, between whose samples the loads are interpolated; slides carry nothing."""
    found, evaluation = case(dof, kind, seed)
    tau = np.linspace(0.0, 1.0, 33)
    profile = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    rate, change = profile.deriv()(tau)[:, None], profile.deriv(2)(tau)[:, None]
    smooth = [row for group in evaluation.paths.loaded if not group.is_sharp for row in group.index]
    assert smooth
    for row in smooth:
        arm, largest = found.arms[row], np.zeros(3)
        for i, path in enumerate(evaluation.paths.of_arm(row)[1]):
            time = evaluation.loads.durations[row, i]
            shape = (1, len(tau), path.q.shape[2])
            values = [np.broadcast_to(path.at(profile(tau), n), shape)[0] for n in range(3)]
            q, q_s, q_ss = (own_joints(arm, each) for each in values)
            state = q, q_s * rate / time, (q_ss * rate**2 + q_s * change) / time**2
            wrenches = joint_wrenches(loaded_peer(found, row, path.motion.carries), *state)
            for k, (_, joint) in enumerate(moving(arm)):
                axis = np.eye(3)["xyz".index(joint.axis)]
                force, moment = wrenches[:, k, :3], wrenches[:, k, 3:]
                tilts = [moment - np.cross(side * OFFSET * axis, force) for side in (-1.0, 1.0)]
                tilting = max(np.linalg.norm(np.cross(axis, tilt), axis=1).max() for tilt in tilts)
                axial, radial = np.abs(force @ axis).max(), np.linalg.norm(np.cross(axis, force), axis=1).max()
                largest = np.maximum(largest, (joint.kind == "revolute") * np.array([tilting, axial, radial]))
        ours = [quantity(evaluation)[row] for quantity in (tilting_moment, axial_force, radial_force)]
        assert ours == pytest.approx(list(largest), rel=8e-2, abs=1e-6)
        shares = evaluation.bearing_loads[row] / (30.0, 90.0, np.inf)
        assert bearing_utilisation(evaluation)[row] == pytest.approx(shares.max())


def scara(motor: Actuator) -> Arm:
    """Two upright axes that carry links of 0.3 m and 0.2 kg each."""
    joints = (Joint("revolute", "z", -2.0, 2.0, motor),) * 2
    return Arm((0.0, 0.0, 0.0), joints, (uniform_link((0.3, 0.0, 0.0), 0.2, 0.01),) * 2, safety_factor=2.0)


def at_rest(motor: Actuator, payload: float) -> Evaluation:
    """The arm stretched along x."""
    return evaluate([scara(motor)], [[0.6, 0.0, 0.0]], payload=payload)


def test_loads_of_an_arm_at_rest_have_the_closed_form() -> None:
    evaluation = at_rest(Actuator("m", 0.0, 5.0, bearing_offset=0.01), 1.5)
    assert tilting_moment(evaluation) == pytest.approx((0.2 * 0.15 + 0.2 * 0.45 + 1.5 * 0.6) * GRAVITY, rel=1e-4)
    assert axial_force(evaluation) == pytest.approx(1.9 * GRAVITY)
    assert radial_force(evaluation) == pytest.approx(0.0, abs=1e-9)
    assert bearing_utilisation(evaluation).tolist() == [0.0]  # no limit is stated


@pytest.mark.parametrize(
    ("limits", "capacity"),
    [
        ({}, (5.0 / 2.0 / GRAVITY - 0.12) / 0.6),  # no joint may be tilted by more than the motors can turn
        ({"tilting_limit": 12.0}, (12.0 / GRAVITY - 0.12) / 0.6),
        ({"tilting_limit": 1.0}, 0.0),
        ({"tilting_limit": 1e9}, MAX_MASS),
        ({"tilting_limit": 12.0, "axial_limit": 10.0}, 10.0 / GRAVITY - 0.4),
        ({"tilting_limit": 12.0, "radial_limit": 10.0}, (12.0 / GRAVITY - 0.12) / 0.6),
    ],
)
def test_upright_axes_hold_what_their_bearings_carry(limits: dict[str, float], capacity: float) -> None:
    motor = Actuator("m", 0.0, 5.0, bearing_offset=0.0, **limits)
    assert payload_capacity(at_rest(motor, 0.3)) == pytest.approx(capacity, rel=1e-4)


def test_arms_are_at_a_limit_with_the_largest_payload() -> None:
    """The postures do not depend on the payload."""
    motor = Actuator("m", 0.0, 12.0, bearing_offset=0.01, tilting_limit=15.0, axial_limit=60.0, radial_limit=60.0)
    targets, by_torque = [[0.3, 0.2, 0.1], [-0.2, 0.4, 0.3], [0.1, -0.3, -0.2]], 0
    for arm in moving_arms(12, 5, 3):
        driven = replace(arm, joints=tuple(replace(joint, actuator=motor) for joint in arm.joints))
        capacity = payload_capacity.each(evaluate([driven], targets, payload=0.3))[0]
        full = evaluate([driven], targets, payload=capacity)
        across, torque = bearing_utilisation.each(full)[0], torque_utilisation.each(full)[0]
        assert np.maximum(across, torque)[capacity > 0.0] == pytest.approx(1.0, rel=1e-4)
        by_torque += (torque > across).sum()
    assert 0 < by_torque < 36
