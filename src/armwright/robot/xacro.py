"""An arm as xacro: its URDF with lengths, radii, masses and base to be chosen when it is processed."""

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Comment, Element, SubElement

from armwright.robot.arm import Arm, Column, Link, Vector
from armwright.robot.link_geometry import (
    MARKER_SCALE,
    TENSOR_INDICES,
    Segment,
    number,
    numbers,
    rpy_along,
    segments,
    tip_rpy,
    to_xml,
)
from armwright.robot.urdf_writer import add_column, add_header, add_joint, add_marker, add_motor, add_solid, add_tool

NAMESPACE = "http://www.ros.org/wiki/xacro"
NOTE = """ xacro arm.xacro link_1_length:=0.25 prefix:=left_
  prefix                 before the names of all links and joints but world
  base_x, base_y, base_z the first joint's place in the world [m]{column}
  tool_x, tool_y, tool_z from the end of the last link to the tip [m]
  link_N_length          from joint N to the next, or to the tool [m]
  link_N_radius          [m]
  link_N_mass            what weighs the same whatever the length [kg]
  link_N_mass_per_metre  what is added for each metre of length [kg/m]
  link_N_end_mass        a point at its end, such as the next joint's actuator [kg] """
COLUMN_NOTE = "\n  column_foot            height of the foot of the column, which ends at the base [m]"


def to_xacro(arm: Arm, name: str = "arm", mass_per_metre: float | Sequence[float] = 0.0) -> str:
    """Return the URDF of an arm as xacro, with its numbers as arguments whose defaults give this arm.

    A link that is made longer keeps its direction, and its centre of mass the same fraction of its length; its inertia
    is that of the longer cylinder. The arguments are listed in the file.

    Args:
        arm: The arm.
        name: The name of the robot.
        mass_per_metre: The mass that a link gains per metre of length [kg/m], one number for all links or one for each.
            The rest of its mass is constant. A link without length has a constant mass.
    """
    robot = Element("robot", {"xmlns:xacro": NAMESPACE, "name": _literal(name)})
    robot.append(Comment(NOTE.format(column="" if arm.column is None else COLUMN_NOTE)))
    _add_arguments(robot, arm, mass_per_metre)
    _add_macro(robot)
    add_header(robot)
    SubElement(robot, "link", name=_prefixed("base"))
    add_joint(robot, _prefixed("world_to_base"), "world", _prefixed("base"), "${base_x} ${base_y} ${base_z}")
    if arm.column is not None:
        _add_column(robot, arm.column)
    position, terms = "0 0 0", ["0", "0", "0"]
    for segment in segments(arm):
        if segment.joint.body is not None:
            motor, carrier = _prefixed(segment.motor_name), _prefixed(segment.parent)
            add_motor(robot, segment, segment.joint.body, motor)
            add_joint(robot, f"{motor}_joint", carrier, motor, position)
        _add_link(robot, segment)
        name, parent, child = map(_prefixed, (f"joint_{segment.number}", segment.parent, segment.name))
        add_joint(robot, name, parent, child, position, joint=segment.joint)
        terms = _scaled(_direction(segment.link), segment.number)
        position = _evaluated(terms)
    SubElement(robot, "link", name=_prefixed("tip"))
    end = position
    position = " ".join(f"${{{term} + tool_{axis}}}" for axis, term in zip("xyz", terms, strict=True))
    last = _prefixed(f"link_{len(arm.links)}")
    add_joint(robot, _prefixed("tip_joint"), last, _prefixed("tip"), position, numbers(tip_rpy(arm)))
    if arm.tool.mass > 0.0:
        add_tool(robot, arm, _prefixed("tool"))
        add_joint(robot, _prefixed("tool_joint"), last, _prefixed("tool"), end)
    return to_xml(robot)


def _literal(text: str) -> str:
    """Return text that xacro does not evaluate: each dollar becomes an expression of its own."""
    return text.replace("$", "${'$'}")


def _prefixed(name: str) -> str:
    return f"$(arg prefix){name}"


def _evaluated(terms: Sequence[str]) -> str:
    """Return the three terms as expressions; a plain 0 needs none."""
    return " ".join(f"${{{term}}}" if term != "0" else term for term in terms)


def _add_arguments(robot: Element, arm: Arm, mass_per_metre: float | Sequence[float]) -> None:
    SubElement(robot, "xacro:arg", name="prefix", default="")
    values = {f"base_{axis}": value for axis, value in zip("xyz", arm.base, strict=True)}
    values |= {f"tool_{axis}": value for axis, value in zip("xyz", arm.tool.tip, strict=True)}
    gains = [mass_per_metre] * len(arm.links) if isinstance(mass_per_metre, (int, float)) else mass_per_metre
    for n, (link, gain) in enumerate(zip(arm.links, gains, strict=True), start=1):
        growing = gain * link.length
        # If all of the mass is proportional to the length, do not leave a rounding error as a constant part.
        rest = 0.0 if math.isclose(growing, link.mass, rel_tol=1e-12) else link.mass - growing
        values |= {
            f"link_{n}_length": link.length,
            f"link_{n}_radius": link.radius,
            f"link_{n}_mass": rest,
            f"link_{n}_mass_per_metre": gain if link.length > 0.0 else 0.0,
            f"link_{n}_end_mass": link.end_mass,
        }
    if arm.column is not None:
        values["column_foot"] = arm.base[2] - arm.column.length
    for name, value in values.items():
        SubElement(robot, "xacro:arg", name=name, default=repr(float(value)))
        SubElement(robot, "xacro:property", name=name, value=f"$(arg {name})")


# The solid cylinder, m r² / 2 around its axis u and half of that + m l² / 12 across it, and the mass at its end, about
# their common centre of mass: two masses m and e at a distance d add m e / (m + e) (|d|² 1 - d dᵀ).
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


def _add_macro(robot: Element) -> None:
    """Add the macro for the `inertial` of a link, from its unit direction, com [m] and end_shift [m]."""
    params = "length radius mass end_mass end_shift direction com"
    macro = SubElement(robot, "xacro:macro", name="armwright_inertial", params=params)
    for name, expression in _PROPERTIES.items():
        SubElement(macro, "xacro:property", name=name, value=f"${{{expression}}}")
    inertial = SubElement(macro, "inertial")
    centre = " ".join(f"${{com[{i}] + share * d[{i}]}}" for i in range(3))
    SubElement(inertial, "origin", xyz=centre, rpy="0 0 0")
    SubElement(inertial, "mass", value="${total}")
    SubElement(inertial, "inertia", {name: _moment(*place) for name, place in TENSOR_INDICES.items()})


def _direction(link: Link) -> Vector:
    """Return the unit vector along a link; z if it has no length."""
    if link.length == 0.0:
        return (0.0, 0.0, 1.0)
    x, y, z = link.offset
    return (x / link.length, y / link.length, z / link.length)


def _scaled(vector: Vector, n: int) -> list[str]:
    """Return the terms of a vector times the length of link n."""
    length = f"link_{n}_length"
    plain = {0.0: "0", 1.0: length, -1.0: f"-{length}"}
    return [plain.get(value, f"{value!r} * {length}") for value in vector]


def _com(link: Link, n: int) -> list[str]:
    """Return the terms of the centre of mass: a fraction of the length, if there is one."""
    x, y, z = link.com
    if link.length == 0.0:
        return [repr(x), repr(y), repr(z)]
    return _scaled((x / link.length, y / link.length, z / link.length), n)


def _add_column(robot: Element, column: Column) -> None:
    """Add the column, if the base is above its foot."""
    drawn, length = SubElement(robot, "xacro:if", value="${base_z > column_foot}"), "base_z - column_foot"
    dimensions = {"radius": number(column.radius), "length": f"${{{length}}}"}
    add_column(drawn, _prefixed("column"), f"0 0 ${{({length}) / -2}}", dimensions)
    add_joint(drawn, _prefixed("column_joint"), _prefixed("base"), _prefixed("column"), "0 0 0")


def _add_link(robot: Element, segment: Segment) -> None:
    link, n = segment.link, segment.number
    element = SubElement(robot, "link", name=_prefixed(segment.name))
    own = f"{segment.name}_"
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
    SubElement(element, "xacro:armwright_inertial", inertial)
    drawn = SubElement(element, "xacro:if", value=f"${{{length} > 0}}")
    x, y, z = direction
    midpoint = _evaluated(_scaled((x / 2, y / 2, z / 2), n))
    cylinder = {"radius": f"${{{own}radius}}", "length": f"${{{length}}}"}
    add_solid(drawn, "link", midpoint, numbers(rpy_along(direction)), "cylinder", cylinder)
    add_marker(element, segment, f"${{{MARKER_SCALE} * {own}radius}}")
