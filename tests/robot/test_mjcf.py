"""MJCF in MuJoCo, against the URDF in Pinocchio and the plain reference."""

from itertools import pairwise

import mujoco
import numpy as np
import pinocchio
import pytest

from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.mjcf import to_mjcf
from tests.support import reference_kinematics as reference
from tests.support.arms import general_arms, paper_arms
from tests.support.exported_arms import ARMS as EXPORTED
from tests.support.exported_arms import BARE, MIXED, moving, peer_of, postures
from tests.support.reference_kinematics import Array

TURNING = [*paper_arms(2, 4, 31), *(arm for dof in range(1, 9) for arm in general_arms(2, dof, 32))]
ARMS = [*TURNING, BARE]


class Simulated:
    """An arm in MuJoCo, from its MJCF as it stands."""

    def __init__(self, arm: Arm, name: str = "arm") -> None:
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(arm, name))
        self.data = mujoco.MjData(self.model)

    def put(self, q: Array, speed: Array | float = 0.0, ctrl: Array | float = 0.0) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:], self.data.ctrl[:] = q, speed, ctrl
        mujoco.mj_forward(self.model, self.data)


def test_names_limits_and_masses() -> None:
    for arm in ARMS:
        model = Simulated(arm).model
        numbers = [number for number, _ in moving(arm)]
        links = [f"link_{number}" for number in range(1, len(arm.links) + 1)]
        assert [model.body(i).name for i in range(model.nbody)] == ["world", "base", *links]
        assert [model.joint(i).name for i in range(model.njnt)] == [f"joint_{number}" for number in numbers]
        assert [model.actuator(i).name for i in range(model.nu)] == [f"motor_{number}" for number in numbers]
        assert np.allclose(model.body("base").pos, arm.base)
        assert np.allclose(model.opt.gravity, [0.0, 0.0, -reference.GRAVITY])
        assert np.allclose(model.jnt_range, [[joint.lower, joint.upper] for _, joint in moving(arm)], rtol=1e-9)
        assert np.all(model.jnt_limited)
        assert not np.any(model.actuator_ctrllimited)
        assert not np.any(model.actuator_forcelimited)
        kinds = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}
        for i, (_, joint) in enumerate(moving(arm)):
            assert model.jnt_type[i] == kinds[joint.kind]
            assert np.array_equal(model.jnt_axis[i], np.eye(3)["xyz".index(joint.axis)])
        stated = [link.mass for link in arm.links]
        assert np.allclose(model.body_mass, [0.0, 0.0, *stated], rtol=1e-9, atol=1e-11)  # nor has the base any


def test_mjcf_motion_matches_the_urdf() -> None:
    """Any torques on joints that move anyhow: Pinocchio's inverse dynamics of MuJoCo's accelerations gives them back.

    So inertias, centres of mass, motors and the tip are the URDF's, each motor on its own joint.
    """
    rng = np.random.default_rng(35)
    for arm in [*TURNING, BARE, *EXPORTED]:
        simulated = Simulated(arm)
        peer = peer_of(arm)
        for q in postures(arm):
            speed, ctrl = rng.uniform(-3.0, 3.0, (2, len(q)))
            simulated.put(q, speed, ctrl)
            needed = pinocchio.rnea(peer.model, peer.data, q, speed, simulated.data.qacc)
            assert np.abs(needed - ctrl).max() < 1e-8
            tip, pose = simulated.data.site("tip"), peer.tip(q)
            assert np.abs(tip.xpos - pose[:3, 3]).max() < 1e-9
            assert np.abs(tip.xmat.reshape(3, 3) - pose[:3, :3]).max() < 1e-9


def test_sliding_joint_has_the_force_of_its_actuator() -> None:
    """Effort over travel and speed times travel: 1.5 N m at 0.02 m/rad are 75 N; 4 rad/s are 0.08 m/s."""
    model = peer_of(MIXED).model
    assert (model.upperEffortLimit[0], model.upperVelocityLimit[0]) == pytest.approx((75.0, 0.08))
    assert Simulated(MIXED).model.actuator_ctrlrange[0] == pytest.approx([-75.0, 75.0])


def test_mjcf_geometry_has_no_contacts() -> None:
    """A folded arm has no contacts; each link has a visual cylinder and each joint a ball."""
    joints = tuple(Joint("revolute", "y", -3.2, 3.2) for _ in range(4))
    arm = Arm((0.0, 0.0, 0.5), joints, (uniform_link((0.0, 0.0, 0.2), 0.5, 0.03),) * 4)
    simulated = Simulated(arm)
    simulated.put(np.array([0.0, np.pi, np.pi, np.pi]))
    assert simulated.data.ncon == 0
    kinds = [mujoco.mjtGeom(kind).name for kind in simulated.model.geom_type]
    assert kinds == ["mjGEOM_CYLINDER", "mjGEOM_SPHERE"] * 4


def test_cylinders_reach_from_joint_to_joint() -> None:
    """Only for arms without slides, which stand beyond the end of the link before them."""
    for arm in TURNING:
        simulated = Simulated(arm)
        model, data = simulated.model, simulated.data
        simulated.put(postures(arm, 1)[0])
        ends = [*data.xpos[2:], data.site("tip").xpos]
        drawn = [i for i in range(model.ngeom) if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CYLINDER]
        assert len(drawn) == len(arm.links)
        for i, (start, end), link in zip(drawn, pairwise(ends), arm.links, strict=True):
            half = model.geom_size[i, 1] * data.geom_xmat[i].reshape(3, 3)[:, 2]
            assert np.abs(data.geom_xpos[i] - half - start).max() < 1e-9
            assert np.abs(data.geom_xpos[i] + half - end).max() < 1e-9
            assert model.geom_size[i, 0] == pytest.approx(link.radius)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.2), (0.0, 0.0, 0.0), (1e-15, 0.0, 0.0)])
@pytest.mark.parametrize("mass", [0.0, 1e-13])
def test_massless_arm_compiles(offset: tuple[float, float, float], mass: float) -> None:
    link = Link(offset, mass, (0.0, 0.0, 0.1), 0.015)
    for kind in ("revolute", "prismatic"):
        simulated = Simulated(Arm((0.0, 0.0, 0.0), (Joint(kind, "y", -1.0, 1.0),) * 2, (link, link)))
        simulated.put(np.array([0.3, -0.2]))
        assert simulated.model.body_mass.sum() < 1e-11
        assert np.abs(simulated.data.qfrc_bias).max() < 1e-10
        mujoco.mj_step(simulated.model, simulated.data, 10)
        assert np.all(np.isfinite(simulated.data.qpos))
