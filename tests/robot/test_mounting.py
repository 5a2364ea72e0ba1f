"""Existing arms whose base is moved and turned, against Pinocchio."""

import math

import numpy as np
import pinocchio
import pytest

from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.ik.ik import solve_postures
from armwright.robot.mounting import Mounting, can_turn, mounted, needs_turning
from armwright.robot.urdf_reader import read_urdf
from tests.robot.test_urdf_reader import random_values, seen_by_pinocchio
from tests.support.robots import robot

TURNED = ("ur5_robot", "panda", "z1", "kinova", "xarm7", "so101", "kuka")


@pytest.mark.parametrize("name", TURNED)
@pytest.mark.parametrize("yaw", [-3.1, -0.7, 0.0, 2.2])
def test_tool_of_a_turned_arm_is_where_pinocchio_sees_it(name: str, yaw: float) -> None:
    """Compare positions of the tool and its rotations between postures in the world, and the joints' torques."""
    plain = read_urdf(robot(name))
    place = Mounting((0.3, -0.2, 0.5), yaw)
    there = mounted(plain, place)
    q = random_values(there.arm, 20, seed=4)
    tips, rotations, torques = seen_by_pinocchio(robot(name), there, q, payload=0.0)
    pose = pinocchio.SE3(pinocchio.utils.rotate("z", yaw), np.array(place.position))
    arrays = stack_arms([there.arm], "float64")
    ours = solve_postures(arrays, np.zeros((20, 3)), 0, initial_q=q[None], precision="float64")
    assert np.abs(ours.reached[0] - [pose.act(tip) for tip in tips]).max() < 5e-5
    turns = pose.rotation @ rotations @ rotations[0].T @ pose.rotation.T
    frames = forward_kinematics(arrays, q[None]).rotation[0, :, -1]
    assert np.abs(frames @ frames[0].T - turns).max() < 5e-5  # URDFs round their angles
    assert np.abs(ours.torque[0] - torques).max() < 1e-3 * np.abs(torques).max()


@pytest.mark.parametrize("name", TURNED)
@pytest.mark.parametrize("yaw", [-3.1, -0.7, 2.2])
def test_turned_arm_has_the_limits_of_its_urdf(name: str, yaw: float) -> None:
    plain = read_urdf(robot(name))
    there = mounted(plain, Mounting(yaw=yaw))
    before, after = (
        np.sort(
            [one.values_in_urdf([getattr(joint, end) for joint in one.arm.joints]) for end in ("lower", "upper")], 0
        )
        for one in (plain, there)
    )
    if needs_turning(plain.arm):
        assert after == pytest.approx(before, abs=1e-12)
    else:
        assert after[:, 1:] == pytest.approx(before[:, 1:], abs=1e-12)
        assert before[0, 0] - 1e-12 <= after[0, 0] <= after[1, 0] - 2 * math.pi <= before[1, 0] - 2 * math.pi + 1e-12


def test_only_arms_whose_first_joint_makes_no_full_turn_need_turning() -> None:
    assert not needs_turning(read_urdf(robot("ur5_robot")).arm)
    assert needs_turning(read_urdf(robot("panda")).arm)
    lying = read_urdf(robot("double_pendulum_continuous"))
    assert not can_turn(lying.arm)
    assert mounted(lying, Mounting((1.0, 0.0, 0.0))).arm.base[0] == lying.arm.base[0] + 1.0
    with pytest.raises(SettingsError, match=r"base turned by 5\.7.*°: expected an arm whose first joint"):
        mounted(lying, Mounting(yaw=0.1))


@pytest.mark.parametrize("numbers", [(0.0, 0.0), (0.0, 0.0, math.nan), (0.0, 0.0, 0.0, math.inf), (0.0,) * 5])
def test_other_numbers_are_no_mounting(numbers: tuple[float, ...]) -> None:
    with pytest.raises(SettingsError, match="three finite numbers for the base"):
        Mounting.of(numbers)
