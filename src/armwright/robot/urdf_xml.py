"""The links and joints of a URDF: read safely, checked, refused with a one-line error.

Meshes, colours and everything else in a URDF are ignored.
"""

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError
from armwright.files import read_bytes
from armwright.robot.link_geometry import TENSOR_INDICES
from armwright.rotations import rotation_from_rpy

MAX_FILE = 4 * 1024 * 1024  # [bytes]; the largest of 60 common robots has 0.2 MB
DEEPEST = 50  # nested elements; a URDF needs 6
EXPAND = "is xacro, not URDF; try `xacro FILE > arm.urdf`"
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


@dataclass(frozen=True, slots=True)
class Pose:
    """The pose of a frame in another one."""

    rotation: Array  # (3, 3), the axes of the frame as columns
    position: Array  # (3,) its origin [m]

    def __matmul__(self, inner: "Pose") -> "Pose":
        return Pose(self.rotation @ inner.rotation, self.position + self.rotation @ inner.position)


@dataclass(frozen=True, slots=True)
class UrdfLink:
    """A link of a URDF."""

    name: str
    mass: float  # [kg]; 0 if not stated
    com: Array  # (3,) its centre of mass in the link frame [m]
    inertia: Array  # (3, 3) about that centre, along the axes of the link frame [kg m²]
    radius: float | None  # of its thickest cylinder [m]; None if it has none
    has_mass: bool  # whether it states a mass


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A joint of a URDF; None for what is missing."""

    name: str
    kind: str
    parent: str  # name of the link before it
    child: str
    origin: Pose  # of the child in the parent at a joint value of 0
    rpy: tuple[float, ...]  # the angles of its rotation as written [rad]
    axis: Array  # (3,) unit vector in the child frame
    lower: float | None  # limit [rad] or [m]
    upper: float | None
    effort: float | None  # largest torque [N m] or force [N]
    speed: float | None  # largest speed [rad/s] or [m/s]
    mimics: str | None = None  # name of the joint that it mimics: its value is multiplier times that joint's + offset
    multiplier: float = 1.0
    offset: float = 0.0  # [rad] or [m]

    @property
    def moves(self) -> bool:
        """True if it moves independently of other joints."""
        return self.kind != "fixed" and self.mimics is None


@dataclass(frozen=True, slots=True)
class UrdfDocument:
    """The links of a robot by name, and its joints in the order of the file."""

    name: str
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]


def read_document(path: Path) -> UrdfDocument:
    """Read the links and joints of a URDF file; raise ArmError if it is not one."""
    where = str(path)
    robot = _parsed(read_bytes(path, MAX_FILE, ArmError), where)
    if robot.tag != "robot":
        raise ArmError(f"{where} is not a URDF: expected the root <robot>, got <{_short(robot.tag)}>")
    links = [_link(element, where) for element in robot.findall("link")]
    joints = tuple(_joint(element, where) for element in robot.findall("joint"))
    for kind, names in (("link", [link.name for link in links]), ("joint", [joint.name for joint in joints])):
        for name, count in Counter(names).items():
            if count > 1:
                raise ArmError(f'{where}: duplicate {kind} "{_short(name)}"')
    if not links:
        raise ArmError(f"{where} has no link")
    known = {link.name: link for link in links}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in known:
                raise ArmError(f'{where}: joint "{_short(joint.name)}" joins the unknown link "{_short(end)}"')
    return UrdfDocument(robot.get("name") or path.stem, known, joints)


def _parsed(data: bytes, where: str) -> ElementTree.Element:
    """Parse XML without entities, with which a small file could fill the memory or read other files."""
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise ArmError(f"{where} has more than {DEEPEST} nested elements; that is not a URDF")
        if tag.startswith("xacro:") and tag != "xacro:property":
            raise ArmError(f"{where}: <{_short(tag)}> {EXPAND}")
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
    mass, com, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    if inertial is not None:
        mass = _numbers(inertial.find("mass"), "value", 1, of)[0]
        if mass < 0.0:
            raise ArmError(f"{of}: expected a mass of 0 kg or more, got {mass:g} kg")
        frame = _pose(inertial.find("origin"), of)
        com, inertia = frame.position, frame.rotation @ _tensor(inertial, of) @ frame.rotation.T
    shapes = [_numbers(shape, "radius", 1, of)[0] for shape in element.iter("cylinder")]
    thickest = max((radius for radius in shapes if radius > 0.0), default=None)
    return UrdfLink(name, mass, com, inertia, thickest, inertial is not None)


def _tensor(inertial: ElementTree.Element, of: str) -> Array:
    """Return the (3, 3) tensor of an <inertial> in its own frame [kg m²]; what it does not state is 0."""
    element, tensor = inertial.find("inertia"), np.zeros((3, 3))
    for key, place in TENSOR_INDICES.items():
        if element is not None and element.get(key) is not None:
            tensor[place] = tensor[place[::-1]] = _numbers(element, key, 1, of)[0]
    return tensor


def _joint(element: ElementTree.Element, where: str) -> UrdfJoint:
    name = _name(element, "joint", where)
    of = f'{where}: joint "{_short(name)}"'
    kind = element.get("type", "")
    if kind not in KINDS:
        raise ArmError(f'{of} has the unknown type "{_short(kind)}"; available: {", ".join(KINDS)}')
    axis = element.find("axis")
    direction = np.array([1.0, 0.0, 0.0] if axis is None else _numbers(axis, "xyz", 3, of))
    length = float(np.linalg.norm(direction))
    if length < 1e-9 and kind in ("revolute", "continuous", "prismatic"):
        raise ArmError(f"{of} has an axis of no length: {direction.tolist()}")
    limit, mimic = element.find("limit"), element.find("mimic")
    values = [_number(limit, key, of) for key in _LIMITS]
    law = {key: _number(mimic, key, of, default) for key, default in (("multiplier", 1.0), ("offset", 0.0))}
    ends = [element.find(end) for end in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    return UrdfJoint(
        name,
        kind,
        parent,
        child,
        _pose(element.find("origin"), of),
        tuple(_angles(element.find("origin"), of)),
        direction / (length if length > 0.0 else 1.0),
        *values,
        mimics=None if mimic is None else mimic.get("joint", ""),
        **law,
    )


_LIMITS = ("lower", "upper", "effort", "velocity")


def _number(element: ElementTree.Element | None, key: str, of: str, missing: Any = None) -> Any:
    return missing if element is None or element.get(key) is None else _numbers(element, key, 1, of)[0]


def _name(element: ElementTree.Element, kind: str, where: str) -> str:
    name = element.get("name", "")
    if not name:
        raise ArmError(f"{where}: a {kind} has no name")
    return name


def _pose(element: ElementTree.Element | None, of: str) -> Pose:
    """Return the pose of an <origin>; the identity if it is missing."""
    if element is None:
        return Pose(np.eye(3), np.zeros(3))
    position = np.array(_numbers(element, "xyz", 3, of)) if element.get("xyz") is not None else np.zeros(3)
    return Pose(rotation_from_rpy(*_angles(element, of)), position)


def _angles(element: ElementTree.Element | None, of: str) -> list[float]:
    """Return roll, pitch and yaw of an <origin> [rad]; 0 if they are missing."""
    return [0.0, 0.0, 0.0] if element is None or element.get("rpy") is None else _numbers(element, "rpy", 3, of)


def _numbers(element: ElementTree.Element | None, key: str, n: int, of: str) -> list[float]:
    text = "" if element is None else element.get(key, "")
    if "$" in text:
        raise ArmError(f'{of}: {key} = "{_short(text)}" {EXPAND}')
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != n or not all(math.isfinite(value) for value in values):
        raise ArmError(f'{of}: {key}: expected {n} finite {"number" if n == 1 else "numbers"}, got "{_short(text)}"')
    return values


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
