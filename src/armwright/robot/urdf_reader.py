"""An existing arm from its URDF: the serial chain from its base to its tip as an `Arm`.

Links that are fixed to a link of the chain add to its mass, and so do fingers, which stay at 0. An `Arm` needs frames
that are parallel to the world frame with all joints at 0, and axes along x, y or z. If the zero posture of the file is
not such a posture, another one is found: a joint at a right angle to the one before it can be aligned with an axis of
the world by rotating that one.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError, did_you_mean
from armwright.robot.arm import AXES, Actuator, Arm, Joint, Link, MountedTool, Tensor, Vector
from armwright.robot.link_inertia import point_inertia
from armwright.robot.urdf_xml import Pose, UrdfDocument, UrdfJoint, UrdfLink, read_document
from armwright.rotations import rotation_about

SNAP = 1e-3  # [rad]; an axis within it of x, y or z is aligned with it
MAX_ANGLE = 2 * math.pi  # [rad]
NOWHERE = (0.0, 0.0, 0.0)
RADIUS = 0.04  # [m], for drawings, if the file has no cylinder
FINGERS = 2  # longest chain of joints of a branch that counts as a finger
GRIPPER = re.compile("grip|jaw|finger", re.IGNORECASE)  # names of a last joint that belongs to a gripper


@dataclass(frozen=True, slots=True)
class UrdfArm:
    """An arm read from a URDF, with its base link at the world's origin."""

    name: str  # of the robot
    arm: Arm
    base_link: str
    tip: str  # the link whose origin is the tip
    joints: tuple[str, ...]  # names of the moving joints, from base to tip
    signs: tuple[float, ...]  # value q of a joint of the arm is signs * q + zeros in the URDF
    zeros: tuple[float, ...]  # value of each joint in the URDF at 0 of the arm [rad] or [m]
    notes: tuple[str, ...] = ()  # choices, changes and missing data, as sentences for the user

    def values_in_urdf(self, q: Sequence[float] | Array) -> Array:
        """Return the values (..., J) of the URDF's joints for those of the arm (..., J) [rad] or [m]."""
        return np.asarray(q) * self.signs + self.zeros

    def values_in_arm(self, q: Sequence[float] | Array) -> Array:
        """Return the values (..., J) of the arm's joints for those of the URDF (..., J) [rad] or [m]."""
        return (np.asarray(q) - self.zeros) * self.signs


def read_urdf(path: str | Path, tip: str | None = None, base_link: str | None = None) -> UrdfArm:
    """Read the serial arm of a URDF file.

    Args:
        path: The URDF file.
        tip: The link whose origin should reach the targets; by default the last one before a gripper.
        base_link: The link that is fixed to the ground; by default the root of the robot.

    Raises:
        ArmError: If the file is not a URDF, or has no serial arm that can be computed.
    """
    document = read_document(Path(path))
    tree = _LinkTree(document, str(path))
    base = tree.root if base_link is None else tree.check_link(base_link, "base link")
    last = tree.default_tip(base) if tip is None else tree.check_link(tip, "tip")
    chain = tree.chain(base, last)
    moving = [joint for joint in chain if joint.kind != "fixed"]
    if not moving:
        raise ArmError(f'{path}: between the links "{base}" and "{last}" no joint moves')
    for joint in moving:
        _check_joint(joint, str(path))
    zeros = _zeros(tree, base, moving, str(path))
    return _arm(tree, base, last, moving, zeros, _chain_notes(tree, base, tip, last, moving))


def _arm(
    tree: "_LinkTree", base: str, tip: str, moving: Sequence[UrdfJoint], zeros: Mapping[str, float], notes: list[str]
) -> UrdfArm:
    poses = tree.poses(base, zeros)
    bodies = tree.bodies(base, [joint.child for joint in moving])  # names of links, per body
    positions = [poses[joint.child].position for joint in moving] + [poses[tip].position]
    joints: list[Joint] = []
    links: list[Link] = []
    signs: list[float] = []
    snapped = 0.0
    for i, joint in enumerate(moving):
        axis, sign, deviation = _nearest_axis(poses[joint.child].rotation @ joint.axis)
        signs.append(sign)
        snapped = max(snapped, deviation)
        joints.append(_as_joint(joint, axis, sign, zeros[joint.name], notes))
        body = [tree.document.links[name] for name in bodies[i + 1]]
        mass, centre, inertia = _merged(body, poses)
        radius = max((link.radius for link in body if link.radius is not None), default=RADIUS)
        link = Link(_vector(positions[i + 1] - positions[i]), 0.0, NOWHERE, radius)
        # A file states nothing of a tube, so all mass is what the link carries.
        shift = _vector(centre - positions[i + 1])
        links.append(replace(link, end_mass=mass, end_shift=shift, end_inertia=_tensor(inertia)))
    if snapped > 1e-9:
        notes.append(f"axes are taken to lie along x, y or z; they are off by up to {snapped:.1g} rad")
    shifted = [f"{name} by {value:.4g} rad" for name, value in zeros.items() if value]
    if shifted:
        notes.append(f"zero is moved, so that all axes lie along x, y or z: {', '.join(shifted)}")
    if points := [name for name, link in tree.document.links.items() if link.mass and not link.inertia.any()]:
        notes.append(f"links without inertia count as points: {', '.join(points)}")
    if not any(link.total_mass for link in links):
        notes.append("no link states a mass; torques are those of the payload alone")
    if any(joint.actuator is None for joint in joints):
        notes.append("not every joint states an effort, so how much of it is used is not known")
    rotation = poses[tip].rotation
    arm = Arm(
        base=_vector(positions[0]),
        joints=tuple(joints),
        links=tuple(links),
        tool=MountedTool(axis=_vector(rotation[:, 2]), side=_vector(rotation[:, 0])),
        base_mass=sum(tree.document.links[name].mass for name in bodies[0]),
    )
    names = tuple(joint.name for joint in moving)
    values = tuple(zeros[name] for name in names)
    return UrdfArm(tree.document.name, arm, base, tip, names, tuple(signs), values, tuple(notes))


def _merged(links: Sequence[UrdfLink], poses: Mapping[str, Pose]) -> tuple[float, Array, Array]:
    """Return mass [kg], centre [m] and inertia about it [kg m²] of links that are one rigid body, in the base frame."""
    masses = np.array([link.mass for link in links])
    centres = np.array([(poses[link.name] @ Pose(np.eye(3), link.com)).position for link in links])
    mass = float(masses.sum())
    centre = masses @ centres / (mass or 1.0)
    rotations = np.array([poses[link.name].rotation for link in links])
    tensors = rotations @ [link.inertia for link in links] @ rotations.swapaxes(1, 2)
    return mass, centre, (tensors + point_inertia(masses, centres - centre)).sum(axis=0)


def _check_joint(joint: UrdfJoint, where: str) -> None:
    """Raise ArmError if a joint cannot be part of a serial arm."""
    of = f'{where}: joint "{joint.name}"'
    if joint.kind in ("floating", "planar"):
        raise ArmError(f"{of} is {joint.kind}; between base and tip only revolute and prismatic joints can be computed")
    if joint.mimics is not None:
        raise ArmError(f'{of} mimics "{joint.mimics}"; between base and tip each joint must move independently')
    if joint.kind != "continuous" and not (joint.lower or 0.0) < (joint.upper or 0.0):
        raise ArmError(f"{of}: expected limits lower < upper, got {joint.lower or 0.0:g} and {joint.upper or 0.0:g}")


def _chain_notes(tree: "_LinkTree", base: str, tip: str | None, last: str, moving: Sequence[UrdfJoint]) -> list[str]:
    """Return the notes on the choice of a chain."""
    notes = [] if tip is not None else [f'the tip is the link "{last}" (--tip names another)']
    others = sum(joint.kind != "fixed" for joint in tree.below(base)) - len(moving)
    if others:
        notes.append(f"{others} {'other joint stays' if others == 1 else 'other joints stay'} at 0, such as fingers")
    return notes


def _as_joint(joint: UrdfJoint, axis: int, sign: float, zero: float, notes: list[str]) -> Joint:
    """Return the joint about the positive world axis, with limits relative to its zero."""
    actuator = None
    if joint.effort:
        actuator = Actuator(joint.name, 0.0, peak_torque=abs(joint.effort), speed=joint.speed or None)
    if joint.kind == "continuous":
        return Joint("revolute", AXES[axis], -MAX_ANGLE, MAX_ANGLE, actuator)
    lower, upper = (joint.lower or 0.0) - zero, (joint.upper or 0.0) - zero
    if sign < 0.0:
        lower, upper = -upper, -lower
    if joint.kind == "prismatic":
        return Joint("prismatic", AXES[axis], lower, upper, actuator)
    if max(-lower, upper) > MAX_ANGLE:
        if max(-lower, upper) > MAX_ANGLE + 1e-2:
            notes.append(f"{joint.name} rotates from {lower:.4g} to {upper:.4g} rad; ±2π of it is used")
        lower, upper = max(lower, -MAX_ANGLE), min(upper, MAX_ANGLE)
    return Joint("revolute", AXES[axis], lower, upper, actuator)


def _zeros(tree: "_LinkTree", base: str, moving: Sequence[UrdfJoint], where: str) -> dict[str, float]:
    """Return a posture [rad] with all joint axes along axes of the world, 0 for as many joints as possible."""
    zeros = {joint.name: 0.0 for joint in moving}

    def axes() -> dict[str, Array]:
        poses = tree.poses(base, zeros)
        return {joint.name: poses[joint.child].rotation @ joint.axis for joint in moving}

    before: UrdfJoint | None = None  # the last joint that is not prismatic
    for joint in moving:
        axis = axes()[joint.name]
        if _nearest_axis(axis)[2] > SNAP and before is not None:
            index, sign, _ = _nearest_axis(axes()[before.name])
            about = sign * np.eye(3)[index]
            if abs(float(axis @ about)) < SNAP:
                one = np.roll(np.abs(about), 1)
                angle = math.atan2(float(axis @ np.cross(about, one)), float(axis @ one))
                zeros[before.name] += round(angle / (math.pi / 2)) * (math.pi / 2) - angle
        if joint.kind != "prismatic":
            before = joint
    for name, axis in axes().items():
        if _nearest_axis(axis)[2] > SNAP:
            vector = ", ".join(f"{value:.3f}" for value in axis)
            raise ArmError(
                f'{where}: joint "{name}" has the axis ({vector}) with all joints at 0, along none of x, y and z '
                "and not at a right angle to the joint before; such an arm cannot be computed yet"
            )
    return zeros


def _nearest_axis(direction: Array) -> tuple[int, float, float]:
    """Return the index of the world axis nearest to a unit vector (3,), the sign, and the angle between them [rad]."""
    axis = int(np.abs(direction).argmax())
    sign = math.copysign(1.0, direction[axis])
    across = float(np.linalg.norm(np.delete(direction, axis)))
    return axis, sign, math.atan2(across, abs(float(direction[axis])))


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _tensor(rows: Array) -> Tensor:
    x, y, z = map(_vector, rows)
    return x, y, z


class _LinkTree:
    """The links of a URDF as a tree."""

    def __init__(self, document: UrdfDocument, where: str) -> None:
        self.document, self._where = document, where
        self._children: dict[str, list[UrdfJoint]] = {name: [] for name in document.links}
        self._parent: dict[str, UrdfJoint] = {}
        for joint in document.joints:
            if joint.child in self._parent:
                raise ArmError(f'{where}: the link "{joint.child}" has two parents; expected a tree')
            self._parent[joint.child] = joint
            self._children[joint.parent].append(joint)
        roots = [name for name in document.links if name not in self._parent]
        if len(roots) != 1:
            names = ", ".join(roots[:5]) or "none: the joints form a cycle"
            raise ArmError(f"{where}: expected one root link, found {len(roots)} ({names})")
        self.root = roots[0]
        if len(list(self.below(self.root))) < len(document.joints):
            raise ArmError(f"{where}: some joints form a cycle; expected a tree")
        self._deepest: dict[str, int] = {}  # moving joints of the longest chain below each link
        self._longest: dict[str, int] = {}  # links of the longest chain below each link
        for joint in reversed(list(self.below(self.root))):
            self._deepest[joint.parent] = max(self._deepest.get(joint.parent, 0), self._moving(joint))
            self._longest[joint.parent] = max(self._longest.get(joint.parent, 0), 1 + self._longest.get(joint.child, 0))

    def _moving(self, joint: UrdfJoint) -> int:
        """Return the number of moving joints of the longest chain from this joint on."""
        return joint.moves + self._deepest.get(joint.child, 0)

    def below(self, link: str) -> Iterator[UrdfJoint]:
        """Yield all joints beyond a link, parents first."""
        waiting = [link]
        while waiting:
            joints = self._children[waiting.pop()]
            yield from joints
            waiting += [joint.child for joint in joints]

    def check_link(self, link: str, kind: str) -> str:
        """Return the name of a link; raise ArmError if there is none."""
        if link not in self.document.links:
            names = ", ".join(list(self.document.links)[:40])
            raise ArmError(
                f'{self._where} has no link "{link}" ({kind}).{did_you_mean(link, self.document.links)} Links: {names}'
            )
        return link

    def chain(self, base: str, tip: str) -> list[UrdfJoint]:
        """Return the joints from a link to one beyond it."""
        chain: list[UrdfJoint] = []
        link = tip
        while link != base:
            if link not in self._parent:
                raise ArmError(f'{self._where}: the link "{tip}" is not beyond "{base}"')
            chain.append(self._parent[link])
            link = self._parent[link].parent
        return chain[::-1]

    def default_tip(self, base: str) -> str:
        """Return the end of the only chain: the last link before a gripper, or before no joint moves any more.

        From there it follows the longest chain of fixed joints.
        """
        link, moved = base, 0
        while branches := [joint for joint in self._children[link] if self._moving(joint)]:
            if moved and all(self._is_gripper(joint) for joint in branches):
                break
            if len(branches) > 1:
                arms = [joint for joint in branches if self._moving(joint) > FINGERS]
                if len(arms) > 1 or not (arms or moved):
                    names = ", ".join(joint.child for joint in branches)
                    raise ArmError(f'{self._where} branches at the link "{link}" to {names}; name the tip (--tip LINK)')
                if not arms:
                    break
                branches = arms
            link, moved = branches[0].child, moved + branches[0].moves
        while fixed := [joint for joint in self._children[link] if not self._moving(joint) and joint.kind == "fixed"]:
            link = max(fixed, key=lambda joint: self._longest.get(joint.child, 0)).child
        return link

    def _is_gripper(self, joint: UrdfJoint) -> bool:
        """Return True if a last joint is named like those of grippers."""
        return self._moving(joint) == 1 and GRIPPER.search(f"{joint.name} {joint.child}") is not None

    def poses(self, base: str, values: Mapping[str, float]) -> dict[str, Pose]:
        """Return the pose of every link in the base frame; values: joint angles by name [rad], by default 0."""
        poses = {base: Pose(np.eye(3), np.zeros(3))}
        for joint in self.below(base):
            motion = Pose(rotation_about(joint.axis, values.get(joint.name, 0.0)), np.zeros(3))
            poses[joint.child] = poses[joint.parent] @ joint.origin @ motion
        return poses

    def bodies(self, base: str, moved: Sequence[str]) -> list[list[str]]:
        """Return the links of each rigid body: that of the base, then that of each link in `moved`."""
        body = {base: 0}
        starts = {link: number for number, link in enumerate(moved, start=1)}
        for joint in self.below(base):
            body[joint.child] = starts.get(joint.child, body[joint.parent])
        return [[link for link, number in body.items() if number == n] for n in range(len(moved) + 1)]
