"""Compare payloads, backlash, sag and holding torques of existing arms with what others published or measured.

Prints the figures of docs/validation.md, which states the sources and where the URDF files are. Arms without a FILE
come from `robot_descriptions`. Those that are not found are named and left out.

    python benchmarks/validation.py so101=FILE openarm=FILE openarm-hand=FILE openarm-early=FILE ur5e=FILE panda=FILE
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio

from armwright.arrays import Array
from armwright.exceptions import ArmwrightError
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.ik.ik import solve_postures
from armwright.kinematics.reach.compliance import Stiffness, backlash_errors, own_loads, tip_displacements, unit_payload
from armwright.kinematics.reach.payload_limits import held_payloads
from armwright.kinematics.reach.reach_postures import postures_over_reach
from armwright.robot.actuators import named_actuator
from armwright.robot.arm import GRAVITY, Actuator, Arm
from armwright.robot.robot_descriptions import find_urdf
from armwright.robot.urdf_reader import UrdfArm, read_urdf

TIPS = {  # by arm: the link whose origin is the tip
    "so101": "gripper_frame_link",
    "openarm": "openarm_right_link8",
    "openarm-hand": "openarm_right_hand_tcp",
    "openarm-early": "gripper_center",
    "ur5e": "tool0",
    "panda": "panda_hand_tcp",
}
KG_CM = 0.01 * GRAVITY  # [N m]
FAR = 1e3  # [m]
SERVO = named_actuator("STS3215-12V").completed()
STALL = SERVO.stall_torque or 0.0  # [N m]
GEAR, COULOMB = SERVO.load_friction or 0.0, SERVO.coulomb_friction or 0.0  # friction: share of the torque, [N m]
COUNT = 360.0 / 4096  # [°] of the servo's encoder
BACKLASHES = {"maker": 0.5, "measured on a servo": 1.0, "measured on the base of an SO-101": 8.75 * COUNT}  # [°]
PAYLOAD = 0.25  # [kg] rated, of the SO-101
SERVO_TEST = 1.5, 0.10, 45.0  # load [kg], lever [m], angle [°]

GAINS = np.array([20.0, 20.0, 20.0, 20.0, 5.0, 5.0, 5.0])  # [N m/rad] of OpenArm's position control in 2025
COMMANDED = 30.0, 45.0, 60.0, 75.0, 90.0  # [°] of OpenArm's first joint
MEASURED = 18.2, 26.94, 36.42, 47.26, 55.91  # [°] where it stayed

POSTURES = {  # values of the URDF's joints [°]
    "ur5e": {
        "stretched": (0, 0, 0, 0, 0, 0),
        "upright": (0, -90, 0, -90, 0, 0),
        "tool down": (0, -60, 90, -120, -90, 0),
        "low": (30, -20, 60, 20, 40, 10),
        "folded back": (-120, -150, -70, 80, -100, 45),
    },
    "panda": {
        "stretched": (0, 90, 0, -4, 0, 90, 0),
        "ready": (0, -45, 0, -135, 0, 90, 45),
        "elbow at the side": (20, 40, -60, -90, 30, 120, 0),
        "low": (-30, 80, 10, -60, -20, 100, 60),
        "folded back": (90, -80, 30, -150, 60, 30, -45),
    },
}


@dataclass(frozen=True)
class Case:
    """Peak torques of an arm's motors [N m], the last one of all further joints."""

    arm: str
    motors: str
    torques: tuple[float, ...]


CASES = (
    Case("so101", "STS3215 at 7.4 V, stall", (19.5 * KG_CM,)),
    Case("so101", "STS3215 at 12 V, stall", (STALL,)),
    Case("so101", "STS3215 at 7.4 V, lifting", (19.5 * KG_CM / (1.0 + GEAR) - COULOMB,)),
    Case("so101", "STS3215 at 12 V, lifting", (STALL / (1.0 + GEAR) - COULOMB,)),
    Case("so101", "STS3215 at 12 V, stall / 1.5", (STALL / 1.5,)),
    Case("so101", "STS3215 at 12 V, rated", (SERVO.rated_torque or 0.0,)),
    Case("openarm", "peak", (40.0, 40.0, 27.0, 27.0, 7.0)),
    Case("openarm", "rated", (20.0, 20.0, 9.0, 9.0, 3.0)),
    Case("openarm-hand", "peak", (40.0, 40.0, 27.0, 27.0, 7.0)),
    Case("openarm-hand", "rated", (20.0, 20.0, 9.0, 9.0, 3.0)),
    Case("openarm-early", "peak: 27 N m, wrist 7 N m", (*4 * (27.0,), 7.0)),
    Case("openarm-early", "20 N m, wrist 7 N m", (*4 * (20.0,), 7.0)),
    Case("openarm-early", "rated: 9 N m, wrist 3 N m", (*4 * (9.0,), 3.0)),
)


def main(arguments: Sequence[str]) -> None:
    files = dict(part.split("=", 1) for part in arguments)
    arms = described_arms({name: Path(file) for name, file in files.items()})
    print_payloads(arms)
    if "so101" in arms:
        print_servos(arms["so101"][1].arm)
    if "openarm-hand" in arms:
        print_droop(arms["openarm-hand"][1])
    for name, postures in POSTURES.items():
        if name in arms:
            print_torques(name, *arms[name], postures)


def described_arms(files: Mapping[str, Path]) -> dict[str, tuple[Path, UrdfArm]]:
    """Return the files and arms that are found, by name; print one line for each other."""
    for name in files.keys() - TIPS.keys():
        print(f"unknown arm {name}; available: {', '.join(TIPS)}")
    arms: dict[str, tuple[Path, UrdfArm]] = {}
    for name, tip in TIPS.items():
        try:
            path = find_urdf(files.get(name, name))
            arms[name] = path, read_urdf(path, tip=tip)
        except ArmwrightError as error:
            print(f"{name} is left out: {error}")
    return arms


def print_payloads(arms: Mapping[str, tuple[Path, UrdfArm]]) -> None:
    """Print the payloads over the reach of all cases."""
    print("\n| arm | motors | mass of links | reach | payload at 50 % | at 100 % |\n|---|---|--:|--:|--:|--:|")
    for case in CASES:
        if case.arm in arms:
            arm = arms[case.arm][1].arm
            mass = sum(link.total_mass for link in arm.links)
            found = held_payloads(postures_over_reach(driven(arm, case.torques), (0.5, 1.0)))
            near, far = (f"{payload:.2f} kg" for payload in found.payloads)
            print(f"| {case.arm} | {case.motors} | {mass:.2f} kg | {found.reach:.3f} m | {near} | {far} |")


def driven(arm: Arm, torques: Sequence[float]) -> Arm:
    """Return the arm with motors of these torques, whose masses are in its links."""
    moving = (joint for joint in arm.joints if joint.kind != "fixed")
    peaks = {id(joint): torques[min(i, len(torques) - 1)] for i, joint in enumerate(moving)}
    joints = (
        replace(joint, actuator=Actuator("motor", 0.0, peaks[id(joint)], tilting_limit=1e9))
        if id(joint) in peaks
        else joint
        for joint in arm.joints
    )
    return replace(arm, joints=tuple(joints), safety_factor=1.0)


def print_servos(arm: Arm) -> None:
    """Print how far backlash, gears and control of servos move the tip of the stretched arm."""
    stacked = stack_arms([arm], "float64")
    arms = replace(stacked, base=np.zeros_like(stacked.base))
    q = solve_postures(arms, np.array([[FAR, 0.0, 0.0]]), precision="float64").q
    frames, servos = forward_kinematics(arms, q), np.ones(arms.motion.shape)
    print(f"\nso101, stretched: tip {1e3 * np.hypot(*frames.tip[0, 0, :2]):.0f} mm from the first axis")
    for text, backlash in BACKLASHES.items():
        play = np.radians(backlash) * servos
        tip, base = (
            1e3 * backlash_errors(arms, frames, part)[0, 0] for part in (play, play * [1, *[0] * (arms.dof - 1)])
        )
        print(f"  backlash of {backlash:.2f}° ({text}): {tip:.1f} mm; of the base joint alone {base:.2f} mm")
    for text, stiffness in (("gears", SERVO.joint_stiffness), ("position gain", SERVO.position_gain)):
        rigid = np.full(arms.motion.shape, np.inf)
        yielding = Stiffness(rigid, rigid, (stiffness or np.inf) * servos)
        own, by_mass = (
            1e3 * np.linalg.norm(tip_displacements(arms, frames, loads(arms, frames), yielding))
            for loads in (own_loads, unit_payload)
        )
        print(f"  {text} of {stiffness:.4g} N m/rad: {own:.1f} mm by its own weight, {0.1 * by_mass:.1f} mm by 0.1 kg")
    own, full = (np.abs(held(arms, q, payload)).max() for payload in (0.0, PAYLOAD))
    print(f"  largest torque: {own:.2f} N m, with {PAYLOAD:g} kg {full:.2f} N m")
    mass, lever, angle = SERVO_TEST
    torque = mass * GRAVITY * lever * np.cos(np.radians(angle))
    exerted = torque, torque / (1.0 + GEAR) - COULOMB, (1.0 + GEAR) * torque + COULOMB
    still, above, below = np.degrees(exerted) / (SERVO.position_gain or np.inf)
    print(f"  a servo that holds {torque:.2f} N m yields by {still:.1f}° of its position gain")
    print(f"  with friction, {above:.1f}° on arrival from above, {below:.1f}° from below")


def print_droop(read: UrdfArm) -> None:
    """Print where OpenArm's first joint stays without compensation of gravity, by its gains and by a user."""
    arms = stack_arms([read.arm], "float64")
    print("\n| commanded | measured | computed | torque by gain and measured error | computed there |")
    print("|--:|--:|--:|--:|--:|")
    for commanded, measured in zip(COMMANDED, MEASURED, strict=True):
        target, there = (np.radians([angle, *[0.0] * 6]) for angle in (commanded, measured))
        stays = equilibrium(arms, target)
        exerted, needed = GAINS[0] * np.radians(commanded - measured), abs(held(arms, there[None, None])[0, 0])
        print(
            f"| {commanded:g}° | {measured:g}° | {np.degrees(stays[0]):.1f}° | {exerted:.1f} N m | {needed:.1f} N m |"
        )
    horizontal = np.radians([90.0, *[0.0] * 6])
    print(f"horizontal: {abs(held(arms, horizontal[None, None])[0, 0]):.1f} N m")


def equilibrium(arms: ArmArrays, target: Array) -> Array:
    """Return the (D,) posture in which gains times errors hold an arm, within its limits [rad]; target: (D,)."""
    q = target
    for _ in range(500):
        step = target - held(arms, q[None, None])[0] / GAINS - q
        q = np.clip(q + 0.1 * step, arms.lower[0], arms.upper[0])
    return q


def print_torques(name: str, path: Path, read: UrdfArm, postures: Mapping[str, Sequence[float]]) -> None:
    """Print the holding torques of postures, and how far they are off Pinocchio's."""
    q = np.radians(list(postures.values()))
    ours, theirs = held(stack_arms([read.arm], "float64"), q[None]), gravity(read, path, q)
    print(f"\n| {name} | holding torques [N m] | largest difference |\n|---|---|--:|")
    for posture, mine, difference in zip(postures, ours, np.abs(ours - theirs).max(axis=1), strict=True):
        print(f"| {posture} | {', '.join(f'{round(value, 2) + 0.0:.2f}' for value in mine)} | {difference:.0e} |")


def held(arms: ArmArrays, q: Array, payload: float = 0.0) -> Array:
    """Return the torques (T, D) that hold an arm in postures q (1, T, D) [N m]."""
    loads = np.full(q.shape[1], payload)
    nowhere = np.zeros((q.shape[1], 3))
    return solve_postures(arms, nowhere, 0, initial_q=q, payload=loads, precision="float64").torque[0]


def gravity(read: UrdfArm, path: Path, q: Array) -> Array:
    """Return the torques (T, D) by Pinocchio in postures q (T, D) [N m]."""
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    joints = [model.joints[model.getJointId(name)] for name in read.joints]
    torques = []
    for row in q:
        values = pinocchio.neutral(model)
        for joint, value in zip(joints, row, strict=True):
            values[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        torques.append(pinocchio.computeGeneralizedGravity(model, data, values)[[joint.idx_v for joint in joints]])
    return np.array(torques)


if __name__ == "__main__":
    main(sys.argv[1:])
