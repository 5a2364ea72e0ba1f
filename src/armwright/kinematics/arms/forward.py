"""Forward kinematics in numpy and float64, of many arms in many postures or of one arm in one posture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import PRISMATIC, ArmArrays, Floats, stack_arms
from armwright.kinematics.arms.motor_bodies import body_values
from armwright.robot.arm import Arm
from armwright.robot.axes import Axis
from armwright.rotations import rotation_about
from armwright.tasks.obstacles import Solid


@dataclass(frozen=True)
class Frames:
    """Joint frames of N arms in K postures, in the world."""

    rotation: Array  # (N, K, D, 3, 3) frame of what joint j carries, its axes as columns
    position: Array  # (N, K, D, 3) position of the joint, after its translation [m]
    axis: Array  # (N, K, D, 3) that it rotates about or translates along; 0 for a fixed joint
    tip: Array  # (N, K, 3) [m]

    def from_tip(self, local: Floats) -> Array:
        """Return the (N, K, 3) world positions of points (N, 3) from the tip in the last frame [m]."""
        return self.tip + (self.rotation[:, :, -1] @ local.astype(np.float64)[:, None, :, None])[..., 0]


def forward_kinematics(arms: ArmArrays, q: Array) -> Frames:
    """Return the joint frames of N arms in postures; q: (N, K, D) joint angles [rad] or displacements [m]."""
    (n, k, dof), q = q.shape, arms.coupled(q)
    revolute, prismatic = arms.motion < PRISMATIC, arms.prismatic  # (N, D)
    local = arms.axis.astype(np.float64)  # (N, D, 3)
    rotated = rotation_about(local[:, None], np.where(revolute[:, None], q, 0.0))
    displacement = np.where(prismatic[:, None], q, 0.0)[..., None]
    rotation, position, axis = np.empty((n, k, dof, 3, 3)), np.empty((n, k, dof, 3)), np.empty((n, k, dof, 3))
    frame = np.broadcast_to(np.eye(3), (n, k, 3, 3))
    at = np.broadcast_to(arms.base.astype(np.float64)[:, None], (n, k, 3))
    offset = arms.offset.astype(np.float64)
    for j in range(dof):
        axis[:, :, j] = (frame @ local[:, None, j, :, None])[..., 0]
        position[:, :, j] = at + axis[:, :, j] * displacement[:, :, j]
        frame = rotation[:, :, j] = frame @ rotated[:, :, j]
        at = position[:, :, j] + (frame @ offset[:, None, j, :, None])[..., 0]
    return Frames(rotation, position, axis, at)


def jacobian_of(arms: ArmArrays, frames: Frames) -> Array:
    """Return the (N, K, 3, D) derivative of the tip position by the independent joints [m/rad] or [m/m]."""
    rotational = np.cross(frames.axis, frames.tip[:, :, None] - frames.position)
    translates = (arms.motion >= PRISMATIC)[:, None, :, None]  # or is fixed, whose axis is 0
    return arms.by_independent(np.where(translates, frames.axis, rotational).swapaxes(-1, -2))


def joint_positions(arm: Arm, q: Sequence[float] | Array) -> Array:
    """Return the (J + 1, 3) positions of the joints and, last, of the tip [m]; q: (J,) [rad] or [m]."""
    frames = _frames(arm, q)
    return np.vstack([frames.position[0, 0], frames.tip[0]])


def link_lines(arm: Arm, q: Sequence[float] | Array) -> list[Array]:
    """Return start and end (2, 3) of each link and, last, of the tool [m]; q: (J,) [rad] or [m]."""
    frames = _frames(arm, q)
    ends = _link_ends(arm, frames)
    return [*np.stack([frames.position[0, 0], ends], axis=1), np.vstack([ends[-1:], frames.tip[0]])]


def rails(arm: Arm, q: Sequence[float] | Array) -> list[Array]:
    """Return start and end (2, 3) of the rail of each prismatic joint [m]; q: (J,) [rad] or [m]."""
    frames = _frames(arm, q)
    joints = zip(arm.joints, q, frames.position[0, 0], frames.axis[0, 0], strict=True)
    return [
        np.array([position + (limit - value) * axis for limit in (joint.lower, joint.upper)])
        for joint, value, position, axis in joints
        if joint.kind == "prismatic"
    ]


def motor_solids(arm: Arm, q: Sequence[float] | Array) -> list[tuple[Axis, Solid]]:
    """Return axis and solid of the motor body of each joint that has one; q: (J,) [rad] or [m]."""
    frames = _frames(arm, q)
    rotations = [np.eye(3), *frames.rotation[0, 0]]  # of the base and the links
    found: list[tuple[Axis, Solid]] = []
    starts = [np.array(arm.base), *_link_ends(arm, frames)]
    for joint, start, rotation in zip(arm.joints, starts[:-1], rotations[:-1], strict=True):
        if joint.body is not None:
            _, axis, half, centre = body_values(joint.body)
            x, y, z = (start + rotation @ np.array(centre)).tolist()
            columns = rotation[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
            found.append((joint.body.axis, Solid(joint.body.shape, (x, y, z), columns, half)))
    return found


def column_solid(arm: Arm) -> Solid | None:
    """Return the solid of the column that the base stands on; None without one."""
    if arm.column is None:
        return None
    radius, half = arm.column.radius, arm.column.length / 2
    x, y, z = arm.base
    return Solid("cylinder", (x, y, z - half), np.eye(3), (radius, radius, half))


def _link_ends(arm: Arm, frames: Frames) -> Array:
    """Return the (J, 3) positions of the ends of all links [m]."""
    offsets = np.array([link.offset for link in arm.links])
    return frames.position[0, 0] + (frames.rotation[0, 0] @ offsets[..., None])[..., 0]


def _frames(arm: Arm, q: Sequence[float] | Array) -> Frames:
    return forward_kinematics(stack_arms([arm], "float64"), np.asarray(q, dtype=np.float64)[None, None])
