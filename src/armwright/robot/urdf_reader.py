"""An arm that exists already, from its URDF: the serial chain from its base to its tip as an `Arm`.

What is fixed to a link of the chain weighs with it, and so do fingers, which stay where they are at 0. An `Arm` wants
frames that are parallel to the world's when its joints are at 0, and axes along x, y or z. Where the file's own zero is
not such a posture, another one is found: a joint at a right angle to the one before it comes to lie along an axis of
the world when that one is turned.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError, did_you_mean
from armwright.robot.arm import AXES, Actuator, Arm, Joint, Link, Vector
from armwright.robot.urdf_xml import Document, Pose, UrdfJoint, read_document, rotation

SNAP = 1e-3  # [rad]; an axis that is off by less is taken to lie along x, y or z
LARGEST_ANGLE = 2 * math.pi  # [rad]
RADIUS = 0.04  # [m], where the file has no cylinder to take it from; for drawings
FINGERS = 2  # joints in a row, the most that a branch may have to be one of several fingers
GRIPPER = re.compile("grip|jaw|finger", re.IGNORECASE)  # names of a last joint that is no joint of the arm


@dataclass(frozen=True, slots=True)
class UrdfArm:
    """An arm read from a URDF, with its base link at the world's origin.

    tip: the link whose origin is the tip.
    joints: the names of the arm's joints, from base to tip.
    signs, zeros: joint j of the arm at q stands in the URDF at signs[j] * q + zeros[j].
    notes: what was chosen, changed or missing, for its reader.
    """

    name: str
    arm: Arm
    base_link: str
    tip: str
    joints: tuple[str, ...]
    signs: tuple[float, ...]
    zeros: tuple[float, ...]
    notes: tuple[str, ...] = ()

    def values_in_urdf(self, q: Sequence[float] | Array) -> Array:
        """(..., J) the values of the URDF's joints [rad] or [m], of the arm's (..., J)."""
        return np.asarray(q) * self.signs + self.zeros


def read_urdf(path: str | Path, tip: str | None = None, base_link: str | None = None) -> UrdfArm:
    """The serial arm of a URDF file.

    tip: the link whose origin is to reach the targets; without it, the last one before fingers, or of all.
    base_link: what stands on the ground; without it, the robot's root.
    ArmError, in one line, for what is no URDF, or no serial arm that the kernels can compute.
    """
    document = read_document(Path(path))
    tree = _Tree(document, str(path))
    base = tree.root if base_link is None else tree.checked(base_link, "base link")
    last = tree.usual_tip(base) if tip is None else tree.checked(tip, "tip")
    chain = tree.chain(base, last)
    moving = [joint for joint in chain if joint.kind != "fixed"]
    if not moving:
        raise ArmError(f'{path}: between the links "{base}" and "{last}" no joint moves')
    for joint in moving:
        _check_joint(joint, str(path))
    zeros = _zeros(chain, str(path))
    return _arm(tree, base, last, moving, zeros, _chosen(tree, base, tip, last, moving))


def _arm(
    tree: "_Tree", base: str, tip: str, moving: Sequence[UrdfJoint], zeros: Mapping[str, float], notes: list[str]
) -> UrdfArm:
    poses = tree.poses(base, zeros)
    bodies = tree.bodies(base, [joint.child for joint in moving])  # names of links, by the body that they are of
    places = [poses[joint.child].place for joint in moving] + [poses[tip].place]
    joints: list[Joint] = []
    links: list[Link] = []
    signs: list[float] = []
    snapped = 0.0
    for i, joint in enumerate(moving):
        axis, sign, off = _nearest_axis(poses[joint.child].turn @ joint.axis)
        signs.append(sign)
        snapped = max(snapped, off)
        joints.append(_as_joint(joint, axis, sign, zeros[joint.name], notes))
        own = [tree.document.links[name] for name in bodies[i + 1]]
        mass = sum(link.mass for link in own)
        moments = sum((link.mass * (poses[link.name] @ Pose(np.eye(3), link.com)).place for link in own), np.zeros(3))
        com = moments / mass - places[i] if mass > 0.0 else np.zeros(3)
        radius = max((link.radius for link in own if link.radius is not None), default=RADIUS)
        links.append(Link(_vector(places[i + 1] - places[i]), mass, _vector(com), radius))
    if snapped > 1e-9:
        notes.append(f"axes are taken to lie along x, y or z; they are off by up to {snapped:.1g} rad")
    shifted = [f"{name} by {value:.4g} rad" for name, value in zeros.items() if value]
    if shifted:
        notes.append(f"zero is moved, so that all axes lie along x, y or z: {', '.join(shifted)}")
    if not any(link.mass for link in links):
        notes.append("no link states a mass; torques are those of the payload alone")
    if any(joint.actuator is None for joint in joints):
        notes.append("not every joint states an effort, so how much of it is used is not known")
    turn = poses[tip].turn
    arm = Arm(
        base=_vector(places[0]),
        joints=tuple(joints),
        links=tuple(links),
        tool_axis=_vector(turn[:, 2]),
        tool_side=_vector(turn[:, 0]),
        base_mass=sum(tree.document.links[name].mass for name in bodies[0]),
    )
    names = tuple(joint.name for joint in moving)
    values = tuple(zeros[name] for name in names)
    return UrdfArm(tree.document.name, arm, base, tip, names, tuple(signs), values, tuple(notes))


def _check_joint(joint: UrdfJoint, where: str) -> None:
    """ArmError for what no joint of a serial arm is."""
    of = f'{where}: joint "{joint.name}"'
    if joint.kind in ("floating", "planar"):
        raise ArmError(f"{of} is {joint.kind}; between base and tip only turning and sliding joints can be computed")
    if joint.follows is not None:
        raise ArmError(f'{of} repeats "{joint.follows}"; between base and tip each joint must move of its own')
    if joint.kind != "continuous" and not (joint.lower or 0.0) < (joint.upper or 0.0):
        raise ArmError(
            f"{of} has the limits {joint.lower or 0.0:g} and {joint.upper or 0.0:g}; lower < upper is needed"
        )


def _chosen(tree: "_Tree", base: str, tip: str | None, last: str, moving: Sequence[UrdfJoint]) -> list[str]:
    """What is said of the choice of a chain."""
    notes = [] if tip is not None else [f'the tip is the link "{last}" (--tip names another)']
    others = sum(joint.kind != "fixed" for joint in tree.below(base)) - len(moving)
    if others:
        notes.append(f"{others} {'other joint stays' if others == 1 else 'other joints stay'} at 0, such as fingers")
    return notes


def _as_joint(joint: UrdfJoint, axis: int, sign: float, zero: float, notes: list[str]) -> Joint:
    """The joint about the positive axis, counted from its zero."""
    actuator = None
    if joint.effort:
        actuator = Actuator(joint.name, 0.0, abs(joint.effort), joint.speed or None)
    if joint.kind == "continuous":
        return Joint("revolute", AXES[axis], -LARGEST_ANGLE, LARGEST_ANGLE, actuator)
    lower, upper = (joint.lower or 0.0) - zero, (joint.upper or 0.0) - zero
    if sign < 0.0:
        lower, upper = -upper, -lower
    if joint.kind == "prismatic":
        return Joint("prismatic", AXES[axis], lower, upper, actuator)
    if max(-lower, upper) > LARGEST_ANGLE:
        if max(-lower, upper) > LARGEST_ANGLE + 1e-2:
            notes.append(f"{joint.name} turns from {lower:.4g} to {upper:.4g} rad; ±2π of it is used")
        lower, upper = max(lower, -LARGEST_ANGLE), min(upper, LARGEST_ANGLE)
    return Joint("revolute", AXES[axis], lower, upper, actuator)


def _zeros(chain: Sequence[UrdfJoint], where: str) -> dict[str, float]:
    """A posture [rad] in which every joint lies along an axis of the world: 0, but for the joints that must be turned.

    ArmError where there is none.
    """
    moving = [joint for joint in chain if joint.kind != "fixed"]
    zeros = {joint.name: 0.0 for joint in moving}
    before: UrdfJoint | None = None  # the last one that turns
    for joint in moving:
        axis = _axes(chain, zeros)[joint.name]
        if _nearest_axis(axis)[2] > SNAP and before is not None:
            about = _along_world(_axes(chain, zeros)[before.name])
            if abs(float(axis @ about)) < SNAP:
                one = np.roll(np.abs(about), 1)
                angle = math.atan2(float(axis @ np.cross(about, one)), float(axis @ one))
                zeros[before.name] += round(angle / (math.pi / 2)) * (math.pi / 2) - angle
        if joint.kind != "prismatic":
            before = joint
    for name, axis in _axes(chain, zeros).items():
        if _nearest_axis(axis)[2] > SNAP:
            words = ", ".join(f"{value:.3f}" for value in axis)
            raise ArmError(
                f'{where}: joint "{name}" has the axis ({words}) with all joints at 0, along none of x, y and z and '
                "not at a right angle to the joint before; such an arm cannot be computed yet"
            )
    return zeros


def _axes(chain: Sequence[UrdfJoint], zeros: Mapping[str, float]) -> dict[str, Array]:
    """The axes (3,) of the moving joints in the world, by name."""
    axes: dict[str, Array] = {}
    turn = np.eye(3)
    for joint in chain:
        turn = turn @ joint.place.turn
        if joint.kind != "fixed":
            axes[joint.name] = turn @ joint.axis
            turn = turn @ rotation(joint.axis, 0.0 if joint.kind == "prismatic" else zeros[joint.name])
    return axes


def _nearest_axis(direction: Array) -> tuple[int, float, float]:
    """The world's axis nearest to a direction (3,) of unit length, whether it points along it or not, how far off."""
    axis = int(np.abs(direction).argmax())
    sign = math.copysign(1.0, direction[axis])
    across = float(np.linalg.norm(np.delete(direction, axis)))
    return axis, sign, math.atan2(across, abs(float(direction[axis])))


def _along_world(direction: Array) -> Array:
    axis, sign, _ = _nearest_axis(direction)
    return sign * np.eye(3)[axis]


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


class _Tree:
    """A document's links as a tree."""

    def __init__(self, document: Document, where: str) -> None:
        self.document, self._where = document, where
        self._children: dict[str, list[UrdfJoint]] = {name: [] for name in document.links}
        self._parent: dict[str, UrdfJoint] = {}
        for joint in document.joints:
            if joint.child in self._parent:
                raise ArmError(f'{where}: the link "{joint.child}" has two parents; a tree is needed')
            self._parent[joint.child] = joint
            self._children[joint.parent].append(joint)
        roots = [name for name in document.links if name not in self._parent]
        if len(roots) != 1:
            said = ", ".join(roots[:5]) or "none, as the joints go in a circle"
            raise ArmError(f"{where}: one link without a parent is needed, the root; there are {len(roots)} ({said})")
        self.root = roots[0]
        if len(list(self.below(self.root))) < len(document.joints):
            raise ArmError(f"{where}: some joints go in a circle; a tree is needed")
        self._deepest: dict[str, int] = {}  # the most joints in a row that move, below each link
        self._longest: dict[str, int] = {}  # the most links in a row below each link
        for joint in reversed(list(self.below(self.root))):
            self._deepest[joint.parent] = max(self._deepest.get(joint.parent, 0), self._moving(joint))
            self._longest[joint.parent] = max(self._longest.get(joint.parent, 0), 1 + self._longest.get(joint.child, 0))

    def _moving(self, joint: UrdfJoint) -> int:
        """The most joints in a row that move, from this one on."""
        return joint.moves + self._deepest.get(joint.child, 0)

    def below(self, link: str) -> Iterator[UrdfJoint]:
        """All joints beyond a link, each after those that it hangs on."""
        waiting = [link]
        while waiting:
            joints = self._children[waiting.pop()]
            yield from joints
            waiting += [joint.child for joint in joints]

    def checked(self, link: str, kind: str) -> str:
        """The name, if it is a link's."""
        if link not in self.document.links:
            names = ", ".join(list(self.document.links)[:40])
            raise ArmError(
                f'{self._where} has no link "{link}" for its {kind}.{did_you_mean(link, self.document.links)} '
                f"Links: {names}"
            )
        return link

    def chain(self, base: str, tip: str) -> list[UrdfJoint]:
        """The joints from a link to one beyond it."""
        chain: list[UrdfJoint] = []
        link = tip
        while link != base:
            if link not in self._parent:
                raise ArmError(f'{self._where}: the link "{tip}" is not beyond "{base}"')
            chain.append(self._parent[link])
            link = self._parent[link].parent
        return chain[::-1]

    def usual_tip(self, base: str) -> str:
        """The end of the arm's one chain: where it opens into fingers, or where no joint moves any more.

        From there on along what is fixed, as far as it goes.
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
        """Whether a last joint is called as those of grippers are."""
        return self._moving(joint) == 1 and GRIPPER.search(f"{joint.name} {joint.child}") is not None

    def poses(self, base: str, values: Mapping[str, float]) -> dict[str, Pose]:
        """Of every link from the base on, in the base's frame; joints without a value [rad] stand at 0."""
        poses = {base: Pose(np.eye(3), np.zeros(3))}
        for joint in self.below(base):
            turned = Pose(rotation(joint.axis, values.get(joint.name, 0.0)), np.zeros(3))
            poses[joint.child] = poses[joint.parent] @ joint.place @ turned
        return poses

    def bodies(self, base: str, moved: Sequence[str]) -> list[list[str]]:
        """The links that move as one: those of the base, then those of each link in `moved` up to the next."""
        body = {base: 0}
        starts = {link: number for number, link in enumerate(moved, start=1)}
        for joint in self.below(base):
            body[joint.child] = starts.get(joint.child, body[joint.parent])
        return [[link for link, number in body.items() if number == n] for n in range(len(moved) + 1)]
