"""Reading URDF, our own and commercial robots, against Pinocchio."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from armwright.exceptions import ArmError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.kinematics.ik.solve import solve
from armwright.robot.arm import Arm
from armwright.robot.link_geometry import inertia_tensor
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from armwright.robot.urdf_writer import to_urdf
from armwright.robot.urdf_xml import MAX_FILE
from tests.support.robots import any_arm, robot, with_frames_anyhow
from tests.support.urdf_peers import differences, random_states, seen_by_kernels, seen_by_pinocchio

ROBOTS = {  # name: joints
    "ur3_robot": 6,
    "ur5_robot": 6,
    "ur10_joint_limited_robot": 6,
    "panda": 7,
    "z1": 6,
    "kinova": 6,
    "talos_left_arm": 6,
    "tiago_no_hand": 8,  # its back slides
    "double_pendulum_continuous": 2,
    "hextilt_flying_arm_5": 5,
    "xarm7": 7,
    "so100": 5,
    "so101": 5,
    "kuka": 7,
}
RIGHT = "1.57 0 0"
PRECISE = {"float64": 1e-6, "float32": 1e-5}  # of the largest value


def assert_equal_arms(one: Arm, other: Arm) -> None:
    """Up to the ten digits of an export; of a link and what sits at its end, mass and centre together."""
    assert [(j.kind, j.axis) for j in one.joints] == [(j.kind, j.axis) for j in other.joints]
    for numbers in (
        lambda arm: [arm.base],
        lambda arm: [(j.lower, j.upper) for j in arm.joints],
        lambda arm: [link.offset for link in arm.links],
        lambda arm: [link.total_mass for link in arm.links],
        lambda arm: [link.total_com for link in arm.links],
        lambda arm: [inertia_tensor(link) for link in arm.links],
        lambda arm: [link.radius for link in arm.links],
    ):
        assert np.allclose(numbers(one), numbers(other), rtol=1e-9, atol=1e-9)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "arm.urdf"


@pytest.mark.parametrize("seed", range(8))
def test_exported_urdf_is_read_back(file: Path, seed: int) -> None:
    arm = any_arm(seed, ("revolute", "prismatic"))
    file.write_text(to_urdf(arm), encoding="utf-8")
    read = read_urdf(file)
    assert_equal_arms(read.arm, arm)
    assert (read.base_link, read.tip) == ("world", "tip")


def assert_as_pinocchio(path: Path, read: UrdfArm, states: np.ndarray) -> None:
    """Poses, torques at rest and moving, and mass matrices, with a payload, in the joint values of the file."""
    theirs = seen_by_pinocchio(path, read, states, 0.7)
    for precision, most in PRECISE.items():
        off = differences(seen_by_kernels(read.arm, states, 0.7, precision), theirs)  # type: ignore[arg-type]
        assert max(off.values()) < most, (precision, off)


@pytest.mark.parametrize("kinds", [("revolute", "prismatic", "fixed"), ("revolute",)], ids=["merged", "turning"])
def test_axes_in_any_direction_agree_with_pinocchio(file: Path, kinds: tuple[str, ...]) -> None:
    """Joints stand off their zero by any angle, so axes and tensors lie along nothing, and fixed joints are merged."""
    oblique = 0
    for seed in range(12):
        file.write_text(with_frames_anyhow(any_arm(seed, kinds), seed, off=3.0), encoding="utf-8")
        read = read_urdf(file)
        oblique += any(not isinstance(joint.axis, str) for joint in read.arm.joints)
        assert_as_pinocchio(file, read, random_states(read.arm, 5, seed))
    assert oblique > 8


@pytest.mark.parametrize("name", ROBOTS)
def test_commercial_robots_agree_with_pinocchio(name: str) -> None:
    """Merged bodies, fingers held at 0, axes of either sign and right angles written as 1.5708 agree with Pinocchio."""
    path = robot(name)
    read = read_urdf(path)
    assert len(read.joints) == len(read.arm.joints) == ROBOTS[name]
    assert_as_pinocchio(path, read, random_states(read.arm, 20, 3))
    model = pinocchio.buildModelFromUrdf(str(path))
    for name_, joint in zip(read.joints, read.arm.joints, strict=True):
        seen_joint = model.joints[model.getJointId(name_)]
        if seen_joint.nq == 1:
            assert joint.lower == pytest.approx(max(model.lowerPositionLimit[seen_joint.idx_q], -2 * np.pi), abs=1e-6)
            assert joint.upper == pytest.approx(min(model.upperPositionLimit[seen_joint.idx_q], 2 * np.pi), abs=1e-6)
        else:
            assert (joint.lower, joint.upper) == (-2 * np.pi, 2 * np.pi)
        effort = model.effortLimit[seen_joint.idx_v]
        assert joint.effort == (pytest.approx(effort) if 0.0 < effort < np.inf else None)


@pytest.mark.parametrize("name", ["panda", "xarm7", "so101"])
def test_exports_of_existing_arms_agree_with_their_files(file: Path, name: str) -> None:
    """A URDF is read back and an MJCF driven by MuJoCo as Pinocchio drives the file."""
    read = read_urdf(robot(name))
    file.write_text(to_urdf(read.arm), encoding="utf-8")
    again = read_urdf(file, tip="tip")
    states = random_states(read.arm, 10, 5)
    assert_as_pinocchio(file, again, states)
    theirs = seen_by_pinocchio(robot(name), read, states)
    assert max(differences(seen_by_kernels(again.arm, states), theirs).values()) < 1e-8
    model = mujoco.MjModel.from_xml_string(to_mjcf(read.arm))
    data = mujoco.MjData(model)
    for row, torque in zip(states.swapaxes(0, 1), theirs.torque, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row
        mujoco.mj_inverse(model, data)
        assert data.qfrc_inverse - data.qfrc_passive == pytest.approx(torque, abs=1e-6 * np.abs(torque).max())


def test_inertia_is_that_of_the_file(file: Path) -> None:
    """A carousel about its centre of mass, where no cylinder of its mass would have any inertia to speak of."""
    inertia = '<inertia ixx="0.15" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.05"/>'
    inertial = f'<inertial><origin rpy="1.5707963267948966 0 0"/><mass value="5"/>{inertia}</inertial>'
    turn = one_joint(inside='<axis xyz="0 0 1"/><limit lower="-2" upper="2"/>')
    file.write_text(turn.replace('<link name="b"/>', f'<link name="b">{inertial}</link>'), encoding="utf-8")
    arms = stack_arms([read_urdf(file).arm], "float64")
    assert inertia_matrices(arms, np.full((1, 1, 1), 0.3), np.zeros(1), 0.0) == pytest.approx(0.2, rel=1e-12)
    file.write_text(file.read_text(encoding="utf-8").replace(inertia, ""), encoding="utf-8")
    assert "links without inertia count as points: b" in read_urdf(file).notes
    assert not any("count as points" in note for note in read_urdf(robot("so101")).notes)  # 1e-9 kg of 0.5 kg


def test_tip_is_chosen_and_reported() -> None:
    panda = robot("panda")
    assert read_urdf(panda).tip == "panda_hand_tcp"
    seven = ", ".join(f"panda_joint{n}" for n in range(1, 8))
    assert read_urdf(panda).notes[0] == (
        f'the tip is the link "panda_hand_tcp" (--tip names another); joints from "panda_link0": {seven}; '
        "left out, at 0: panda_finger_joint1, panda_finger_joint2"
    )
    finger = read_urdf(panda, tip="panda_leftfinger")
    assert len(finger.joints) == 8
    assert finger.arm.joints[-1].kind == "prismatic"
    part = read_urdf(panda, base_link="panda_link2", tip="panda_link4")
    assert part.joints == ("panda_joint3", "panda_joint4")
    assert part.arm.base_mass == pytest.approx(0.646926)  # of panda_link2 in the file
    with pytest.raises(ArmError, match='is not beyond "panda_link4"'):
        read_urdf(panda, base_link="panda_link4", tip="panda_link2")
    with pytest.raises(ArmError, match=r'no link "panda_hnd" \(tip\). Did you mean "panda_hand"'):
        read_urdf(panda, tip="panda_hnd")
    with pytest.raises(ArmError, match="branches at the link"):
        read_urdf(robot("tiago_dual"))
    assert len(read_urdf(robot("tiago_dual"), tip="arm_left_7_link").joints) == 8


def test_base_link_keeps_its_orientation_under_the_root(file: Path) -> None:
    """An arm at the side of a torso hangs from it as in the whole robot."""
    mount = '<origin xyz="0.1 0.2 0.7" rpy="-1.5707963267948966 0 0"/>'
    torso = f'<link name="torso"/><joint name="side" type="fixed"><parent link="torso"/><child link="world"/>{mount}'
    text = to_urdf(any_arm(3, ("revolute", "prismatic")))
    file.write_text(text.replace("</robot>", f"{torso}</joint></robot>"), encoding="utf-8")
    read = read_urdf(file, base_link="world")
    assert read.notes[1] == (
        'the axes of the world are those of "torso"; gravity points along (0, 1, 0) in the frame of "world"'
    )
    states = random_states(read.arm, 20, 3)
    seen = seen_by_pinocchio(file, read, states, 1.5)
    theirs = replace(seen, tip=seen.tip - (0.1, 0.2, 0.7))
    assert max(differences(seen_by_kernels(read.arm, states, 1.5), theirs).values()) < 1e-8


def one_joint(joint: str = 'type="revolute"', inside: str = '<limit lower="-1" upper="1"/>', more: str = "") -> str:
    return (
        f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" {joint}><parent link="a"/>'
        f'<child link="b"/>{inside}</joint>{more}</robot>'
    )


def test_urdf_limits_are_converted(file: Path) -> None:
    """Limits may exclude 0 or exceed the range of the kernels."""
    file.write_text(
        one_joint(inside='<axis xyz="0 -2 0"/><limit lower="0.5" upper="1.5" effort="3"/>'), encoding="utf-8"
    )
    (joint,) = read_urdf(file).arm.joints
    assert (joint.axis, joint.lower, joint.upper, joint.effort) == ((0.0, -1.0, 0.0), 0.5, 1.5, 3.0)
    file.write_text(one_joint(inside='<limit lower="-20" upper="7" effort="0"/>'), encoding="utf-8")
    read = read_urdf(file)
    assert (read.arm.joints[0].lower, read.arm.joints[0].upper) == (-2 * np.pi, 2 * np.pi)
    assert read.arm.joints[0].effort is None
    assert any("rotates from -20 to 7 rad" in note for note in read.notes)


@pytest.mark.parametrize("mount", ["3.14 0 0", "0 3.14 0"])
def test_right_angles_with_few_digits_are_used_as_written(file: Path, mount: str) -> None:
    """A note says so; nothing is rounded, and nothing refused."""
    inertia = '<mass value="1"/><inertia ixx="1e-3" iyy="2e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
    links = "".join(f'<link name="{n}"><inertial>{inertia}</inertial></link>' for n in range(5))
    rows = "".join(
        f'<joint name="j{n}" type="{kind}"><parent link="{n}"/><child link="{n + 1}"/><axis xyz="0 0 1"/>'
        f'<origin xyz="0.1 0 0.2" rpy="{rpy}"/><limit lower="-2" upper="2" effort="10" velocity="3"/></joint>'
        for n, (kind, rpy) in enumerate([("fixed", mount), *[("revolute", rpy) for rpy in ("0 0 0", RIGHT, RIGHT)]])
    )
    file.write_text(f'<robot name="r">{links}{rows}</robot>', encoding="utf-8")
    read = read_urdf(file)
    words = "right angles or π with too few digits are used as written: 3.14 at j0, 1.57 at j2, 1.57 at j3"
    assert words in read.notes
    assert_as_pinocchio(file, read, random_states(read.arm, 10, 1))


@pytest.mark.parametrize(
    ("name", "tip"),
    [("baxter", "left_gripper_base_link"), ("centauro", "arm1_8"), ("tiago_pro", "gripper_left_base_link")],
)
def test_arms_with_oblique_axes_reach_where_pinocchio_says(name: str, tip: str) -> None:
    """The postures that `aw.solve` finds have the pose that it was asked for."""
    path = robot(name)
    read = read_urdf(path, tip=tip)
    assert sum(max(map(abs, joint.direction)) < 0.99 for joint in read.arm.joints) >= 4
    goal = seen_by_pinocchio(path, read, random_states(read.arm, 40, 1))
    found = solve(read, goal.tip, orientations=goal.rotation, restarts=50)
    assert found.reached.mean() > 0.9
    q, is_there = found.q[0], found.reached[0]
    there = seen_by_pinocchio(path, read, np.stack([q, 0.0 * q, 0.0 * q]))
    assert np.linalg.norm(there.tip - goal.tip, axis=1) == pytest.approx(found.position_error[0], abs=1e-5)
    assert np.abs(there.rotation - goal.rotation)[is_there].max() < 2e-3


LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
REFUSED = {
    "": "not valid XML",
    "\x00\x01\x02": "not valid XML",
    "<robot>": "not valid XML: no element found",
    '<?xml version="1.0" encoding="klingon"?><robot/>': "not valid XML: .*encoding",
    LAUGHS + '<robot name="&b;"/>': "declares a document type",
    '<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>': "declares a document type",
    "<a>" * 60 + "</a>" * 60: "more than 50 nested elements",
    "<sdf/>": "expected the root <robot>, got <sdf>",
    "<robot/>": "has no link",
    '<robot><link name="a"/></robot>': "no joint moves",
    "<robot><link/></robot>": "a link has no name",
    '<robot><link name="a"/><link name="a"/></robot>': 'duplicate link "a"',
    '<robot><link name="a"/><link name="b"/></robot>': "found 2",
    one_joint(more='<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'): 'duplicate joint "j"',
    one_joint(more='<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>'): "two parents",
    one_joint(more='<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>'): "form a cycle",
    one_joint(more='<link name="c"/><joint name="k" type="fixed"><parent link="c"/><child link="c"/></joint>'): "cycle",
    one_joint(more='<joint name="k" type="fixed"><parent link="b"/><child link="c"/></joint>'): 'unknown link "c"',
    one_joint('type="spherical"'): '"j" has the unknown type "spherical"',
    one_joint('type="planar"'): '"j" is planar',
    one_joint('type="floating"'): '"j" is floating',
    one_joint(inside=""): "expected limits lower < upper, got 0 and 0",
    one_joint(inside='<limit lower="1" upper="-1"/>'): "expected limits lower < upper, got 1 and -1",
    one_joint(inside='<limit lower="nan" upper="1"/>'): 'lower: expected 1 finite number, got "nan"',
    one_joint(inside='<axis xyz="0 0 0"/><limit lower="-1" upper="1"/>'): "an axis of no length",
    one_joint(inside='<axis xyz="0 1"/><limit lower="-1" upper="1"/>'): 'xyz: expected 3 finite numbers, got "0 1"',
    one_joint(inside='<limit lower="${-pi}" upper="1"/>'): "is xacro, not URDF; try",
    one_joint(more="<xacro:include filename='ur.xacro'/>"): "<xacro:include> is xacro, not URDF; try `xacro FILE",
    one_joint().replace('<link name="b"/>', '<link name="b"><xacro:rod mass="4"/></link>'): "<xacro:rod> is xacro",
    one_joint().replace('<link name="b"/>', '<link name="b"><inertial><mass value="-1"/></inertial></link>'): "-1 kg",
    one_joint().replace(
        '<link name="b"/>', '<link name="b"><inertial/></link>'
    ): 'value: expected 1 finite number, got ""',
    one_joint(inside='<limit lower="-1" upper="1"/><mimic joint="k"/>'): "no joint moves",
}


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_damaged_and_hostile_files_are_refused_in_one_line(file: Path, number: int) -> None:
    text, words = list(REFUSED.items())[number]
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ArmError, match=words) as refusal:
        read_urdf(file)
    assert "\n" not in str(refusal.value)
    assert str(file) in str(refusal.value)
    assert len(str(refusal.value)) < 500 + len(str(file))


def test_unused_xacro_properties_are_ignored(file: Path) -> None:
    """Old converters leave them behind, with all values in place."""
    file.write_text(one_joint(more='<xacro:property name="pi" value="3.14"/>'), encoding="utf-8")
    assert read_urdf(file).joints == ("j",)


def test_missing_and_oversized_files_are_refused(file: Path) -> None:
    file.write_bytes(b" " * (MAX_FILE + 1))
    with pytest.raises(ArmError, match="at most 4,096 KiB"):
        read_urdf(file)
    with pytest.raises(ArmError, match="cannot read"):
        read_urdf(file.parent)
    with pytest.raises(ArmError, match=r"cannot read .*: No such file"):
        read_urdf(file.parent / "none.urdf")


def test_chain_of_three_thousand_links_is_read(file: Path) -> None:
    """No function recurses."""
    n = 3_000
    links = "".join(f'<link name="{i}"/>' for i in range(n + 1))
    joint = '<joint name="{0}" type="{2}"><parent link="{0}"/><child link="{1}"/><limit lower="-1" upper="1"/></joint>'
    kinds = ("fixed", "revolute")
    joints = "".join(joint.format(i, i + 1, kinds[i == n // 2]) for i in range(n))
    file.write_text(f"<robot>{links}{joints}</robot>", encoding="utf-8")
    read = read_urdf(file)
    assert (read.joints, read.tip) == ((str(n // 2),), str(n))
