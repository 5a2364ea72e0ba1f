"""Where the arm of a URDF ends: known arms and small ones of the same structure and names."""

import math
from pathlib import Path

import pytest

from armwright.exceptions import ArmError
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from tests.support.robots import robot

TURN, BOTH, JAW, SLIDE = (-math.pi, math.pi), (-1.0, 1.0), (-0.17, 1.75), (0.0, 0.044)
Y, Z = (0, 1, 0), (0, 0, 1)
ARM = (("j1", "base", "l1", Z, TURN), ("j2", "l1", "l2", Y, TURN), ("j3", "l2", "l3", Y, TURN))
OF_JAW = (*ARM, ("j4", "l3", "l4", (1, 0, 0), TURN))


def urdf(*joints: tuple) -> str:
    """The URDF of joints: name, parent, child, and of those that move axis, limits and whom they mimic."""
    links = dict.fromkeys(link for joint in joints for link in joint[1:3])
    parts = [f'<link name="{link}"><inertial><mass value="1"/></inertial></link>' for link in links]
    for name, parent, child, *rest in joints:
        axis, limits, mimics = (*rest, *(None,) * (3 - len(rest)))
        kind = "fixed" if axis is None else "prismatic" if limits == SLIDE else "revolute"
        kind = "continuous" if axis is not None and limits is None else kind
        low, high = limits or (0, 0)
        more = f'<axis xyz="{" ".join(map(str, axis))}"/><limit lower="{low}" upper="{high}"/>' if axis else ""
        more += f'<mimic joint="{mimics}"/>' if mimics else ""
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0 0.1"/>{more}</joint>'
        )
    return f'<robot name="r">{"".join(parts)}</robot>'


def read(folder: Path, *joints: tuple) -> UrdfArm:
    file = folder / "arm.urdf"
    file.write_text(urdf(*joints), encoding="utf-8")
    return read_urdf(file)


FINGERS = (
    ("finger_joint1", "hand", "right_finger", Y, SLIDE),
    ("finger_joint2", "hand", "left_finger", Y, SLIDE, "finger_joint1"),
)
ENDS = {  # joints, how many of them are the arm's, tip
    "openarm": ((*ARM, ("j4", "l3", "hand", Z, TURN), *FINGERS, ("t", "hand", "hand_tcp")), 4, "hand_tcp"),
    "panda": ((*OF_JAW, ("f", "l4", "link8"), ("h", "link8", "hand"), *FINGERS, ("t", "hand", "tcp")), 4, "tcp"),
    "robotiq": (
        (
            *OF_JAW,
            ("m", "l4", "robotiq_base"),
            ("drive", "robotiq_base", "left_outer_knuckle", Y, (0.0, 0.8)),
            ("left", "left_outer_knuckle", "left_inner", Y, (-0.8, 0.0), "drive"),
            ("right", "robotiq_base", "right_outer_knuckle", Y, (0.0, 0.8), "drive"),
        ),
        4,
        "robotiq_base",
    ),
    "two fingers": (
        (*OF_JAW, ("a", "l4", "a", Y, (0.0, 0.8)), ("b", "l4", "b", Y, (0.0, 0.8)), ("t", "l4", "tool0")),
        4,
        "tool0",
    ),
    "fingers on a bar with a frame": (
        (
            *(*OF_JAW, ("e", "l4", "/ee_arm_link"), ("gripper", "/ee_arm_link", "prop", (1, 0, 0), None)),
            *(("b", "/ee_arm_link", "bar"), ("a", "bar", "left", Y, SLIDE), ("c", "bar", "right", Y, SLIDE, "a")),
            ("t", "bar", "/ee_gripper_link"),
        ),
        4,
        "/ee_gripper_link",
    ),
    "jaw by its name": ((*ARM, ("grip_joint", "l3", "l4", Y, BOTH)), 3, "l3"),
    "jaw by its link": ((*ARM, ("6", "l3", "Moving_Jaw", Y, BOTH)), 3, "l3"),
    "jaw by its motion": ((*OF_JAW, ("6", "l4", "l5", Y, JAW)), 4, "l4"),
    "jaw that slides": ((*OF_JAW, ("6", "l4", "l5", Y, SLIDE)), 4, "l4"),
    "jaw by a frame": ((*OF_JAW, ("f", "l4", "grip_frame_link"), ("6", "l4", "l5", Y, BOTH)), 4, "grip_frame_link"),
    "camera beside a wrist": ((*ARM, ("c", "l3", "camera_frame"), ("6", "l3", "l4", Z, TURN)), 4, "l4"),
    "gripper_roll": ((*ARM, ("gripper_roll", "l3", "gripper", Z, TURN), ("t", "gripper", "tcp")), 4, "tcp"),
    "rigid gripper": ((*ARM, ("j4", "l3", "gripper_base_link", Z, TURN), ("t", "gripper_base_link", "tcp")), 4, "tcp"),
    "slide of a SCARA": ((*ARM, ("j4", "l3", "l4", Y, TURN), ("lift", "l4", "l5", Y, SLIDE)), 5, "l5"),
    "collision link": ((*ARM, ("c", "l3", "l3_sc"), ("f", "l3", "l4")), 3, "l4"),
    "camera on a bracket": ((*ARM, ("c", "l3", "c"), ("d", "c", "camera_frame"), ("t", "l3", "tool0")), 3, "tool0"),
    "arm called finger": (tuple((f"finger_{n}", *rest) for n, *rest in ARM), 3, "l3"),
}


@pytest.mark.parametrize("name", ENDS)
def test_tip_of_known_structures(tmp_path: Path, name: str) -> None:
    joints, n, tip = ENDS[name]
    found = read(tmp_path, *joints)
    assert (len(found.joints), found.tip) == (n, tip)


@pytest.mark.parametrize(
    ("name", "joints", "tip", "left_out"),
    [
        ("so101", 5, "gripper_frame_link", "gripper"),
        ("so100", 5, "gripper", "gripper"),
        ("z1", 6, "gripperStator", "jointGripper"),
        ("finger_edu", 3, "finger_tip_link", ""),
        ("kinova", 6, "j2s6s200_end_effector", ""),
        ("talos_left_arm", 6, "wrist_left_ft_tool_link", "gripper_left_joint"),
    ],
)
def test_tip_of_real_arms(name: str, joints: int, tip: str, left_out: str) -> None:
    found = read_urdf(robot(name))
    assert (len(found.joints), found.tip) == (joints, tip)
    assert found.notes[0].startswith(f'the tip is the link "{tip}" (--tip names another); joints from "')
    assert found.notes[0].endswith(f"left out, at 0: {left_out}" if left_out else found.joints[-1])


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (
            (("gripper", "l3", "l4", Z, TURN), ("t", "l4", "tcp")),
            r'"gripper" may move a gripper \(its name\) or the arm \("tcp" beyond it and its range\); name the tip: '
            "--tip l3 without this joint, --tip tcp with it",
        ),
        ((("w", "l3", "l4", Z, None), ("t", "l3", "tool0")), r'\("tool0" beside it\) or the arm \(its range\)'),
        (
            (("w", "l3", "l4", Z, TURN), ("t", "l4", "tcp"), ("g", "l3", "l5", Z, TURN)),
            'branches at the link "l3" to l4, l5; name the tip',
        ),
    ],
)
def test_doubtful_ends_are_not_guessed(tmp_path: Path, joints: tuple[tuple, ...], words: str) -> None:
    with pytest.raises(ArmError, match=words):
        read(tmp_path, *ARM, *joints)


def test_last_joint_that_is_coupled_to_the_arm_belongs_to_it(tmp_path: Path) -> None:
    found = read(tmp_path, *ARM, ("j4", "l3", "l4", Y, TURN, "j3"))
    assert (found.tip, found.joints[-1]) == ("l4", "j4")
    assert "j4 = 1 j3 +0, so the drive of j3 moves both" in found.notes
    further = read(
        tmp_path, *ARM, ("gripper", "l3", "l4", Y, TURN, "j2"), ("j5", "l4", "l5", Z, TURN), ("t", "l5", "tool0")
    )
    assert further.joints[-2:] == ("gripper", "j5")
