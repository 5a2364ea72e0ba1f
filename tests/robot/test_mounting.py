"""Existing arms whose base is moved and turned, against Pinocchio."""

import math
from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.robot.mounting import Mounting, mounted, needs_turning, turned
from armwright.robot.urdf_reader import read_urdf
from tests.support.robots import any_arm, robot
from tests.support.urdf_peers import differences, random_states, seen_by_kernels, seen_by_pinocchio


@pytest.mark.parametrize("name", ["ur5_robot", "panda", "so101", "kuka", "double_pendulum_continuous"])
@pytest.mark.parametrize("yaw", [-3.1, 0.0, 2.2])
def test_turned_arm_is_where_pinocchio_sees_it(name: str, yaw: float) -> None:
    """The same joint values move and load the arm as before, in another place."""
    plain = read_urdf(robot(name))
    place = Mounting((0.3, -0.2, 0.5), yaw)
    there = mounted(plain, place)
    states = random_states(there.arm, 20, seed=4)
    theirs, ours = seen_by_pinocchio(robot(name), plain, states), seen_by_kernels(there.arm, states)
    pose = pinocchio.SE3(pinocchio.utils.rotate("z", yaw), np.array(place.position))
    moved = replace(
        theirs, tip=np.array([pose.act(tip) for tip in theirs.tip]), rotation=pose.rotation @ theirs.rotation
    )
    assert max(differences(ours, moved).values()) < 1e-7


@pytest.mark.parametrize("seed", range(4))
def test_turned_arm_keeps_its_clearances(seed: int) -> None:
    arm, rng = any_arm(seed), np.random.default_rng(seed)
    other = turned(arm, Rotation.random(random_state=seed).as_matrix())
    q = rng.uniform(-0.3, 0.3, (1, 20, len(arm.joints)))
    before, after = (clearances(stack_arms([one], "float64"), q)[0] for one in (arm, other))
    assert after == pytest.approx(before, abs=1e-9)


def test_only_arms_whose_first_joint_makes_no_full_turn_need_turning() -> None:
    assert not needs_turning(read_urdf(robot("ur5_robot")).arm)
    assert needs_turning(read_urdf(robot("panda")).arm)
    assert needs_turning(read_urdf(robot("double_pendulum_continuous")).arm)  # its first axis is level


@pytest.mark.parametrize("numbers", [(0.0, 0.0), (0.0, 0.0, math.nan), (0.0, 0.0, 0.0, math.inf), (0.0,) * 5])
def test_other_numbers_are_no_mounting(numbers: tuple[float, ...]) -> None:
    with pytest.raises(SettingsError, match="three finite numbers for the base"):
        Mounting.of(numbers)
