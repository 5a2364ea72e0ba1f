"""Payload, backlash, compliance and holding torques of existing arms, beside what others published or measured.

The descriptions come from `robot_descriptions`, or from URDF files:

    python benchmarks/validation.py so100=FILE so101=FILE openarm=FILE openarm-hand=FILE ur5e=FILE panda=FILE

OpenArm is the right arm of the bimanual robot, from files only: xacro v10.urdf.xacro bimanual:=true hand:=false, and
hand:=true for openarm-hand.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import stack_arms
from armwright.kinematics.compliance import Stiffness, backlash_errors, own_loads, tip_displacements, unit_payload
from armwright.kinematics.forward import forward_kinematics
from armwright.kinematics.ik import solve_postures
from armwright.kinematics.payload_limits import payloads_over_reach
from armwright.robot.actuators import named_actuator
from armwright.robot.arm import GRAVITY, Actuator, Arm
from armwright.robot.robot_descriptions import find_urdf
from armwright.robot.urdf_reader import UrdfArm, read_urdf

SERVO = named_actuator("STS3215-12V").completed()
KG_CM = 0.01 * GRAVITY  # [N m]
FAR = 1e3  # [m]
TIPS = {"openarm": "openarm_right_link8", "openarm-hand": "openarm_right_hand_tcp"}
DESCRIBED = ("so100", "so101", "ur5e", "panda")  # arms that robot_descriptions has by this name
FREE_PLAY = 1.0  # [°] measured, TheRobotStudio/SO-ARM100 issue 134


@dataclass(frozen=True)
class Case:
    """Torques of an arm's joints [N m], the last one of all further joints, and what others say of its payload."""

    arm: str
    torques: tuple[float, ...]
    motors: str
    published: str


CASES = (
    Case("so100", (19.5 * KG_CM,), "STS3215 at 7.4 V, stall", "about 0.2 kg"),
    Case("so100", (SERVO.stall_torque or 0.0,), "STS3215 at 12 V, stall", "about 0.3 kg"),
    Case("so101", (19.5 * KG_CM,), "STS3215 at 7.4 V, stall", "about 0.2 kg"),
    Case("so101", (SERVO.stall_torque or 0.0,), "STS3215 at 12 V, stall", "about 0.3 kg"),
    Case("so101", (SERVO.rated_torque or 0.0,), "STS3215 at 12 V, rated", ""),
    Case("openarm", (40.0, 40.0, 27.0, 27.0, 7.0), "peak", "6.0 kg for 1 s"),
    Case("openarm", (20.0, 20.0, 9.0, 9.0, 3.0), "rated", "4.1 kg for 1 min"),
    Case("openarm-hand", (40.0, 40.0, 27.0, 27.0, 7.0), "peak", ""),
    Case("openarm-hand", (27.0, 27.0, 27.0, 27.0, 7.0), "shoulder of 27 N m", "1.6 kg trips it (earlier version)"),
)


def main(files: Sequence[str]) -> None:
    paths = dict(part.split("=", 1) for part in files)
    arms = {name: read_urdf(paths.get(name) or find_urdf(name), tip=TIPS.get(name)) for name in paths or DESCRIBED}
    print("| arm | motors | reach | payload at 50 % | at 100 % | others |")
    print("|---|---|--:|--:|--:|---|")
    for case in CASES:
        if case.arm in arms:
            found = payloads_over_reach(driven(arms[case.arm].arm, case.torques))
            near, far = (f"{payload:.2f} kg" for payload in found.payloads)
            print(f"| {case.arm} | {case.motors} | {found.reach:.2f} m | {near} | {far} | {case.published} |")
    for name in ("so100", "so101"):
        if name in arms:
            describe_servos(name, arms[name].arm)
    for name in ("ur5e", "panda"):
        if name in arms:
            compare_torques(name, arms[name], Path(paths.get(name) or find_urdf(name)))


def driven(arm: Arm, torques: Sequence[float]) -> Arm:
    """The arm with motors of these torques, whose masses are in its links."""
    joints, moving = [], 0
    for joint in arm.joints:
        if joint.kind != "fixed":
            motor = Actuator("motor", 0.0, torques[min(moving, len(torques) - 1)])
            joint, moving = replace(joint, actuator=motor), moving + 1
        joints.append(joint)
    return replace(arm, joints=tuple(joints), safety_factor=1.0)


def describe_servos(name: str, arm: Arm) -> None:
    """Print how far backlash, gears and control of servos move the tip of the stretched arm."""
    arms = stack_arms([arm])
    shifted = replace(arms, base=np.zeros_like(arms.base))
    q = solve_postures(shifted, np.array([[FAR, 0.0, 0.0]])).q.astype(np.float64)
    frames = forward_kinematics(shifted, q)
    moving = arms.motion < 6
    for text, backlash in (("maker", np.degrees(SERVO.backlash or 0.0)), ("measured", FREE_PLAY)):
        play = backlash_errors(shifted, frames, np.where(moving, np.radians(backlash), 0.0))[0, 0]
        print(f"{name}, stretched: backlash of {backlash:g}° ({text}): {1e3 * play:.1f} mm")
    rigid = np.full(arms.motion.shape, np.inf)
    for text, stiffness in (("gear", SERVO.joint_stiffness), ("position gain", SERVO.position_gain)):
        joints = Stiffness(rigid, rigid, np.where(moving, stiffness, np.inf))
        own, payload = (
            tip_displacements(shifted, frames, loads(shifted, frames), joints)[0, 0]
            for loads in (own_loads, unit_payload)
        )
        print(f"{name}, stretched: {text} of {stiffness:.4g} N m/rad: {1e3 * np.linalg.norm(own):.1f} mm by its own "
              f"weight, {1e2 * np.linalg.norm(payload):.1f} mm by 0.1 kg")  # fmt: skip


def compare_torques(name: str, read: UrdfArm, path: Path) -> None:
    """Print the holding torques of five postures, and how far they are off Pinocchio's."""
    rng, arm = np.random.default_rng(0), read.arm
    q = rng.uniform([j.lower for j in arm.joints], [j.upper for j in arm.joints], (5, len(arm.joints)))
    arms = stack_arms([arm], "float64")
    ours = solve_postures(arms, np.zeros((5, 3)), 0, initial_q=q[None], precision="float64").torque[0]
    theirs = gravity(read, path, q)
    largest = ", ".join(f"{value:.2f}" for value in np.abs(ours).max(axis=1))
    print(
        f"{name}: largest holding torques {largest} N m; off Pinocchio by {np.abs(ours - theirs).max():.1e} N m at most"
    )


def gravity(read: UrdfArm, path: Path, q: Array) -> Array:
    """Gravity torques (T, J) by Pinocchio at the arm's values q (T, J) [N m]."""
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    rows = []
    for row in read.values_in_urdf(q):
        values, places = pinocchio.neutral(model), []
        for joint_name, value in zip(read.joints, row, strict=True):
            joint = model.joints[model.getJointId(joint_name)]
            values[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            places.append(joint.idx_v)
        rows.append(pinocchio.computeGeneralizedGravity(model, data, values)[places] * read.signs)
    return np.array(rows)


if __name__ == "__main__":
    main(sys.argv[1:])
