"""Inverse dynamics against Pinocchio, MuJoCo and energy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import FIXED, stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.robot.arm import AXES, Arm, Joint, Link, MountedTool
from armwright.robot.link_geometry import inertia_tensor
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from tests.support.dynamics import inverse_dynamics
from tests.support.exported_arms import a_body

Array = NDArray[np.float64]


def any_arms(n: int, seed: int) -> list[Arm]:
    """Of all kinds of joints, links in any direction, loads at their ends or off them, and tools."""
    rng, of_tools = np.random.default_rng(seed), np.random.default_rng([seed, 1])

    def vector(size: float) -> tuple[float, float, float]:
        x, y, z = np.round(rng.uniform(-size, size, 3), 3).tolist()
        return (x, y, z)

    def joint(kind: Any) -> Joint:
        axis = AXES[rng.integers(3)]
        limits = {"revolute": (-2.5, 2.0), "prismatic": (-0.1, 0.4), "fixed": (0.0, 0.0)}[kind]
        return Joint(kind, axis, *limits, travel=0.02 if kind == "prismatic" else 1.0)

    def link() -> Link:
        load = {"end_mass": 0.4, "end_shift": vector(0.1)} if rng.random() < 0.5 else {}
        offset = (0.0, 0.0, 0.0) if rng.random() < 0.2 else vector(0.3)
        return Link(offset, round(float(rng.uniform(0.05, 2.0)), 3), vector(0.2), 0.03, **load)

    arms: list[Arm] = []
    for _ in range(n):
        kinds = rng.choice(["revolute", "revolute", "prismatic", "fixed"], int(rng.integers(2, 7))).tolist()
        kinds[0] = kinds[0] if kinds[0] != "fixed" else "revolute"
        joints = tuple(map(joint, kinds))
        arm = Arm(vector(0.5), joints, tuple(link() for _ in kinds))
        arms.append(replace(arm, tool=MountedTool(vector(0.1), **a_body(of_tools))))
    return arms


def motions(arms: Sequence[Arm], k: int, seed: int) -> tuple[Any, Array, Array, Array]:
    """Arms as arrays, and postures, velocities, accelerations (N, k, D) at random; 0 where no joint moves."""
    arrays = stack_arms(arms, "float64")
    rng = np.random.default_rng(seed)
    there = (arrays.motion < FIXED)[:, None]
    q, v, a = (np.where(there, rng.uniform(-size, size, (len(arms), k, arrays.dof)), 0.0) for size in (1.5, 3.0, 9.0))
    return arrays, q, v, a


def loaded(arm: Arm, payload: float) -> Arm:
    """The same with a payload as a link of its own, fixed to the tip."""
    carried = Link(offset=(0.0, 0.0, 0.0), mass=payload, com=(0.0, 0.0, 0.0), radius=1e-9)
    end = Link(offset=arm.tool.tip, mass=0.0, com=(0.0, 0.0, 0.0), radius=1e-9)
    fixed, (x, y, z) = Joint("fixed", "x"), arm.tool.tip
    u, v, w = arm.tool.com
    tool = replace(arm.tool, tip=(0.0, 0.0, 0.0), com=(u - x, v - y, w - z))
    return Arm(arm.base, (*arm.joints, fixed, fixed), (*arm.links, end, carried), tool)


# Inverse dynamics


def test_inertia_equals_exported_files() -> None:
    arms = any_arms(60, 0)
    for precision in ("float32", "float64"):
        inertia = stack_arms(arms, precision).bodies.inertia
        for row, arm in enumerate(arms):
            expected = np.array([inertia_tensor(link) for link in arm.links])
            assert inertia[row, : len(arm.links)] == pytest.approx(expected, rel=1e-12, abs=1e-15)
            assert not inertia[row, len(arm.links) :].any()


def test_torques_agree_with_pinocchio() -> None:
    arms = any_arms(120, 1)
    arrays, q, v, a = motions(arms, 4, 2)
    payload = np.array([0.0, 0.5, 1.0, 2.0])
    ours = inverse_dynamics(arrays, q, v, a, payload)
    kinds = {joint.kind for arm in arms for joint in arm.joints}
    assert kinds == {"revolute", "prismatic", "fixed"}
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        for k, kg in enumerate(payload):
            model = pinocchio.buildModelFromXML(to_urdf(loaded(arm, kg)))
            mine = ours[row, k, : len(arm.joints)]
            of = [some[row, k, : len(arm.joints)][moving] for some in (q, v, a)]
            theirs = pinocchio.rnea(model, model.createData(), *of)
            # Files have ten digits, and small torques are what is left of large forces.
            assert mine[moving] == pytest.approx(theirs, rel=1e-9, abs=1e-9 * max(1.0, np.abs(theirs).max()))
            assert not mine[~moving].any()


def test_inertia_matrices_agree_with_pinocchio() -> None:
    arms = any_arms(60, 11)
    arrays, q, _, _ = motions(arms, 3, 12)
    payload = np.array([0.0, 0.5, 2.0])
    ours = inertia_matrices(arrays, q, payload / 2.0, 2.0)
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        for k, kg in enumerate(payload):
            model = pinocchio.buildModelFromXML(to_urdf(loaded(arm, kg)))
            own = slice(len(arm.joints))
            upper = np.triu(pinocchio.crba(model, model.createData(), q[row, k, own][moving]))
            theirs = upper + np.triu(upper, 1).T
            mine = ours[row, k, own, own]
            assert mine[np.ix_(moving, moving)] == pytest.approx(theirs, rel=1e-9, abs=1e-9 * np.abs(theirs).max())
            assert not mine[~moving].any()
            assert not mine[:, ~moving].any()


def test_torques_agree_with_mujoco() -> None:
    arms = any_arms(30, 3)
    arrays, q, v, a = motions(arms, 1, 4)
    ours = inverse_dynamics(arrays, q, v, a, np.array([0.7]))
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        model = mujoco.MjModel.from_xml_string(to_mjcf(loaded(arm, 0.7)))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:], data.qacc[:] = (s[row, 0, : len(arm.joints)][moving] for s in (q, v, a))
        mujoco.mj_inverse(model, data)
        mine = ours[row, 0, : len(arm.joints)][moving]
        assert mine == pytest.approx(data.qfrc_inverse, rel=1e-7, abs=1e-7 * max(1.0, np.abs(mine).max()))


def test_power_equals_change_of_energy() -> None:
    """Along any motion: v · torque = d(kinetic + potential)/dt, the energies by hand from the links' own motions."""
    arms = any_arms(20, 5)
    arrays, q, v, a = motions(arms, 1, 6)
    load = np.array([0.4])

    def energy(t: float) -> Array:
        at = q + v * t + 0.5 * a * t**2
        # v' M v / 2 from torques without gravity, of an acceleration v; and height from gravity as the only force
        speed = v + a * t
        kinetic = 0.5 * (speed * inverse_dynamics(arrays, at, 0.0 * v, speed, load, gravity=False)).sum(axis=(1, 2))
        frames = forward_kinematics(arrays, at)
        bodies = arrays.rigid_bodies
        heights = (frames.position + (frames.rotation @ bodies.com[:, None, :, :, None])[..., 0])[..., 2]
        potential = 9.81 * ((bodies.mass[:, None] * heights).sum(axis=2) + load * frames.tip[..., 2])
        return kinetic + potential[:, 0]

    h = 1e-5
    change = (energy(h) - energy(-h)) / (2 * h)
    power = (v * inverse_dynamics(arrays, q, v, a, load)).sum(axis=(1, 2))
    assert power == pytest.approx(change, rel=1e-6, abs=1e-5)
