"""Reach maps against Pinocchio, closed forms of simple arms, and postures known beforehand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio
import pytest

import armwright as aw
from armwright.exceptions import ArmError, SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.reach.reachable_poses import PoseSearch, sample_postures
from armwright.robot.arm import Actuator, Arm, Joint, MountedTool, uniform_link
from armwright.rotations import cone_directions
from armwright.tasks.obstacles import Ground
from tests.support.arms import paper_arms
from tests.support.exported_arms import peer_of
from tests.support.robots import robot

ROUNDING = 1e-5  # [m] or [rad] of float32 kinematics
UP = (0.0, 0.0, 1.0)


def planar_arm(upper: float, fore: float) -> Arm:
    """Return an arm of two links in the plane z = 0 that rotate all around z."""
    joints = tuple(Joint("revolute", "z", -math.pi, math.pi) for _ in range(2))
    return Arm(
        (0.0, 0.0, 0.0), joints, (uniform_link((upper, 0.0, 0.0), 1.0, 0.02), uniform_link((fore, 0.0, 0.0), 1.0, 0.02))
    )


def wrist_arm(upper: float, fore: float, hand: float, actuator: Actuator | None = None) -> Arm:
    """Return an arm of six joints with a spherical wrist, without limits."""
    joints = tuple(Joint("revolute", axis, -math.pi, math.pi, actuator) for axis in ("z", "y", "y", "z", "y", "z"))
    lengths = (0.0, upper, fore, 0.0, 0.0, hand)
    links = tuple(uniform_link((0.0, 0.0, length), 0.5 if length else 0.0, 0.02) for length in lengths)
    return Arm((0.0, 0.0, 0.0), joints, links)


def test_postures_of_a_urdf_are_those_of_its_joints() -> None:
    arm = aw.read_urdf(robot("ur5_robot"))
    pin: Any = pinocchio
    model = pin.buildModelFromUrdf(str(robot("ur5_robot")))
    data, frame = model.createData(), model.getFrameId(arm.tip)
    found = aw.reach_map(arm, spacing=0.4, n_directions=12)
    assert found.bare.share.max() == 1.0
    for point, direction in np.argwhere(found.bare.reached)[::5]:
        q = pin.neutral(model)
        for name, value in zip(arm.joints, found.bare.q[point, direction], strict=True):
            q[model.joints[model.getJointId(name)].idx_q] = value
        pin.framesForwardKinematics(model, data, q)
        tip = data.oMf[frame]
        assert np.linalg.norm(tip.translation - found.points[point]) < 1e-3 + ROUNDING
        assert np.linalg.norm(tip.rotation[:, 2] - found.directions[direction]) < 1e-3 + ROUNDING


def test_planar_arm_reaches_its_annulus() -> None:
    arm, box = planar_arm(0.5, 0.3), [(-1.0, -1.0, 0.0), (1.0, 1.0, 0.0)]
    found = aw.reach_map(arm, box=box, spacing=0.05, axis=UP, n_directions=1)
    distance = np.linalg.norm(found.points, axis=1)
    assert found.shape == (40, 40, 1)
    inside = (distance > 0.201) & (distance < 0.799)
    assert np.array_equal(found.bare.reached[:, 0], inside)
    down = aw.reach_map(arm, box=box, spacing=0.05, n_directions=1)
    assert not down.bare.reached.any()
    assert np.array_equal(down.bare.covered, inside), "points count in any direction of the tool"


def test_volume_is_that_of_the_sphere() -> None:
    found = aw.reach_map(wrist_arm(0.4, 0.4, 0.1), spacing=0.1, n_directions=1)
    assert found.bare.volume == pytest.approx(4 / 3 * math.pi * 0.9**3, rel=0.03)


@pytest.mark.slow
def test_spherical_wrist_reaches_all_directions_where_its_centre_can_be() -> None:
    arm = wrist_arm(0.5, 0.3, 0.1)
    found = aw.reach_map(arm, spacing=0.18, n_directions=30)
    distance = np.linalg.norm(found.points, axis=1)
    dexterous = (distance > 0.3) & (distance < 0.7)  # the centre between 0.2 and 0.8 in all directions
    assert dexterous.sum() > 100
    assert np.all(found.bare.share[dexterous] == 1.0)
    assert not found.bare.covered[distance > 0.901].any()
    assert np.all(found.bare.share[(distance < 0.25) | (distance > 0.75)] < 1.0)
    centre = np.linalg.norm(found.points[:, None] - 0.1 * found.directions, axis=-1)
    assert not found.bare.reached[(centre < 0.1985) | (centre > 0.8015)].any()
    possible = (centre > 0.205) & (centre < 0.795)
    assert found.bare.reached[possible].mean() > 0.99


@pytest.mark.slow
def test_poses_of_random_postures_are_found() -> None:
    for arm in [*paper_arms(4, 6, 5), aw.read_urdf(robot("ur5_robot")).arm, aw.read_urdf(robot("panda")).arm]:
        arrays = stack_arms([arm])
        known = sample_postures(arrays, 2**15 + 100)  # other postures than those that the search starts from
        tips, axes = known.tip[-100:], known.axis[-100:]
        search = PoseSearch(arrays, sample_postures(arrays), tips, axes, 1e-3, 1e-3)
        assert np.diag(search.find().reached).mean() >= 0.95


def test_directions_fill_their_cone_evenly() -> None:
    for axis, half_angle in (((1.0, 2.0, -0.5), 0.7), (UP, math.pi), ((0.0, 0.0, -1.0), 0.0)):
        directions = cone_directions(axis, half_angle, 200)
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
        along = directions @ np.array(axis) / np.linalg.norm(axis)
        assert along.min() >= math.cos(half_angle) - 1e-12
        # Archimedes: the mean along the axis is halfway between the ends of the cap.
        assert along.mean() == pytest.approx((1.0 + math.cos(half_angle)) / 2, abs=1e-3)
    assert cone_directions((0.0, 2.0, 0.0), 1.0, 1).tolist() == [[0.0, 1.0, 0.0]]


def test_usable_poses_keep_links_above_the_ground() -> None:
    arm = wrist_arm(0.4, 0.3, 0.1)
    arm = replace(arm, base=(0.0, 0.0, 0.2))
    found = aw.reach_map(arm, spacing=0.2, n_directions=12, obstacles=[Ground(kind="ground", z=0.0)])
    usable = found.usable.reached
    assert usable.any()
    assert np.all(found.bare.reached[usable])
    assert np.all(found.bare.covered[found.usable.covered])
    assert usable.sum() < found.bare.reached.sum()
    assert not usable[found.points[:, 2] < 0.0].any()
    joints = peer_of(arm)
    for point, direction in np.argwhere(usable)[::11]:
        tip = joints.tip(found.usable.q[point, direction])
        wrist = tip[:3, 3] - 0.1 * tip[:3, 2]
        assert min(tip[2, 3], wrist[2]) > 0.02 - ROUNDING, "the link's radius"


def test_held_payloads_agree_with_pinocchio() -> None:
    arm = wrist_arm(0.4, 0.3, 0.1, Actuator("motor", 0.0, 9.0, 5.0))
    found = aw.reach_map(arm, payload=0.5, spacing=0.25, n_directions=12)
    loaded = replace(arm, tool=MountedTool(mass=0.5))
    peer = peer_of(loaded)
    for point, direction in np.argwhere(found.usable.reached)[::5]:
        assert np.abs(peer.gravity(found.usable.q[point, direction])).max() <= 9.0 + 1e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"axis": (0, 0, 0)}, "axis: expected a direction x, y, z"),
        ({"half_angle": 4.0}, "half_angle = 4.0: expected 0 to π rad"),
        ({"spacing": 0.0}, "spacing = 0.0: expected more than 0 m"),
        ({"spacing": 0.001}, "try a larger spacing than 0.001 m"),
        ({"box": [(0, 0, 1), (1, 1, 0)]}, "box: expected .* with low <= high"),
    ],
)
def test_arguments_out_of_range_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        aw.reach_map(planar_arm(0.5, 0.3), **options)


def test_arms_that_are_none_and_payloads_without_motors_are_refused() -> None:
    with pytest.raises(ArmError, match="payload: expected an arm with actuators"):
        aw.reach_map(planar_arm(0.5, 0.3), payload=0.1)
    with pytest.raises(ArmError, match=r"expected an arm, got 'arm.urdf'; try aw.read_urdf"):
        aw.reach_map("arm.urdf")  # type: ignore[arg-type]
