"""Torques along cycles, against Pinocchio, MuJoCo and finer integration."""

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.cycle.cycle_loads import CycleLoads, cycle_loads
from armwright.kinematics.cycle.cycle_path import BETWEEN_INSTANTS, find_paths
from armwright.kinematics.cycle.instants import INSTANTS
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.cycle.torque_terms import torque_terms
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.robot.mjcf import to_mjcf
from armwright.tasks.payload import Payload
from armwright.tasks.task import Task
from tests.support.cycles import COULOMB, DRIVE, INERTIA, VISCOUS, Case, own_joints, random_case, tolerated
from tests.support.exported_arms import Peer, carrying_peer, load, moving, peer_of
from tests.support.reference_kinematics import Array

PAYLOAD = {"mass": 0.8, "center": [0.02, -0.01, 0.05], "size": [0.06, 0.04, 0.1]}
KINDS = [(3, "position"), (4, "axis"), (5, "position"), (6, "axis"), (6, "orientation"), (7, "position")]
CASES = [(dof, kind, seed) for dof, kind in KINDS for seed in (7, 10, 11)]  # of arms that follow their cycle
CYCLE: dict[str, Any] = {"picks": True, "payload": PAYLOAD, "dwell": 0.3}


@cache
def case(dof: int, kind: str, seed: int = 7, driven: bool = False, time: float = 1.5) -> Case:
    return random_case(dof, kind, seed, n=1, drive=DRIVE if driven else None, time=time, **CYCLE)


def loads(found: Case) -> CycleLoads:
    return cycle_loads(found.paths, torque_terms(found.paths, found.task.payloads.max()))


def is_sharp(found: Case, row: int) -> bool:
    """Whether the largest values around each instant are kept, because the path may pass through a short peak."""
    return any(group.is_sharp for group in found.paths.groups if row in group.index)


def smooth_rows(found: Case) -> list[int]:
    return [row for row in range(len(found.arms)) if not is_sharp(found, row)]


def loaded_peer(arm: Arm, payload: Any, carries: bool) -> Peer:
    """Pinocchio's model of an arm, with the payload in its tip frame if it carries it."""
    gyration = np.diag(payload.shape.gyration)
    body = pinocchio.Inertia(payload.mass, np.array(payload.center), payload.mass * gyration)
    return carrying_peer(arm, body) if carries else peer_of(arm)


def rnea(peer: Peer, q: Array, v: Array, a: Array) -> Array:
    """(S, D) torques [N m] of S states."""
    return np.array([pinocchio.rnea(peer.model, peer.data, *state) for state in zip(q, v, a, strict=True)])


def profile(tau: Array) -> tuple[Array, Array, Array]:
    """Share of the way at shares of the time, and its derivatives: 10 τ³ - 15 τ⁴ + 6 τ⁵."""
    polynomial = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    return polynomial(tau), polynomial.deriv()(tau), polynomial.deriv(2)(tau)


def states(arm: Arm, path: MotionPath, tau: Array, duration: float) -> tuple[Array, Array, Array]:
    """(F, D) values, speeds and accelerations of the joints that move, at shares of the time of a motion."""
    s, rate, change = profile(tau)
    q, q_s, q_ss = (own_joints(arm, np.broadcast_to(path.at(s, n), (1, len(s), path.q.shape[2]))[0]) for n in range(3))
    rate, change = rate[:, None] / duration, change[:, None] / duration**2
    return q, q_s * rate, q_ss * rate**2 + q_s * change


@pytest.mark.parametrize(("dof", "kind", "seed"), CASES)
def test_torque_terms_agree_with_pinocchio(dof: int, kind: str, seed: int) -> None:
    """Gravity, Coriolis terms and the mass matrix, with a tool, with and without the payload."""
    found = case(dof, kind, seed)
    terms = torque_terms(found.paths, found.task.payloads.max())
    carried = {motion.carries for motion in found.plan.motions}
    assert carried == {True, False}
    for group, own in zip(found.paths.loaded, terms, strict=True):
        for at, row in enumerate(group.index):
            arm, begin = found.arms[row], np.cumsum([0, *group.counts])
            picked = group.picks(found.paths)
            for index, path in enumerate(group.paths):
                if group.source[at, index] != index:
                    continue
                peer = loaded_peer(arm, found.task.payload, carries=True)
                (of_motion,) = np.nonzero(picked.motion_of == index)
                samples = of_motion[np.linspace(0, len(of_motion) - 1, 4).astype(int)]
                q = own_joints(arm, path.q[at, picked.sample[samples] - begin[index]])
                q_s, q_ss = (own_joints(arm, values) for values in own.states[at, samples].swapaxes(0, 1))
                still = np.zeros_like(q)
                gravity = rnea(peer, q, still, still)
                push = np.array([peer.mass_matrix(a) @ b for a, b in zip(q, q_s, strict=True)])
                drag = rnea(peer, q, q_s, q_ss) - gravity
                size = load(arm) + np.abs(q_s).max() ** 2 + np.abs(q_ss).max()
                bare = loaded_peer(arm, found.task.payload, carries=False)
                resting = rnea(bare, q, still, still)
                bare_push = np.array([bare.mass_matrix(a) @ b for a, b in zip(q, q_s, strict=True)])
                alone = (resting, rnea(bare, q, q_s, q_ss) - resting, bare_push)
                added = tuple(all_of - part for all_of, part in zip((gravity, drag, push), alone, strict=True))
                ours = own.torques[at, samples].swapaxes(0, 1)
                for mine, theirs in zip(ours, (*alone, *added), strict=True):
                    assert own_joints(arm, mine) == pytest.approx(theirs, rel=1e-7, abs=1e-8 * size)


@pytest.mark.parametrize(("dof", "kind", "seed"), CASES)
def test_torques_in_motion_agree_with_mujoco(dof: int, kind: str, seed: int) -> None:
    """With the rotors as armature, viscous friction as damping, and Coulomb friction by hand.

    Between samples, torques are interpolated; they are exact at the ends and, if it is a sample, half way.
    """
    found = case(dof, kind, seed, driven=True)
    of_cycle, tau = loads(found), np.linspace(0.0, 1.0, INSTANTS)
    left_out = [0.0]
    for row in smooth_rows(found):
        arm = found.arms[row]
        own = [joint for _, joint in moving(arm)]
        travel = np.array([joint.travel for joint in own])
        model = mujoco.MjModel.from_xml_string(to_mjcf(arm))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
        model.dof_armature[:] = INERTIA / travel**2
        model.dof_damping[:] = VISCOUS / travel**2
        data = mujoco.MjData(model)
        for i, path in enumerate(found.paths.of_arm(row)[1]):
            if path.motion.carries:
                continue
            q, v, a = states(arm, path, tau, of_cycle.durations[row, i])
            theirs = np.empty_like(q)
            for k in range(INSTANTS):
                data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
                mujoco.mj_inverse(model, data)
                theirs[k] = data.qfrc_inverse + COULOMB / travel * np.sign(v[k]) * (np.abs(v[k]) > 1e-9)
            mine = own_joints(arm, of_cycle.torques[row, i])
            barely = (np.abs(v) > 1e-9) & (np.abs(v) < 1e-3)  # where the sign of the interpolated speed is not certain
            mine, theirs = np.where(barely, 0.0, mine), np.where(barely, 0.0, theirs)
            left_out.append(barely.mean())
            size = np.abs(theirs).max()
            exact = [0, INSTANTS - 1, *([INSTANTS // 2] if path.q.shape[1] % 2 else [])]
            assert mine[exact] == pytest.approx(theirs[exact], rel=1e-6, abs=1e-6 * size)
            if tolerated(found.paths)[row]:
                assert mine == pytest.approx(theirs, abs=0.05 * size)
    assert np.mean(left_out) < 0.5


def test_durations_of_the_motions_of_a_step_add_up_to_its_time() -> None:
    found = random_case(6, "axis", seed=7, n=1, time=1.5, approach=0.03, **CYCLE)
    of_cycle = loads(found)
    for step in range(3):
        own = [i for i, motion in enumerate(found.plan.motions) if motion.step == step]
        assert len(own) >= 2
        assert of_cycle.durations[:, own].sum(axis=1) == pytest.approx(1.5)
    assert of_cycle.cycle_time == pytest.approx(3 * 1.5 + 2 * 0.3)  # dwells after pick and place


@pytest.mark.parametrize(("dof", "kind", "seed"), CASES)
def test_rms_torques_agree_with_fine_integration(dof: int, kind: str, seed: int) -> None:
    """Pinocchio's torques at 801 instants of each motion, and the holding torques of the dwells."""
    found = case(dof, kind, seed)
    of_cycle, tau = loads(found), np.linspace(0.0, 1.0, 801)
    good = np.flatnonzero(tolerated(found.paths))
    assert len(good)
    for row in good:
        arm = found.arms[row]
        total = np.zeros(len(moving(arm)))
        motions = found.paths.of_arm(row)[1]
        for i, path in enumerate(motions):
            duration = of_cycle.durations[row, i]
            peer = loaded_peer(arm, found.task.payload, path.motion.carries)
            torques = rnea(peer, *states(arm, path, tau, duration))
            total += np.trapezoid(torques**2, dx=duration / 800, axis=0)
            if of_cycle.dwells[i]:
                after = motions[(i + 1) % len(motions)]
                rest = loaded_peer(arm, found.task.payload, after.motion.carries)
                total += of_cycle.dwells[i] * rest.gravity(own_joints(arm, after.q[0])[0]) ** 2
        expected = np.sqrt(total / of_cycle.cycle_time[row])
        mine = own_joints(arm, of_cycle.rms_torques[[row]])[0]
        largest = 1.5 if is_sharp(found, row) else 1.01  # the largest values around each instant count
        assert (mine >= 0.99 * expected - 0.002 * expected.max()).all()
        assert (mine <= largest * expected + 0.002 * expected.max()).all()


def test_dwells_hold_what_was_picked() -> None:
    found = case(6, "axis")
    of_cycle = loads(found)
    dwells = {motion.step: dwell for motion, dwell in zip(found.plan.motions, of_cycle.dwells, strict=True)}
    assert dwells == {0: 0.3, 1: 0.3, 2: 0.0}  # pick, place, neither
    payload = found.task.payload
    assert isinstance(payload, Payload)
    for row, arm in enumerate(found.arms):
        for i, path in enumerate(found.paths.of_arm(row)[1]):
            carries = path.motion.step == 0  # it arrives with nothing, and picks
            q = own_joints(arm, path.q[0])[-1]
            expected = loaded_peer(arm, payload, carries).gravity(q)
            assert own_joints(arm, of_cycle.holding[row, [i]])[0] == pytest.approx(expected, abs=1e-7 * load(arm))


def test_open_cycles_dwell_where_they_end() -> None:
    found = random_case(6, "axis", seed=7, n=1, time=1.5, closed=False, **CYCLE)
    of_cycle = loads(found)
    assert [m.step for m in found.plan.motions] == [1, 2]
    assert of_cycle.dwells.tolist() == [0.3, 0.0]
    arm, (_, motions) = found.arms[0], found.paths.of_arm(0)
    q = own_joints(arm, motions[-1].q[0])[-1]
    expected = loaded_peer(arm, found.task.payload, carries=False).gravity(q)
    assert own_joints(arm, of_cycle.holding[[0], -1])[0] == pytest.approx(expected, abs=1e-7 * load(arm))


def test_most_cases_are_smooth_and_can_be_followed() -> None:
    good = [tolerated(case(*key).paths)[smooth_rows(case(*key))].any() for key in CASES]
    assert sum(good) >= len(CASES) - 1


def test_short_peaks_of_torque_and_speed_count() -> None:
    """Of a folded arm whose line passes 2 cm beside its base, against Pinocchio at 16 times as many instants."""
    joints = (Joint("revolute", "z", -3.1, 3.1), Joint("revolute", "z", -3.1, 3.1))
    arm = Arm((0.0, 0.0, 0.0), joints, tuple(uniform_link((0.3, 0.0, 0.0), 0.2, 0.01) for _ in joints))
    steps = [{"to": 1, "by": "line"}, {"to": 2, "by": "line"}]
    content = {
        "targets": [[0.3, 0.02, 0.0], [-0.3, 0.02, 0.0]],
        "cycle": {"closed": False, "time": 2.0, "steps": steps},
    }
    task = Task.model_validate({"name": "past-the-base", **content})
    arrays, plan = stack_arms([arm], "float64"), task.plan(task.target_positions)
    found = Case(task, (arm,), arrays, plan, find_paths(arrays, plan))
    assert tolerated(found.paths)[0]
    assert is_sharp(found, 0)
    of_cycle, tau = loads(found), np.linspace(0.0, 1.0, BETWEEN_INSTANTS * (INSTANTS - 1) + 1)
    q, v, a = states(arm, found.paths.of_arm(0)[1][0], tau, 2.0)
    theirs = np.abs(rnea(peer_of(arm), q, v, a))
    mine, speeds = np.abs(of_cycle.torques[0, 0]), np.abs(of_cycle.speeds[0, 0])
    assert mine.max(axis=0) == pytest.approx(theirs.max(axis=0), rel=0.02)
    assert speeds.max(axis=0) == pytest.approx(np.abs(v).max(axis=0), rel=0.02)
    assert theirs.max() > 1.5 * theirs[::BETWEEN_INSTANTS].max()  # 33 instants would miss the peak
