"""An existing arm from its URDF: the serial chain from its base to its tip as an `Arm`.

Links that are fixed to a link of the chain add to its mass, and so do fingers, which stay at 0. Local frames of an
`Arm` are parallel to the world frame with all joints at 0, so axes, links and tensors are those of the file in this
posture.

A joint that mimics another one of the chain has no drive: that of the other moves both, as far and as fast as the
limits of both allow. The effort that the file states of it is not used, since its coupling carries it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError, did_you_mean
from armwright.robot.arm import Actuator, Arm, Coupling, Joint, Link, MountedTool, Tensor
from armwright.robot.arm_tip import find_tip
from armwright.robot.axes import Axis, Vector, axis_along
from armwright.robot.link_inertia import point_inertia
from armwright.robot.plausibility import implausible
from armwright.robot.urdf_xml import Pose, UrdfDocument, UrdfJoint, UrdfLink, read_document
from armwright.text import listed

CUT_OFF = 4e-3  # [rad]; an angle of three digits as near to a right angle, such as 3.14, may stand for it
MAX_ANGLE = 2 * math.pi  # [rad]
NEGLIGIBLE = 1e-4  # of the moving mass: so light a link has no inertia to speak of, whatever its shape
NOWHERE = (0.0, 0.0, 0.0)
RADIUS = 0.04  # [m], for drawings, if the file has no cylinder


@dataclass(frozen=True, slots=True)
class UrdfArm:
    """An arm read from a URDF, with its base link at the world's origin, turned as it is under the root."""

    name: str  # of the robot
    arm: Arm
    base_link: str  # the link whose origin is the world's
    tip: str  # the link whose origin is the tip
    joints: tuple[str, ...]  # names of the moving joints, from base to tip
    notes: tuple[str, ...] = ()  # the tip, its joints and what is left out; choices, changes and missing data


def read_urdf(path: str | Path, tip: str | None = None, base_link: str | None = None) -> UrdfArm:
    """Read the serial arm of a URDF file.

    Args:
        path: The URDF file.
        tip: The link whose origin should reach the targets; by default the last one before a gripper.
        base_link: The link that is fixed to the ground, turned as under the root; by default the root of the robot.

    Raises:
        ArmError: If the file is not a URDF, or has no serial arm that can be computed.
    """
    document = read_document(Path(path))
    tree = _LinkTree(document, str(path))
    base = tree.root if base_link is None else tree.check_link(base_link, "base link")
    last = find_tip(base, tree.joints, str(path)) if tip is None else tree.check_link(tip, "tip")
    chain = tree.chain(base, last)
    moving = [joint for joint in chain if joint.kind != "fixed"]
    if not moving:
        raise ArmError(f'{path}: between the links "{base}" and "{last}" no joint moves')
    for joint in moving:
        _check_joint(joint, str(path))
    return _arm(tree, base, last, moving, _chain_notes(tree, base, tip, last, chain))


def _arm(tree: "_LinkTree", base: str, tip: str, moving: Sequence[UrdfJoint], notes: list[str]) -> UrdfArm:
    poses = tree.poses(base)
    bodies = tree.bodies(base, [joint.child for joint in moving])  # names of links, per body
    positions = [poses[joint.child].position for joint in moving] + [poses[tip].position]
    moved = {joint.child for joint in tree.document.joints if joint.kind != "fixed"}
    any_mass = any(tree.document.links[name].mass for body in bodies[1:] for name in body)
    joints: list[Joint] = []
    links: list[Link] = []
    for i, joint in enumerate(moving):
        joints.append(_as_joint(joint, axis_along(_vector(poses[joint.child].rotation @ joint.axis)), notes))
        body = [tree.document.links[name] for name in bodies[i + 1]]
        mass, centre, inertia = _merged(body, poses)
        radius = max((link.radius for link in body if link.radius is not None), default=RADIUS)
        unknown = tuple(link.name for link in body if link.name in moved and not (link.has_mass and any_mass))
        link = Link(_vector(positions[i + 1] - positions[i]), 0.0, NOWHERE, radius, without_mass=unknown)
        # A file states nothing of a tube, so all mass is what the link carries.
        shift = _vector(centre - positions[i + 1])
        links.append(replace(link, end_mass=mass, end_shift=shift, end_inertia=_tensor(inertia)))
    notes += _couple(joints, moving, tree)
    beyond = [tree.document.links[name] for body in bodies[1:] for name in body]
    least = NEGLIGIBLE * sum(link.mass for link in beyond)
    if points := [link.name for link in beyond if link.mass > least and not link.inertia.any()]:
        notes.append(f"links without inertia count as points: {', '.join(points)}")
    if any(joint.actuator is None for joint in joints if joint.coupling is None):
        notes.append("not every joint states an effort, so how much of it is used is not known")
    rotation = poses[tip].rotation
    arm = Arm(
        base=_vector(positions[0]),
        joints=tuple(joints),
        links=tuple(links),
        tool=MountedTool(axis=_vector(rotation[:, 2]), side=_vector(rotation[:, 0])),
        base_mass=sum(tree.document.links[name].mass for name in bodies[0]),
    )
    if arm.no_mass:
        notes.append(f"{arm.no_mass}, so masses, torques and payloads are not known")
    notes += implausible(arm, [[tree.document.links[name] for name in body] for body in bodies[1:]])
    return UrdfArm(tree.document.name, arm, base, tip, tuple(joint.name for joint in moving), tuple(notes))


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
    if joint.kind != "continuous" and not (joint.lower or 0.0) < (joint.upper or 0.0):
        raise ArmError(f"{of}: expected limits lower < upper, got {joint.lower or 0.0:g} and {joint.upper or 0.0:g}")


def _couple(joints: list[Joint], moving: Sequence[UrdfJoint], tree: "_LinkTree") -> Iterator[str]:
    """Let joints follow those that they mimic, in place, within the limits and speeds of both; yield notes."""
    for i, joint in enumerate(moving):
        if joint.mimics is None:
            continue
        coupling = _coupling(joint, moving, tree)
        k, factor = coupling.leader, coupling.factor
        name, drive = moving[k].name, joints[k].actuator
        low, high = sorted((limit - coupling.offset) / factor for limit in (joints[i].lower, joints[i].upper))
        low, high = max(low, joints[k].lower), min(high, joints[k].upper)
        if not low < high:
            raise ArmError(
                f'{tree.where}: the limits of "{name}" and "{joint.name}", which mimics it, exclude each other'
            )
        if drive is not None and joint.speed:
            drive = replace(drive, speed=min(drive.speed or math.inf, joint.speed / abs(factor)))
        joints[k] = replace(joints[k], lower=low, upper=high, actuator=drive)
        joints[i] = replace(joints[i], actuator=None, coupling=coupling)
        yield f"{joint.name} = {factor:g} {name} {coupling.offset:+g}, so the drive of {name} moves both"


def _coupling(joint: UrdfJoint, moving: Sequence[UrdfJoint], tree: "_LinkTree") -> Coupling:
    """Return how a joint of the chain follows an independent one of it, perhaps through others."""
    by_name, names = {one.name: one for one in tree.document.joints}, [one.name for one in moving]
    leader, factor, offset, passed = joint, 1.0, 0.0, list[str]()
    while leader.mimics is not None and leader.name not in passed:
        passed.append(leader.name)
        factor, offset = factor * leader.multiplier, offset + factor * leader.offset
        leader = by_name.get(leader.mimics, leader)
    if leader.name in passed or leader.name not in names or factor == 0.0:
        raise ArmError(
            f'{tree.where}: joint "{joint.name}" mimics "{joint.mimics}", moving {factor:g} times as far; expected an '
            f"independent joint of the chain, and not 0 times; for the part before it, try --tip {joint.parent}"
        )
    return Coupling(names.index(leader.name), factor, offset)


def _chain_notes(tree: "_LinkTree", base: str, tip: str | None, last: str, chain: Sequence[UrdfJoint]) -> list[str]:
    """Return the notes on the choice of a chain, how it is mounted, and its angles."""
    moving = [joint.name for joint in chain if joint.kind != "fixed"]
    others = [joint.name for joint in tree.below(base) if joint.kind != "fixed" and joint.name not in moving]
    left_out = f"; left out, at 0: {listed(others)}" if others else ""
    named = "" if tip is not None else " (--tip names another)"
    down = ", ".join(f"{value:.4g}" for value in (-tree.orientation(base)[2]).round(6) + 0.0)
    notes = [
        f'the tip is the link "{last}"{named}; joints from "{base}": {", ".join(moving)}{left_out}',
        f'the axes of the world are those of "{tree.root}"; gravity points along ({down}) in the frame of "{base}"',
    ]
    short = [f"{angle:g} at {joint.name}" for joint in chain for angle in joint.rpy if _is_cut_off(angle)]
    if beside := [joint.name for joint in tree.below(base) if joint.name in others and joint.mimics in moving]:
        notes.append(f"joints that mimic those of the chain, but stay at 0 with their masses: {', '.join(beside)}")
    if short:
        notes.append(f"right angles or π with too few digits are used as written: {', '.join(short)}")
    return notes


def _is_cut_off(angle: float) -> bool:
    """Return True for an angle of three digits that is nearly a multiple of π/2 other than 0 [rad]."""
    off = abs(math.remainder(angle, math.pi / 2))
    return 0.0 < off < CUT_OFF < abs(angle) - off and round(angle, 3) == angle


def _as_joint(joint: UrdfJoint, axis: Axis | Vector, notes: list[str]) -> Joint:
    """Return the joint about an axis; the part of its range beyond ±2π is left out."""
    actuator = None
    if joint.effort:
        actuator = Actuator(joint.name, 0.0, peak_torque=abs(joint.effort), speed=joint.speed or None)
    if joint.kind == "continuous":
        return Joint("revolute", axis, -MAX_ANGLE, MAX_ANGLE, actuator)
    lower, upper = joint.lower or 0.0, joint.upper or 0.0
    if joint.kind == "prismatic":
        return Joint("prismatic", axis, lower, upper, actuator)
    if max(-lower, upper) > MAX_ANGLE:
        if max(-lower, upper) > MAX_ANGLE + 1e-2:
            notes.append(f"{joint.name} rotates from {lower:.4g} to {upper:.4g} rad; ±2π of it is used")
        lower, upper = max(lower, -MAX_ANGLE), min(upper, MAX_ANGLE)
    return Joint("revolute", axis, lower, upper, actuator)


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _tensor(rows: Array) -> Tensor:
    x, y, z = map(_vector, rows)
    return x, y, z


class _LinkTree:
    """The links of a URDF as a tree."""

    def __init__(self, document: UrdfDocument, where: str) -> None:
        self.document, self.where = document, where
        self.joints: dict[str, list[UrdfJoint]] = {name: [] for name in document.links}  # on each link, in its order
        self._parent: dict[str, UrdfJoint] = {}
        for joint in document.joints:
            if joint.child in self._parent:
                raise ArmError(f'{where}: the link "{joint.child}" has two parents; expected a tree')
            self._parent[joint.child] = joint
            self.joints[joint.parent].append(joint)
        roots = [name for name in document.links if name not in self._parent]
        if len(roots) != 1:
            names = listed(roots) or "none: the joints form a cycle"
            raise ArmError(f"{where}: expected one root link, found {len(roots)} ({names})")
        self.root = roots[0]
        if len(list(self.below(self.root))) < len(document.joints):
            raise ArmError(f"{where}: some joints form a cycle; expected a tree")

    def below(self, link: str) -> Iterator[UrdfJoint]:
        """Yield all joints beyond a link, parents first."""
        waiting = [link]
        while waiting:
            joints = self.joints[waiting.pop()]
            yield from joints
            waiting += [joint.child for joint in joints]

    def check_link(self, link: str, kind: str) -> str:
        """Return the name of a link; raise ArmError if there is none."""
        if link not in self.document.links:
            names = ", ".join(list(self.document.links)[:40])
            raise ArmError(
                f'{self.where} has no link "{link}" ({kind}).{did_you_mean(link, self.document.links)} Links: {names}'
            )
        return link

    def chain(self, base: str, tip: str) -> list[UrdfJoint]:
        """Return the joints from a link to one beyond it."""
        chain: list[UrdfJoint] = []
        link = tip
        while link != base:
            if link not in self._parent:
                raise ArmError(f'{self.where}: the link "{tip}" is not beyond "{base}"')
            chain.append(self._parent[link])
            link = self._parent[link].parent
        return chain[::-1]

    def orientation(self, link: str) -> Array:
        """Return the rotation (3, 3) of a link in the world, which is the root's frame, with all joints at 0."""
        rotation = np.eye(3)
        for joint in self.chain(self.root, link):
            rotation = rotation @ joint.origin.rotation
        return rotation

    def poses(self, base: str) -> dict[str, Pose]:
        """Return the pose of every link beyond the base, whose origin is that of the world, with all joints at 0."""
        poses = {base: Pose(self.orientation(base), np.zeros(3))}
        for joint in self.below(base):
            poses[joint.child] = poses[joint.parent] @ joint.origin
        return poses

    def bodies(self, base: str, moved: Sequence[str]) -> list[list[str]]:
        """Return the links of each rigid body: that of the base, then that of each link in `moved`."""
        body = {base: 0}
        starts = {link: number for number, link in enumerate(moved, start=1)}
        for joint in self.below(base):
            body[joint.child] = starts.get(joint.child, body[joint.parent])
        return [[link for link, number in body.items() if number == n] for n in range(len(moved) + 1)]
