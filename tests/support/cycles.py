"""Random arms with cycles that they can follow at least in part, and oracles for lines of the tool."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from armwright.kinematics.arms.arm_arrays import ArmArrays, carrying, stack_arms
from armwright.kinematics.cycle.cycle_path import CyclePaths, find_paths
from armwright.robot.arm import Actuator, Arm
from armwright.tasks.motions import CyclePlan
from armwright.tasks.task import Task
from tests.support.exported_arms import Peer, moving, odd_arms, peer_of
from tests.support.reference_kinematics import Array

KINDS = ("position", "axis", "orientation")
INERTIA, COULOMB, VISCOUS = 0.02, 0.3, 0.1  # of the rotor [kg m²], [N m], [N m s/rad]
PEAK, VOLTAGE, CURRENT = 60.0, 24.0, 5.0  # [N m], [V], [A]
DRIVE = Actuator(
    "drive", 0.3, PEAK, 8.0, continuous_torque=20.0, corner_speed=0.0, rotor_inertia=INERTIA, coulomb_friction=COULOMB,
    viscous_friction=VISCOUS, voltage=VOLTAGE, current=CURRENT,
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Arms along a cycle whose targets are poses of the first of them."""

    task: Task
    arms: tuple[Arm, ...]
    arrays: ArmArrays
    plan: CyclePlan
    paths: CyclePaths

    @property
    def peers(self) -> list[Peer]:
        return [peer_of(arm) for arm in self.arms]


def random_task(arm: Arm, kind: str, rng: np.random.Generator, picks: bool = False, **cycle: Any) -> Task:
    """Three poses of the arm, each near the one before: a line, a joint motion, and a line or joint motion back."""
    joints = [joint for _, joint in moving(arm)]
    lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
    q = 0.5 * (lower + upper) + rng.uniform(-0.3, 0.3, len(joints)) * (upper - lower)
    targets: list[dict[str, Any]] = []
    for _ in range(3):
        pose = peer_of(arm).tip(q)
        target: dict[str, Any] = {"position": pose[:3, 3].tolist()}
        if kind == "axis":
            target["axis"] = pose[:3, 2].tolist()
        if kind == "orientation":
            target["orientation"] = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz").tolist()
        targets.append(target)
        q = np.clip(q + rng.uniform(-0.1, 0.1, len(joints)) * (upper - lower), lower, upper)
    by = rng.choice(["line", "joint"], 3).tolist()
    by[1] = "line"
    actions = ("pick", "place", None) if picks else (None, None, None)
    steps = [{"to": n, "by": how, "do": do} for n, (how, do) in enumerate(zip(by, actions, strict=True), start=1)]
    return Task.model_validate({"name": "random", "targets": targets, "cycle": {"steps": steps, **cycle}})


def random_case(
    dof: int, kind: str, seed: int, n: int = 3, payload: Any = 0.0, drive: Actuator | None = None, **cycle: Any
) -> Case:
    """Arms along a random cycle; payload: as in a task file; drive: of all joints that move."""
    arms = tuple(_with_drive(_with_short_slides(arm), drive) for arm in odd_arms(n, dof, seed))
    task = random_task(arms[0], kind, np.random.default_rng([seed, dof]), **cycle)
    task = Task.model_validate({**task.model_dump(), "payload": payload})
    arrays, plan = carrying(stack_arms(arms, "float64"), task.load_shape), task.plan(task.target_positions)
    return Case(task, arms, arrays, plan, find_paths(arrays, plan))


def _with_short_slides(arm: Arm) -> Arm:
    """Slides of decimetres instead of metres, which would take thousands of samples."""
    joints = (
        replace(joint, lower=0.15 * joint.lower, upper=0.15 * joint.upper) if joint.kind == "prismatic" else joint
        for joint in arm.joints
    )
    return replace(arm, joints=tuple(joints))


def _with_drive(arm: Arm, drive: Actuator | None) -> Arm:
    joints = (joint if joint.kind == "fixed" else replace(joint, actuator=drive) for joint in arm.joints)
    return replace(arm, joints=tuple(joints))


def line_errors(peer: Peer, task: Task, start: int, end: int, share: Array, q: Array) -> Array:
    """(S, 2) distance of the tip [m] and angle of the tool [rad] from shares of the line between two targets.

    q: (S, D) of the joints that move.
    """
    first, last = (task.targets[i] for i in (start, end))
    points = task.target_positions[[start, end]]
    poses = np.array([peer.tip(row) for row in q])
    distance = np.linalg.norm(poses[:, :3, 3] - points[0] - share[:, None] * (points[1] - points[0]), axis=1)
    if isinstance(first, tuple) or isinstance(last, tuple):
        return np.column_stack([distance, np.zeros(len(share))])
    if first.orientation is not None:
        ends = Rotation.from_euler("xyz", [first.orientation, last.orientation])
        angle = (Slerp([0.0, 1.0], ends)(share).inv() * Rotation.from_matrix(poses[:, :3, :3])).magnitude()
        return np.column_stack([distance, angle])
    axes = np.array([first.axis, last.axis]) / np.linalg.norm([first.axis, last.axis], axis=1, keepdims=True)
    between = np.arctan2(np.linalg.norm(np.cross(*axes)), axes[0] @ axes[1])
    if between < 1e-9:
        wanted = np.broadcast_to(axes[0], (len(share), 3))
    else:
        wanted = np.sin((1 - share) * between)[:, None] * axes[0] + np.sin(share * between)[:, None] * axes[1]
        wanted = wanted / np.sin(between)
    tool = poses[:, :3, 2]
    return np.column_stack(
        [distance, np.arctan2(np.linalg.norm(np.cross(tool, wanted), axis=1), (tool * wanted).sum(axis=1))]
    )


def own_joints(arm: Arm, q: Array) -> Array:
    """(S, D) of the joints that move, of rows (S, J) of all joints."""
    return q[:, [number - 1 for number, _ in moving(arm)]]


def tolerated(paths: CyclePaths, rows: Sequence[int] | None = None) -> np.ndarray:
    """(N,) arms that stay within the tolerance of their lines, without a jump."""
    allowed = paths.plan.cycle.tolerance
    good = (paths.path_error <= allowed.largest_distance) & (paths.path_angle <= allowed.largest_angle) & ~paths.jumps
    return good.all(axis=1)
