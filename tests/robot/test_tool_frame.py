"""The tip frame of every export format."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations, product

import mujoco
import numpy as np
import pytest

from armwright.kinematics.arms.forward import joint_positions
from armwright.robot.arm import Arm, Joint, MountedTool
from armwright.robot.mjcf import to_mjcf
from tests.support.exported_arms import ARMS, full, peer_of, postures
from tests.support.reference_kinematics import Array


def in_mujoco(arm: Arm, q: Array) -> Array:
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.site("tip").xmat.reshape(3, 3), data.site("tip").xpos
    return pose


FORMATS: dict[str, Callable[[Arm, Array], Array]] = {
    "urdf": lambda arm, q: peer_of(arm).tip(q),
    "mjcf": in_mujoco,
}
EVERY_FORMAT = pytest.mark.parametrize("tip", FORMATS.values(), ids=FORMATS)


@EVERY_FORMAT
def test_tip_has_the_tool_orientation_at_zero(tip: Callable[[Arm, Array], Array]) -> None:
    """Check the 24 rotations of a cube and random ones."""
    signed = [
        (s * np.eye(3)[i], t * np.eye(3)[j])
        for i, j in permutations(range(3), 2)
        for s, t in product((1, -1), repeat=2)
    ]
    odd = [np.linalg.qr(np.random.default_rng(61 + n).normal(size=(3, 3)))[0][:2] for n in range(10)]
    joint = Joint("revolute", "y", -1.0, 1.0)
    for axis, side in [*signed, *odd]:
        arm = replace(ARMS[0], joints=(joint,) * 4, tool=MountedTool((0.1, 0.2, 0.3), tuple(axis), tuple(side)))
        pose = tip(arm, np.zeros(4))
        assert np.abs(pose[:3, 2] - axis).max() < 1e-9
        assert np.abs(pose[:3, 0] - side).max() < 1e-9


@EVERY_FORMAT
@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.fast_cases(3)
def test_exported_tip_pose_matches_the_arm(arm: Arm, tip: Callable[[Arm, Array], Array]) -> None:
    for q in postures(arm, 3):
        pose = tip(arm, q)
        assert np.abs(pose[:3, 3] - joint_positions(arm, full(arm, q))[-1]).max() < 1e-9
        assert np.abs(pose - peer_of(arm).tip(q)).max() < 1e-9


def test_sliding_joint_has_the_force_of_its_actuator() -> None:
    """Effort over travel and speed times travel: 1.5 N m at 0.02 m/rad are 75 N; 4 rad/s are 0.08 m/s."""
    arm = ARMS[-1]
    model = peer_of(arm).model
    assert model.upperEffortLimit[0] == pytest.approx(75.0)
    assert model.upperVelocityLimit[0] == pytest.approx(0.08)
    assert mujoco.MjModel.from_xml_string(to_mjcf(arm)).actuator_ctrlrange[0] == pytest.approx([-75.0, 75.0])
