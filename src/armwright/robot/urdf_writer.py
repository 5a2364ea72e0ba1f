"""An arm as URDF, which MuJoCo, Pinocchio, ROS and most simulators load."""

from xml.etree.ElementTree import Element, SubElement

from armwright.robot.arm import Arm, Joint
from armwright.robot.link_geometry import (
    AXIS_VECTORS,
    COLOURS,
    MUJOCO_COMPILER,
    TENSOR_INDICES,
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

FIXED = Joint("fixed", "z")


def to_urdf(arm: Arm, name: str = "arm") -> str:
    """Return the URDF of an arm: `world`, a fixed joint to `base`, then joint_1, link_1, …, and a frame `tip`.

    Link frames are at their joints; with all joints at 0 they are parallel to the world frame. The z axis of the tip
    frame is the tool's axis, its x axis the tool's side. Links are solid cylinders of uniform density from joint to
    joint, for inertia, collision and display. A tool with mass is a link `tool` at the end of the last link. The body
    of an actuator is a massless link motor_1, …, fixed to the link before its joint. The column that the base stands on
    is a massless link `column`, fixed to `base`.

    Example:
        >>> import armwright as aw
        >>> space = aw.paper_space(joints=2)
        >>> arm = space.arm(space.sample(1, seed=0)[0])
        >>> print(aw.to_urdf(arm, "two"))
        <?xml version="1.0"?>
        <robot name="two">
        ...
        </robot>
        <BLANKLINE>
    """
    return to_xml(urdf_tree(arm, name))


def urdf_tree(arm: Arm, name: str) -> Element:
    """Return the same as an XML tree."""
    robot = Element("robot", name=name)
    add_header(robot)
    SubElement(robot, "link", name="base")
    add_joint(robot, "world_to_base", "world", "base", numbers(arm.base))
    if arm.column is not None:
        add_column(robot, "column", numbers(arm.column.middle), column_dimensions(arm.column))
        add_joint(robot, "column_joint", "base", "column", "0 0 0")
    for segment in segments(arm):
        if segment.joint.body is not None:
            motor, position = segment.motor_name, numbers(segment.position)
            add_motor(robot, segment, segment.joint.body, motor)
            add_joint(robot, f"{motor}_joint", segment.parent, motor, position)
        _add_link(robot, segment)
        name, position = f"joint_{segment.number}", numbers(segment.position)
        add_joint(robot, name, segment.parent, segment.name, position, joint=segment.joint)
    SubElement(robot, "link", name="tip")
    last = f"link_{len(arm.links)}"
    add_joint(robot, "tip_joint", last, "tip", numbers(tip_position(arm)), numbers(tip_rpy(arm)))
    if arm.tool.mass > 0.0:
        add_tool(robot, arm, "tool")
        add_joint(robot, "tool_joint", last, "tool", numbers(arm.links[-1].offset))
    return robot


def add_header(robot: Element) -> None:
    """Add compiler options, materials and the link `world`.

    By default MuJoCo would merge `base` and `tip` into their neighbours, drop visuals and refuse massless links.
    """
    SubElement(SubElement(robot, "mujoco"), "compiler", MUJOCO_COMPILER)
    for material, rgba in COLOURS.items():
        SubElement(SubElement(robot, "material", name=material), "color", rgba=rgba)
    SubElement(robot, "link", name="world")


def add_joint(
    robot: Element, name: str, parent: str, child: str, xyz: str, rpy: str = "0 0 0", joint: Joint = FIXED
) -> None:
    """Add a joint between two links."""
    element = SubElement(robot, "joint", name=name, type=joint.kind)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    SubElement(element, "origin", xyz=xyz, rpy=rpy)
    if joint.kind != "fixed":
        SubElement(element, "axis", xyz=AXIS_VECTORS[joint.axis])
        SubElement(element, "limit", {key: number(value) for key, value in joint_limits(joint).items()})


def add_tool(robot: Element, arm: Arm, name: str) -> None:
    """Add the link of a tool with mass."""
    inertial = SubElement(SubElement(robot, "link", name=name), "inertial")
    SubElement(inertial, "origin", xyz=numbers(arm.tool.com), rpy="0 0 0")
    SubElement(inertial, "mass", value=number(arm.tool.mass))
    SubElement(inertial, "inertia", tool_moments(arm))


def _add_link(robot: Element, segment: Segment) -> None:
    link = segment.link
    element = SubElement(robot, "link", name=segment.name)
    # Written for a mass of 0, too: otherwise MuJoCo assumes the density of water and scikit-robot 1 g.
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "origin", xyz=numbers(link.total_com), rpy=numbers(inertia_rpy(link)))
    SubElement(inertial, "mass", value=number(link.total_mass))
    SubElement(inertial, "inertia", inertia_moments(link))
    if link.length > 0.0:
        centre, rpy = numbers(midpoint(link)), numbers(rpy_along(link.offset))
        cylinder = {"radius": number(link.radius), "length": number(link.length)}
        add_solid(element, "link", centre, rpy, "cylinder", cylinder)
    add_marker(element, segment, number(marker_radius(link)))


def add_solid(element: Element, material: str, xyz: str, rpy: str, shape: str, dimensions: dict[str, str]) -> None:
    """Add a box or cylinder, for display and for collisions."""
    for purpose in ("visual", "collision"):
        body = SubElement(element, purpose)
        SubElement(body, "origin", xyz=xyz, rpy=rpy)
        SubElement(SubElement(body, "geometry"), shape, dimensions)
        if purpose == "visual":
            SubElement(body, "material", name=material)


def add_motor(robot: Element, segment: Segment, body: MotorBody, name: str) -> None:
    """Add the link of an actuator's body; its mass is a part of the link that carries it."""
    element = _add_massless(robot, name)
    material, rpy = f"joint_{segment.joint.axis}", numbers(body_rpy(body))
    add_solid(element, material, numbers(body.centre), rpy, body.shape, body_dimensions(body))


def add_column(robot: Element, name: str, middle: str, dimensions: dict[str, str]) -> None:
    """Add the link of the column below the base; like all that stands with the base, it has no mass here."""
    add_solid(_add_massless(robot, name), "link", middle, "0 0 0", "cylinder", dimensions)


def _add_massless(robot: Element, name: str) -> Element:
    element = SubElement(robot, "link", name=name)
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "mass", value="0")
    SubElement(inertial, "inertia", dict.fromkeys(TENSOR_INDICES, "0"))
    return element


def add_marker(element: Element, segment: Segment, radius: str) -> None:
    """Add the coloured sphere that shows a joint and its axis."""
    marker = SubElement(element, "visual")
    SubElement(marker, "origin", xyz="0 0 0", rpy="0 0 0")
    SubElement(SubElement(marker, "geometry"), "sphere", radius=radius)
    SubElement(marker, "material", name=f"joint_{segment.joint.axis}")
