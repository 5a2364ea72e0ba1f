"""An arm as xacro: its URDF with lengths, radii, masses and base to be chosen when it is processed."""

import math
from xml.etree import ElementTree

from armwright.arm import Arm, Joint, Link, Vector
from armwright.export.limits import limits_of
from armwright.export.shapes import (
    AXIS_VECTORS,
    BOUNDS,
    COLOURS,
    MARKER,
    along,
    number,
    numbers,
    text_of,
    tip_turn,
)

NAMESPACE = "http://www.ros.org/wiki/xacro"
NOTE = """ xacro arm.xacro link_1_length:=0.25 prefix:=left_
  prefix                 before the names of all links and joints but world
  base_x, base_y, base_z the first joint's place in the world [m]
  tool_x, tool_y, tool_z from the end of the last link to the tip [m]
  link_N_length          from joint N to the next, or to the tool [m]
  link_N_radius          [m]
  link_N_mass            what weighs the same whatever the length [kg]
  link_N_mass_per_metre  what is added for each metre of length [kg/m]
  link_N_end_mass        a point at its end, such as the next joint's actuator [kg] """


def to_xacro(arm: Arm, name: str = "arm", mass_per_metre: float = 0.0) -> str:
    """The URDF of `to_urdf` as xacro, its numbers as arguments; the arguments' defaults give this arm.

    A link that is made longer keeps its direction, and its centre of mass the same share of its length; inertia is
    that of the longer cylinder. The arguments are listed in the file.

    mass_per_metre: by how much a link gets heavier with its length [kg/m]; the rest of its mass stays. A link without
    length has all of its mass whatever its length.
    """
    robot = ElementTree.Element("robot", {"xmlns:xacro": NAMESPACE, "name": _literal(name)})
    robot.append(ElementTree.Comment(NOTE))
    _add_arguments(robot, arm, mass_per_metre)
    _add_macro(robot)
    compiler = ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", discardvisual="false", **BOUNDS)
    for material, rgba in COLOURS.items():
        ElementTree.SubElement(ElementTree.SubElement(robot, "material", name=material), "color", rgba=rgba)
    ElementTree.SubElement(robot, "link", name="world")
    ElementTree.SubElement(robot, "link", name=_own("base"))
    _add_joint(robot, "world_to_base", "fixed", "world", "base", "${base_x} ${base_y} ${base_z}")
    parent, place, terms = "base", "0 0 0", ["0", "0", "0"]
    for n, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        _add_link(robot, n, joint, link)
        element = _add_joint(robot, f"joint_{n}", joint.kind, _own(parent), f"link_{n}", place)
        if joint.kind != "fixed":
            ElementTree.SubElement(element, "axis", xyz=AXIS_VECTORS[joint.axis])
            ElementTree.SubElement(element, "limit", {key: number(value) for key, value in limits_of(joint).items()})
        parent = f"link_{n}"
        terms = _scaled(_direction(link), n)
        place = " ".join(f"${{{term}}}" if term != "0" else term for term in terms)
    ElementTree.SubElement(robot, "link", name=_own("tip"))
    place = " ".join(f"${{{term} + tool_{axis}}}" for axis, term in zip("xyz", terms, strict=True))
    _add_joint(robot, "tip_joint", "fixed", _own(parent), "tip", place, numbers(tip_turn(arm)))
    return text_of(robot)


def _literal(text: str) -> str:
    """Text that xacro is not to evaluate: each dollar is an expression of its own, so that none opens another."""
    return text.replace("$", "${'$'}")


def _own(name: str) -> str:
    return f"$(arg prefix){name}"


def _add_arguments(robot: ElementTree.Element, arm: Arm, mass_per_metre: float) -> None:
    ElementTree.SubElement(robot, "xacro:arg", name="prefix", default="")
    values = {f"base_{axis}": value for axis, value in zip("xyz", arm.base, strict=True)}
    values |= {f"tool_{axis}": value for axis, value in zip("xyz", arm.tool, strict=True)}
    for n, link in enumerate(arm.links, start=1):
        growing = mass_per_metre * link.length
        # A mass that is all in the length is not to leave a rounding beside it.
        rest = 0.0 if math.isclose(growing, link.mass, rel_tol=1e-12) else link.mass - growing
        values |= {
            f"link_{n}_length": link.length,
            f"link_{n}_radius": link.radius,
            f"link_{n}_mass": rest,
            f"link_{n}_mass_per_metre": mass_per_metre if link.length > 0.0 else 0.0,
            f"link_{n}_end_mass": link.end_mass,
        }
    for name, value in values.items():
        ElementTree.SubElement(robot, "xacro:arg", name=name, default=repr(float(value)))
        ElementTree.SubElement(robot, "xacro:property", name=name, value=f"$(arg {name})")


# The solid cylinder, m r² / 2 around its axis u and half of that + m l² / 12 across it, and what sits at its end, about
# their common centre of mass: two masses at a distance d from each other add m e / (m + e) (|d|² 1 - d dᵀ).
_PROPERTIES = {
    "l": "length",
    "u": "direction",
    "around": "mass * radius * radius / 2",
    "across": "around / 2 + mass * l * l / 12",
    "more": "around - across",
    "total": "mass + end_mass",
    "share": "end_mass / total if total > 0 else 0",
    "d": "[l * u[i] + end_shift[i] - com[i] for i in range(3)]",
    "pair": "mass * share",
    "dd": "d[0] * d[0] + d[1] * d[1] + d[2] * d[2]",
}


def _moment(i: int, j: int) -> str:
    straight = "across + pair * dd + " if i == j else ""
    return f"${{{straight}more * u[{i}] * u[{j}] - pair * d[{i}] * d[{j}]}}"


def _add_macro(robot: ElementTree.Element) -> None:
    """`inertial` of a link; direction: of unit length, com: [m]; end_shift: from its end to its end mass [m]."""
    params = "length radius mass end_mass end_shift direction com"
    macro = ElementTree.SubElement(robot, "xacro:macro", name="armwright_inertial", params=params)
    for name, expression in _PROPERTIES.items():
        ElementTree.SubElement(macro, "xacro:property", name=name, value=f"${{{expression}}}")
    inertial = ElementTree.SubElement(macro, "inertial")
    centre = " ".join(f"${{com[{i}] + share * d[{i}]}}" for i in range(3))
    ElementTree.SubElement(inertial, "origin", xyz=centre, rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value="${total}")
    places = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    ElementTree.SubElement(inertial, "inertia", {name: _moment(*place) for name, place in places.items()})


def _direction(link: Link) -> Vector:
    """Of unit length; along z where the link has none."""
    if link.length == 0.0:
        return (0.0, 0.0, 1.0)
    x, y, z = link.offset
    return (x / link.length, y / link.length, z / link.length)


def _scaled(vector: Vector, n: int) -> list[str]:
    """The terms of a vector times the length of link n."""
    length = f"link_{n}_length"
    plain = {0.0: "0", 1.0: length, -1.0: f"-{length}"}
    return [plain.get(value, f"{value!r} * {length}") for value in vector]


def _com(link: Link, n: int) -> list[str]:
    """The terms of the centre of mass: a share of the length, where there is one."""
    x, y, z = link.com
    if link.length == 0.0:
        return [repr(x), repr(y), repr(z)]
    return _scaled((x / link.length, y / link.length, z / link.length), n)


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, xyz: str, rpy: str = "0 0 0"
) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=_own(name), type=kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=_own(child))
    ElementTree.SubElement(element, "origin", xyz=xyz, rpy=rpy)
    return element


def _add_link(robot: ElementTree.Element, n: int, joint: Joint, link: Link) -> None:
    element = ElementTree.SubElement(robot, "link", name=_own(f"link_{n}"))
    own = f"link_{n}_"
    direction, length = _direction(link), f"{own}length"
    inertial = {
        "length": f"${{{length}}}",
        "radius": f"${{{own}radius}}",
        "mass": f"${{{own}mass + {own}mass_per_metre * {length}}}",
        "end_mass": f"${{{own}end_mass}}",
        "end_shift": f"${{[{', '.join(map(repr, link.end_shift))}]}}",
        "direction": f"${{[{', '.join(map(repr, direction))}]}}",
        "com": f"${{[{', '.join(_com(link, n))}]}}",
    }
    ElementTree.SubElement(element, "xacro:armwright_inertial", inertial)
    drawn = ElementTree.SubElement(element, "xacro:if", value=f"${{{length} > 0}}")
    x, y, z = direction
    half = " ".join(f"${{{term}}}" if term != "0" else term for term in _scaled((x / 2, y / 2, z / 2), n))
    for purpose in ("visual", "collision"):
        body = ElementTree.SubElement(drawn, purpose)
        ElementTree.SubElement(body, "origin", xyz=half, rpy=numbers(along(direction)))
        shape = ElementTree.SubElement(body, "geometry")
        ElementTree.SubElement(shape, "cylinder", radius=f"${{{own}radius}}", length=f"${{{length}}}")
        if purpose == "visual":
            ElementTree.SubElement(body, "material", name="link")
    marker = ElementTree.SubElement(element, "visual")
    ElementTree.SubElement(marker, "origin", xyz="0 0 0", rpy="0 0 0")
    shape = ElementTree.SubElement(marker, "geometry")
    ElementTree.SubElement(shape, "sphere", radius=f"${{{MARKER} * {own}radius}}")
    ElementTree.SubElement(marker, "material", name=f"joint_{joint.axis}")
