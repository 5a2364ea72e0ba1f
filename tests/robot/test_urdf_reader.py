"""Reading URDF, our own and commercial robots, against Pinocchio."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from armwright.exceptions import ArmError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.cycle.torque_terms import inertia_matrices
from armwright.kinematics.ik.ik import solve_postures
from armwright.robot.arm import Arm
from armwright.robot.urdf_reader import SNAP, UrdfArm, read_urdf
from armwright.robot.urdf_writer import to_urdf
from armwright.robot.urdf_xml import MAX_FILE
from tests.support.robots import any_arm, robot, with_frames_anyhow

# name: joints, the largest error of the tip [m]. Some files write 1.5708 for a right angle; their axes are moved by it.
ROBOTS = {
    "ur3_robot": (6, 1e-9),
    "ur5_robot": (6, 1e-9),
    "ur10_joint_limited_robot": (6, 1e-9),
    "panda": (7, 1e-9),
    "z1": (6, 1e-9),
    "kinova": (6, 1e-9),
    "talos_left_arm": (6, 1e-9),
    "tiago_no_hand": (8, 1e-9),  # its back slides
    "double_pendulum_continuous": (2, 1e-9),
    "xarm7": (7, 3e-5),
    "so100": (5, 3e-5),
    "so101": (5, 3e-5),
    "kuka": (7, 3e-5),
}


def seen_by_pinocchio(
    path: Path, read: UrdfArm, q: np.ndarray, payload: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the tip is, (T, 3), how it is turned, (T, 3, 3), and what holds it and its payload, (T, J), at q (T, J)."""
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    frame = model.getFrameId(read.tip, pinocchio.FrameType.BODY)
    tips, rotations, torques = [], [], []
    for row in read.values_in_urdf(q):
        values = pinocchio.neutral(model)
        places = []
        for name, value in zip(read.joints, row, strict=True):
            joint = model.joints[model.getJointId(name)]
            values[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            places.append(joint.idx_v)
        pinocchio.framesForwardKinematics(model, data, values)
        tips.append(data.oMf[frame].translation.copy())
        rotations.append(data.oMf[frame].rotation.copy())
        rises = pinocchio.computeFrameJacobian(model, data, values, frame, pinocchio.LOCAL_WORLD_ALIGNED)[2]
        held = pinocchio.computeGeneralizedGravity(model, data, values) + 9.81 * payload * rises
        torques.append(held[places] * read.signs)
    return np.array(tips), np.array(rotations), np.array(torques)


def seen_by_kernels(arm: Arm, q: np.ndarray, payload: float) -> tuple[np.ndarray, np.ndarray]:
    loads = np.full(len(q), payload)
    arrays = stack_arms([arm], "float64")
    postures = solve_postures(arrays, np.zeros((len(q), 3)), 0, initial_q=q[None], payload=loads, precision="float64")
    return postures.reached[0], postures.torque[0]


def random_values(arm: Arm, n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([j.lower for j in arm.joints], [j.upper for j in arm.joints], (n, len(arm.joints)))


def assert_equal_arms(one: Arm, other: Arm) -> None:
    """Up to the ten digits of an export; of a link and what sits at its end, mass and centre together."""
    assert [(j.kind, j.axis) for j in one.joints] == [(j.kind, j.axis) for j in other.joints]
    for numbers in (
        lambda arm: [arm.base],
        lambda arm: [(j.lower, j.upper) for j in arm.joints],
        lambda arm: [link.offset for link in arm.links],
        lambda arm: [link.total_mass for link in arm.links],
        lambda arm: [link.total_com for link in arm.links],
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
    assert set(read.signs) == {1.0}
    assert set(read.zeros) == {0.0}


@pytest.mark.parametrize(
    ("kinds", "off"), [(("revolute", "prismatic", "fixed"), 0.0), (("revolute",), 0.4)], ids=["merged", "skew"]
)
def test_frames_anyhow_agree_with_pinocchio(file: Path, kinds: tuple[str, ...], off: float) -> None:
    """Fixed joints are merged, and turning joints off their zero have other angles for the same postures."""
    moved = 0
    for seed in range(12):
        file.write_text(with_frames_anyhow(any_arm(seed, kinds), seed, off), encoding="utf-8")
        read = read_urdf(file)
        q = random_values(read.arm, 5, seed)
        assert np.all(np.abs(read.zeros) <= np.pi / 4 + 1e-9)
        moved += any(read.zeros)
        ours, (tips, _, torques) = seen_by_kernels(read.arm, q, 0.7), seen_by_pinocchio(file, read, q, 0.7)
        assert np.allclose(ours[0], tips, atol=1e-10)
        assert np.allclose(ours[1], torques, atol=1e-10)
    assert (moved >= 6) == (off > 0.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_commercial_robots_agree_with_pinocchio(name: str) -> None:
    """Merged bodies, fingers held at 0, axes of either sign and moved zeros agree with Pinocchio."""
    path = robot(name)
    joints, error = ROBOTS[name]
    read = read_urdf(path)
    assert len(read.joints) == len(read.arm.joints) == joints
    q = random_values(read.arm, 20, 3)
    (tips, torques), (seen, _, held) = seen_by_kernels(read.arm, q, 1.5), seen_by_pinocchio(path, read, q, 1.5)
    assert np.abs(tips - seen).max() < error
    assert np.abs(torques - held).max() < error * 10 * np.abs(held).max() + 1e-9
    model = pinocchio.buildModelFromUrdf(str(path))
    for name_, joint, sign, zero in zip(read.joints, read.arm.joints, read.signs, read.zeros, strict=True):
        seen_joint = model.joints[model.getJointId(name_)]
        if seen_joint.nq == 1:
            low, high = sorted(sign * np.array([joint.lower, joint.upper]) + zero)
            assert low == pytest.approx(max(model.lowerPositionLimit[seen_joint.idx_q], -2 * np.pi), abs=1e-6)
            assert high == pytest.approx(min(model.upperPositionLimit[seen_joint.idx_q], 2 * np.pi), abs=1e-6)
        else:
            assert (joint.lower, joint.upper) == (-2 * np.pi, 2 * np.pi)
        effort = model.effortLimit[seen_joint.idx_v]
        assert joint.effort == (pytest.approx(effort) if 0.0 < effort < np.inf else None)


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


def test_tip_is_chosen_and_reported() -> None:
    panda = robot("panda")
    assert read_urdf(panda).tip == "panda_hand_tcp"
    assert 'the tip is the link "panda_hand_tcp" (--tip names another)' in read_urdf(panda).notes
    finger = read_urdf(panda, tip="panda_leftfinger")
    assert len(finger.joints) == 8
    assert finger.arm.joints[-1].kind == "prismatic"
    part = read_urdf(panda, base_link="panda_link2", tip="panda_link4")
    assert part.joints == ("panda_joint3", "panda_joint4")
    assert part.arm.base_mass == pytest.approx(0.646926)  # of panda_link2 in the file
    assert "1 other joint stays at 0, such as fingers" in read_urdf(robot("so101")).notes
    with pytest.raises(ArmError, match='is not beyond "panda_link4"'):
        read_urdf(panda, base_link="panda_link4", tip="panda_link2")
    with pytest.raises(ArmError, match=r'no link "panda_hnd" \(tip\). Did you mean "panda_hand"'):
        read_urdf(panda, tip="panda_hnd")
    with pytest.raises(ArmError, match="branches at the link"):
        read_urdf(robot("tiago_dual"))
    assert len(read_urdf(robot("tiago_dual"), tip="arm_left_7_link").joints) == 8


def one_joint(joint: str = 'type="revolute"', inside: str = '<limit lower="-1" upper="1"/>', more: str = "") -> str:
    return (
        f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" {joint}><parent link="a"/>'
        f'<child link="b"/>{inside}</joint>{more}</robot>'
    )


def test_urdf_limits_are_converted(file: Path) -> None:
    """Limits may exclude 0, oppose the axis, or exceed the range of the kernels."""
    file.write_text(
        one_joint(inside='<axis xyz="0 -2 0"/><limit lower="0.5" upper="1.5" effort="3"/>'), encoding="utf-8"
    )
    (joint,) = read_urdf(file).arm.joints
    assert (joint.axis, joint.lower, joint.upper, joint.effort) == ("y", -1.5, -0.5, 3.0)
    file.write_text(one_joint(inside='<limit lower="-20" upper="7" effort="0"/>'), encoding="utf-8")
    read = read_urdf(file)
    assert (read.arm.joints[0].lower, read.arm.joints[0].upper) == (-2 * np.pi, 2 * np.pi)
    assert read.arm.joints[0].effort is None
    assert any("rotates from -20 to 7 rad" in note for note in read.notes)


def test_axes_are_snapped_within_tolerance(file: Path) -> None:
    for off, fits in ((0.9 * SNAP, True), (1.1 * SNAP, False)):
        file.write_text(
            one_joint(inside=f'<axis xyz="{np.sin(off)} 0 {np.cos(off)}"/><limit lower="-1" upper="1"/>'),
            encoding="utf-8",
        )
        if fits:
            assert any(f"off by up to {off:.1g} rad" in note for note in read_urdf(file).notes)
        else:
            with pytest.raises(ArmError, match='joint "j" has the axis'):
                read_urdf(file)


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
    one_joint(inside='<axis xyz="0 1 1"/><limit lower="-1" upper="1"/>'): r"the axis \(0.000, 0.707, 0.707\)",
    one_joint(inside='<limit lower="${-pi}" upper="1"/>'): "is xacro, not URDF; try",
    one_joint().replace('<link name="b"/>', '<link name="b"><inertial><mass value="-1"/></inertial></link>'): "-1 kg",
    one_joint().replace(
        '<link name="b"/>', '<link name="b"><inertial/></link>'
    ): 'value: expected 1 finite number, got ""',
    one_joint(inside='<limit lower="-1" upper="1"/><mimic joint="k"/>'): "no joint moves|mimics",
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
