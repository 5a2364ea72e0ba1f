"""An arm as URDF, which MuJoCo, Pinocchio, ROS and most simulators load."""

from xml.etree.ElementTree import Element, SubElement

from armwright.robot import link_geometry as geometry
from armwright.robot.arm import Arm, Joint, Vector
from armwright.robot.motor_body import MotorBody
from armwright.robot.xml_text import COLOURS, MUJOCO_COMPILER, number, numbers, to_xml

FIXED = Joint("fixed", "z")
ORIGIN = (0.0, 0.0, 0.0)


def to_urdf(arm: Arm, name: str = "arm") -> str:
    """Return the URDF of an arm: `world`, a fixed joint to `base`, then joint_1, link_1, …, and a frame `tip`.

    Link frames are at their joints; with all joints at 0 they are parallel to the world frame. The z axis of the tip
    frame is the tool's axis, its x axis the tool's side. Links are cylinders from joint to joint for collision and
    display; their inertia is that of tubes of uniform density and of what they carry. A tool with mass is a link `tool`
    at the end of the last link. The body of an actuator is a massless link motor_1, …, fixed to the link before its
    joint. The column that the base stands on is a massless link `column`, fixed to `base`.

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
    # By default MuJoCo would merge `base` and `tip` into their neighbours, drop visuals and refuse massless links.
    SubElement(SubElement(robot, "mujoco"), "compiler", MUJOCO_COMPILER)
    for material, rgba in COLOURS.items():
        SubElement(SubElement(robot, "material", name=material), "color", rgba=rgba)
    SubElement(robot, "link", name="world")
    SubElement(robot, "link", name="base")
    _add_joint(robot, "world_to_base", "world", "base", arm.base)
    if arm.column is not None:
        cylinder = {"radius": number(arm.column.radius), "length": number(arm.column.length)}
        column = _add_fixed(robot, "column", "base", ORIGIN)
        _add_solid(column, "link", arm.column.middle, ORIGIN, "cylinder", cylinder)
    for segment in geometry.segments(arm):
        if segment.joint.body is not None:
            _add_motor(robot, segment, segment.joint.body)
        _add_link(robot, segment)
        name = f"joint_{segment.number}"
        _add_joint(robot, name, segment.parent, segment.name, segment.position, joint=segment.joint)
    SubElement(robot, "link", name="tip")
    last = f"link_{len(arm.links)}"
    _add_joint(robot, "tip_joint", last, "tip", geometry.tip_position(arm), geometry.tip_rpy(arm))
    if arm.tool.mass > 0.0:
        tool = SubElement(robot, "link", name="tool")
        _add_inertial(tool, arm.tool.com, ORIGIN, arm.tool.mass, geometry.tool_moments(arm))
        _add_joint(robot, "tool_joint", last, "tool", arm.links[-1].offset)
    return robot


def _add_joint(
    robot: Element, name: str, parent: str, child: str, xyz: Vector, rpy: Vector = ORIGIN, joint: Joint = FIXED
) -> None:
    element = SubElement(robot, "joint", name=name, type=joint.kind)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    _add_origin(element, xyz, rpy)
    if joint.kind != "fixed":
        SubElement(element, "axis", xyz=numbers(joint.direction))
        SubElement(element, "limit", {key: number(value) for key, value in geometry.joint_limits(joint).items()})
    if (coupling := joint.coupling) is not None:
        law = {"multiplier": number(coupling.factor), "offset": number(coupling.offset)}
        SubElement(element, "mimic", {"joint": f"joint_{coupling.leader + 1}", **law})


def _add_origin(element: Element, xyz: Vector, rpy: Vector) -> None:
    SubElement(element, "origin", xyz=numbers(xyz), rpy=numbers(rpy))


def _add_inertial(element: Element, com: Vector, rpy: Vector, mass: float, moments: dict[str, str]) -> None:
    inertial = SubElement(element, "inertial")
    _add_origin(inertial, com, rpy)
    SubElement(inertial, "mass", value=number(mass))
    SubElement(inertial, "inertia", moments)


def _add_link(robot: Element, segment: geometry.Segment) -> None:
    link = segment.link
    element = SubElement(robot, "link", name=segment.name)
    # Also written for a mass of 0; without it, MuJoCo assumes the density of water and scikit-robot 1 g.
    if not link.without_mass:
        moments = geometry.inertia_moments(link)
        _add_inertial(element, link.total_com, geometry.inertia_rpy(link), link.total_mass, moments)
    if link.length > 0.0:
        cylinder = {"radius": number(link.radius), "length": number(link.length)}
        _add_solid(element, "link", geometry.midpoint(link), geometry.rpy_along(link.offset), "cylinder", cylinder)
    marker = SubElement(element, "visual")  # a coloured sphere that shows the joint and its axis
    _add_origin(marker, ORIGIN, ORIGIN)
    SubElement(SubElement(marker, "geometry"), "sphere", radius=number(geometry.marker_radius(link)))
    SubElement(marker, "material", name=f"joint_{segment.joint.nearest_axis}")


def _add_motor(robot: Element, segment: geometry.Segment, body: MotorBody) -> None:
    """Add the link of an actuator's body; its mass is a part of the link that carries it."""
    dimensions = {"radius": number(body.radius), "length": number(body.length)}
    dimensions = {"size": numbers(body.size)} if body.shape == "box" else dimensions
    motor = _add_fixed(robot, segment.motor_name, segment.parent, segment.position)
    material = f"joint_{segment.joint.nearest_axis}"
    _add_solid(motor, material, body.centre, geometry.body_rpy(body), body.shape, dimensions)


def _add_solid(
    element: Element, material: str, xyz: Vector, rpy: Vector, shape: str, dimensions: dict[str, str]
) -> None:
    """Add a box or cylinder, for display and for collisions."""
    for purpose in ("visual", "collision"):
        body = SubElement(element, purpose)
        _add_origin(body, xyz, rpy)
        SubElement(SubElement(body, "geometry"), shape, dimensions)
        if purpose == "visual":
            SubElement(body, "material", name=material)


def _add_fixed(robot: Element, name: str, parent: str, position: Vector) -> Element:
    """Add a massless link that is fixed to another one, and return it."""
    element = SubElement(robot, "link", name=name)
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "mass", value="0")
    SubElement(inertial, "inertia", dict.fromkeys(geometry.TENSOR_INDICES, "0"))
    _add_joint(robot, f"{name}_joint", parent, name, position)
    return element
