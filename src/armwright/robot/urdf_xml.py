"""A URDF as its links and joints: read safely, checked, refused in one line.

Meshes, colours and whatever else a URDF may hold are passed over.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError

LARGEST_FILE = 4 * 1024 * 1024  # [bytes]; of 60 robots that are often used the largest has 0.2 MB
DEEPEST = 50  # elements within each other; a URDF needs 6
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a frame stands in another one: its axes as columns (3, 3), and its origin (3,) [m]."""

    turn: Array
    place: Array

    def __matmul__(self, inner: "Pose") -> "Pose":
        return Pose(self.turn @ inner.turn, self.place + self.turn @ inner.place)


@dataclass(frozen=True, slots=True)
class UrdfLink:
    """mass: [kg]. com: its centre in the link's frame, (3,) [m]. radius: of its thickest cylinder, where it has one."""

    name: str
    mass: float
    com: Array
    radius: float | None


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """place: of its child in its parent, where it has not moved. axis: (3,) of unit length, in the child.

    lower, upper, effort, speed: as the file has them [rad, m, N m, N, rad/s, m/s]; None where it has none.
    follows: the joint whose movement it repeats, where it does so.
    """

    name: str
    kind: str
    parent: str
    child: str
    place: Pose
    axis: Array
    lower: float | None
    upper: float | None
    effort: float | None
    speed: float | None
    follows: str | None

    @property
    def moves(self) -> bool:
        """Whether it moves of its own."""
        return self.kind != "fixed" and self.follows is None


@dataclass(frozen=True, slots=True)
class Document:
    """A robot's links by name, and its joints in the file's order."""

    name: str
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]


def read_document(path: Path) -> Document:
    """The links and joints of a URDF file; ArmError where it is none."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ArmError(f"{path} is larger than {LARGEST_FILE // 2**20} MiB; a URDF without its meshes is not")
        data = path.read_bytes()
    except OSError as fault:
        raise ArmError(f"cannot read {path}: {fault.strerror or fault}") from fault
    return parse_document(data, str(path))


def parse_document(data: bytes, where: str) -> Document:
    """The same of a file's bytes; `where` names it in messages."""
    robot = _parsed(data, where)
    if robot.tag != "robot":
        raise ArmError(f"{where} is not a URDF: its root is <{_short(robot.tag)}>, where <robot> is needed")
    links = [_link(element, where) for element in robot.findall("link")]
    joints = tuple(_joint(element, where) for element in robot.findall("joint"))
    for kind, names in (("link", [link.name for link in links]), ("joint", [joint.name for joint in joints])):
        seen: set[str] = set()
        for name in names:
            if name in seen:
                raise ArmError(f'{where}: the {kind} "{_short(name)}" stands there twice')
            seen.add(name)
    if not links:
        raise ArmError(f"{where} has no link")
    known = {link.name: link for link in links}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in known:
                raise ArmError(
                    f'{where}: joint "{_short(joint.name)}" joins the link "{_short(end)}", which is not there'
                )
    return Document(robot.get("name") or Path(where).stem, known, joints)


def _parsed(data: bytes, where: str) -> ElementTree.Element:
    """The XML; without entities, by which a small file fills the memory or reads others."""
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise ArmError(f"{where} has more than {DEEPEST} elements within each other; that is no URDF")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        raise ArmError(f"{where} declares a document type or entities (<!DOCTYPE …>), which a URDF does not need")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as fault:
        raise ArmError(f"{where} is not valid XML: {fault}") from fault
    except (LookupError, ValueError) as fault:
        raise ArmError(f"{where} is not valid XML: its encoding is not known") from fault
    return builder.close()


def _link(element: ElementTree.Element, where: str) -> UrdfLink:
    name = _name(element, "link", where)
    of = f'{where}: link "{_short(name)}"'
    inertial = element.find("inertial")
    mass, com = 0.0, np.zeros(3)
    if inertial is not None:
        mass = _numbers(inertial.find("mass"), "value", 1, of)[0]
        if mass < 0.0:
            raise ArmError(f"{of} has a mass of {mass:g} kg; 0 or more is needed")
        com = _pose(inertial.find("origin"), of).place
    shapes = [_numbers(shape, "radius", 1, of)[0] for shape in element.iter("cylinder")]
    return UrdfLink(name, mass, com, max((radius for radius in shapes if radius > 0.0), default=None))


def _joint(element: ElementTree.Element, where: str) -> UrdfJoint:
    name = _name(element, "joint", where)
    of = f'{where}: joint "{_short(name)}"'
    kind = element.get("type", "")
    if kind not in KINDS:
        raise ArmError(f'{of} is of the type "{_short(kind)}"; there are {", ".join(KINDS)}')
    axis = element.find("axis")
    direction = np.array([1.0, 0.0, 0.0] if axis is None else _numbers(axis, "xyz", 3, of))
    length = float(np.linalg.norm(direction))
    if length < 1e-9 and kind in ("revolute", "continuous", "prismatic"):
        raise ArmError(f"{of} has an axis of no length: {direction.tolist()}")
    limit, mimic = element.find("limit"), element.find("mimic")
    values = [None if limit is None or limit.get(key) is None else _numbers(limit, key, 1, of)[0] for key in _LIMITS]
    ends = [element.find(end) for end in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    return UrdfJoint(
        name,
        kind,
        parent,
        child,
        _pose(element.find("origin"), of),
        direction / (length if length > 0.0 else 1.0),
        *values,
        follows=None if mimic is None else mimic.get("joint", ""),
    )


_LIMITS = ("lower", "upper", "effort", "velocity")


def _name(element: ElementTree.Element, kind: str, where: str) -> str:
    name = element.get("name", "")
    if not name:
        raise ArmError(f"{where}: a {kind} has no name")
    return name


def _pose(element: ElementTree.Element | None, of: str) -> Pose:
    """Of an <origin>; where it is missing, of one that changes nothing."""
    if element is None:
        return Pose(np.eye(3), np.zeros(3))
    place = np.array(_numbers(element, "xyz", 3, of)) if element.get("xyz") is not None else np.zeros(3)
    angles = _numbers(element, "rpy", 3, of) if element.get("rpy") is not None else [0.0, 0.0, 0.0]
    about_x, about_y, about_z = (rotation(axis, angle) for axis, angle in zip(np.eye(3), angles, strict=True))
    return Pose(about_z @ about_y @ about_x, place)


def rotation(axis: Array, angle: float) -> Array:
    """(3, 3) about an axis (3,) of unit length by `angle` [rad]."""
    x, y, z = axis.tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def _numbers(element: ElementTree.Element | None, key: str, n: int, of: str) -> list[float]:
    text = "" if element is None else element.get(key, "")
    if "$" in text:
        raise ArmError(f'{of}: {key} = "{_short(text)}" is xacro, not URDF yet; `xacro FILE > arm.urdf` expands it')
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != n or not all(math.isfinite(value) for value in values):
        raise ArmError(f'{of}: {key} = "{_short(text)}"; {n} finite {"number is" if n == 1 else "numbers are"} needed')
    return values


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
