"""An arm as SDFormat, which Gazebo and Drake load."""

import re
from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement

from armwright.exceptions import ArmError
from armwright.robot.arm import Arm, Column, Joint, Link
from armwright.robot.link_geometry import (
    AXIS_VECTORS,
    COLOURS,
    MIN_INERTIA,
    Segment,
    body_dimensions,
    body_rpy,
    column_dimensions,
    inertia_moments,
    inertia_rpy,
    joint_limits,
    marker_radius,
    midpoint,
    number,
    numbers,
    rpy_along,
    segments,
    tip_position,
    tip_rpy,
    to_xml,
    tool_moments,
)
from armwright.robot.motor_body import MotorBody

VERSION = "1.9"  # read by Gazebo Fortress and later
MIN_MASS, MIN_MOMENT = float(MIN_INERTIA["boundmass"]), float(MIN_INERTIA["boundinertia"])  # [kg], [kg m²]
MASSLESS = Link((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 1.0)


def to_sdf(arm: Arm, name: str = "arm") -> str:
    """Return the SDFormat model of an arm: a link `base`, fixed to `world`; joint_1, link_1, …; and a frame `tip`.

    Names, frames, masses, inertias, limits and colours are those of `to_urdf`: link frames are at their joints, and
    with all joints at 0 they are parallel to the world frame. SDFormat has no massless link: the base and massless
    links get 1e-12 kg.

    A model does not state gravity. To reproduce our torques, the world needs `<gravity>0 0 -9.81</gravity>`; the
    default of Gazebo is 9.8.

    Raises:
        ArmError: If SDFormat does not allow the name.
    """
    if not name.strip() or "::" in name or re.fullmatch(r"world|__.*__", name, re.DOTALL):
        raise ArmError(f'name = "{name}": SDFormat allows no empty name, no "::", and reserves world and __name__')
    sdf = Element("sdf", version=VERSION)
    model = SubElement(sdf, "model", name=name)
    base = SubElement(model, "link", name="base")
    SubElement(base, "pose").text = f"{numbers(arm.base)} 0 0 0"
    _add_inertial(base, MASSLESS)
    _add_joint(model, "world_to_base", "fixed", "world", "base")
    if arm.column is not None:
        _add_column(model, arm.column)
    for segment in segments(arm):
        if segment.joint.body is not None:
            _add_motor(model, segment, segment.joint.body)
        element = SubElement(model, "link", name=segment.name)
        SubElement(element, "pose", relative_to=segment.parent).text = f"{numbers(segment.position)} 0 0 0"
        _add_link(element, segment)
        joint = _add_joint(model, f"joint_{segment.number}", segment.joint.kind, segment.parent, segment.name)
        if segment.joint.kind != "fixed":
            _add_axis(joint, segment.joint, segment.name)
    tip = SubElement(model, "frame", name="tip", attached_to=f"link_{len(arm.links)}")
    SubElement(tip, "pose").text = f"{numbers(tip_position(arm))} {numbers(tip_rpy(arm))}"
    if arm.tool.mass > 0.0:
        _add_tool(model, arm)
    return to_xml(sdf)


def _add_joint(model: Element, name: str, kind: str, parent: str, child: str) -> Element:
    element = SubElement(model, "joint", name=name, type=kind)
    SubElement(element, "parent").text = parent
    SubElement(element, "child").text = child
    return element


def _add_axis(element: Element, joint: Joint, frame: str) -> None:
    axis = SubElement(element, "axis")
    SubElement(axis, "xyz", expressed_in=frame).text = AXIS_VECTORS[joint.axis]
    limit = SubElement(axis, "limit")
    for key, value in joint_limits(joint).items():
        SubElement(limit, key).text = number(value)


def _add_inertial(element: Element, link: Link) -> None:
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "mass").text = number(max(link.total_mass, MIN_MASS))
    SubElement(inertial, "pose").text = f"{numbers(link.total_com)} {numbers(inertia_rpy(link))}"
    # The smallest moment of a cylinder is at least m r² / 4, and a mass at its end only adds to it.
    added = MIN_MOMENT if link.mass * link.radius**2 / 4.0 < MIN_MOMENT else 0.0
    _add_moments(inertial, inertia_moments(link), added)


def _add_moments(inertial: Element, moments: Mapping[str, str], added: float) -> None:
    """Add the inertia, with `added` on its diagonal [kg m²]."""
    inertia = SubElement(inertial, "inertia")
    for key, value in moments.items():
        text = f"{float(value) + added:.17g}" if key in ("ixx", "iyy", "izz") else value
        SubElement(inertia, key).text = text


def _add_tool(model: Element, arm: Arm) -> None:
    last, tool = f"link_{len(arm.links)}", arm.tool
    element = SubElement(model, "link", name="tool")
    SubElement(element, "pose", relative_to=last).text = f"{numbers(arm.links[-1].offset)} 0 0 0"
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "mass").text = number(max(tool.mass, MIN_MASS))
    SubElement(inertial, "pose").text = f"{numbers(tool.com)} 0 0 0"
    _add_moments(inertial, tool_moments(arm), MIN_MOMENT)
    _add_joint(model, "tool_joint", "fixed", last, "tool")


def _add_link(element: Element, segment: Segment) -> None:
    link = segment.link
    _add_inertial(element, link)
    if link.length > 0.0:
        pose = f"{numbers(midpoint(link))} {numbers(rpy_along(link.offset))}"
        cylinder = {"radius": number(link.radius), "length": number(link.length)}
        _add_solid(element, segment.name, "link", pose, "cylinder", cylinder)
    marker = SubElement(element, "visual", name=f"joint_{segment.number}_visual")
    sphere = SubElement(SubElement(marker, "geometry"), "sphere")
    SubElement(sphere, "radius").text = number(marker_radius(link))
    _add_material(marker, f"joint_{segment.joint.axis}")


def _add_motor(model: Element, segment: Segment, body: MotorBody) -> None:
    """Add the link of an actuator's body; its mass is a part of the link that carries it."""
    name = segment.motor_name
    element = SubElement(model, "link", name=name)
    SubElement(element, "pose", relative_to=segment.parent).text = f"{numbers(segment.position)} 0 0 0"
    _add_inertial(element, MASSLESS)
    pose = f"{numbers(body.centre)} {numbers(body_rpy(body))}"
    _add_solid(element, name, f"joint_{segment.joint.axis}", pose, body.shape, body_dimensions(body))
    _add_joint(model, f"{name}_joint", "fixed", segment.parent, name)


def _add_column(model: Element, column: Column) -> None:
    """Add the link of the column below the base; like all that stands with the base, it has no mass here."""
    element = SubElement(model, "link", name="column")
    SubElement(element, "pose", relative_to="base").text = "0 0 0 0 0 0"
    _add_inertial(element, MASSLESS)
    pose = f"{numbers(column.middle)} 0 0 0"
    _add_solid(element, "column", "link", pose, "cylinder", column_dimensions(column))
    _add_joint(model, "column_joint", "fixed", "base", "column")


def _add_solid(element: Element, name: str, colour: str, pose: str, shape: str, dimensions: Mapping[str, str]) -> None:
    """Add a box or cylinder, for display and for collisions."""
    for purpose in ("visual", "collision"):
        solid = SubElement(element, purpose, name=f"{name}_{purpose}")
        SubElement(solid, "pose").text = pose
        geometry = SubElement(SubElement(solid, "geometry"), shape)
        for key, value in dimensions.items():
            SubElement(geometry, key).text = value
        if purpose == "visual":
            _add_material(solid, colour)


def _add_material(visual: Element, colour: str) -> None:
    material = SubElement(visual, "material")
    for light in ("ambient", "diffuse"):
        SubElement(material, light).text = COLOURS[colour]
