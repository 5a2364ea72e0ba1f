"""An arm as MJCF, MuJoCo's own format."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement

from armwright.robot import link_geometry as geometry
from armwright.robot.arm import GRAVITY, Arm, Column, Joint, Link
from armwright.robot.motor_body import MotorBody
from armwright.robot.xml_text import COLOURS, MIN_INERTIA, number, numbers, to_xml

TYPES = {"revolute": "hinge", "prismatic": "slide"}  # a fixed joint is a body without a joint
# XYZ: roll, pitch and yaw about fixed axes, as in a URDF.
COMPILER = {"angle": "radian", "autolimits": "true", "eulerseq": "XYZ", "inertiafromgeom": "false", **MIN_INERTIA}
SKY = {"builtin": "gradient", "rgb1": "0.97 0.97 0.98", "rgb2": "0.84 0.86 0.90", "width": "64", "height": "384"}
STIFF = {"solref": "0.004 1", "solimp": "0.999 0.9999 0.001"}  # of a coupling: two time steps, the least that is stable
TIP_COLOUR = "0.07 0.07 0.07 1"


def to_mjcf(arm: Arm, name: str = "arm") -> str:
    """Return the MJCF of an arm: `base`, link_1 on joint_1, …, a site `tip`, motor_1 on joint_1, …, and `column`.

    Names, frames, masses, inertias and colours are those of `to_urdf`: link frames are at their joints, and with all
    joints at 0 they are parallel to the world frame. A tool with mass is a body `tool` at the end of the last link. The
    body of an actuator is a body motor_1, … on the link before its joint, a column a body `column` on the base.
    Each moving joint has a motor with gear 1, limited to the torque of its actuator if it has one. `ctrl` is the torque
    [N m] or force [N] on that joint. A joint that follows another has an equality constraint instead.

    Geometry is for display only. It has no mass, since the mass of each link is stated, and no contacts: links overlap
    at their joints, so contacts would push them apart.

    `python -m mujoco.viewer --mjcf=arm.xml` shows the arm.
    """
    root = Element("mujoco", model=name)
    SubElement(root, "compiler", COMPILER)
    SubElement(root, "option", gravity=numbers((0.0, 0.0, -GRAVITY)))
    SubElement(SubElement(root, "default"), "geom", contype="0", conaffinity="0", mass="0")
    body = SubElement(add_scene(root, arm), "body", name="base", pos=numbers(arm.base))
    if arm.column is not None:
        add_column(body, arm.column)
    for segment in geometry.segments(arm):
        if segment.joint.body is not None:
            add_motor(body, segment, segment.joint.body, segment.motor_name)
        body = SubElement(body, "body", name=segment.name, pos=numbers(segment.position))
        if segment.joint.kind != "fixed":
            SubElement(body, "joint", joint_attributes(f"joint_{segment.number}", segment.joint))
        _add_link(body, segment.joint, segment.link)
    add_tip(body, arm)
    add_tool(body, arm)
    actuators = SubElement(root, "actuator")
    for n, joint in geometry.moving_joints(arm):
        if (coupling := joint.coupling) is not None:
            law = {
                "joint2": f"joint_{coupling.leader + 1}",
                "polycoef": numbers((coupling.offset, coupling.factor, 0, 0, 0)),
            }
            SubElement(SubElement(root, "equality"), "joint", {"joint1": f"joint_{n}", **law, **STIFF})
            continue
        motor = {"name": f"motor_{n}", "joint": f"joint_{n}", "gear": "1"}
        if joint.effort is not None:
            motor["ctrlrange"] = f"{number(-joint.effort)} {number(joint.effort)}"
        SubElement(actuators, "motor", motor)
    return to_xml(root)


def add_scene(root: Element, arm: Arm) -> Element:
    """Add an empty world, lit from one side, with everything within reach in view; return its body."""
    x, y, z = arm.base
    size = arm.reach + arm.links[0].radius  # never 0
    # The viewer's camera is 1.5 extents away and sees 22.5 degrees to each side: size = 1.5 extents * sin(22.5).
    SubElement(root, "statistic", center=numbers(arm.base), extent=number(1.75 * size))
    assets = SubElement(root, "asset")
    SubElement(assets, "texture", {"type": "skybox", **SKY})
    for material, rgba in COLOURS.items():
        SubElement(assets, "material", name=material, rgba=rgba)
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos=numbers((x - size, y - size, z + 2.0 * size)), dir="1 1 -2")
    return world


def joint_attributes(name: str, joint: Joint) -> dict[str, str]:
    """Return name, type, axis and limits of a joint that moves."""
    limits = f"{number(joint.lower)} {number(joint.upper)}"
    return {"name": name, "type": TYPES[joint.kind], "axis": numbers(joint.direction), "range": limits}


def _add_link(body: Element, joint: Joint, link: Link) -> None:
    add_inertial(body, link)
    if link.length > 0.0:
        cylinder = {"type": "cylinder", "size": f"{number(link.radius)} {number(link.length / 2.0)}"}
        place = {"pos": numbers(geometry.midpoint(link)), "euler": numbers(geometry.rpy_along(link.offset))}
        SubElement(body, "geom", {**cylinder, **place, "material": "link"})
    marker = {"type": "sphere", "size": number(geometry.marker_radius(link)), "material": f"joint_{joint.nearest_axis}"}
    SubElement(body, "geom", marker)


def add_inertial(body: Element, link: Link) -> None:
    """Add mass and inertia of a link."""
    euler = numbers(geometry.rpy_along(link.offset))
    inertial = {"pos": numbers(link.total_com), "mass": number(link.total_mass)}
    moments = list(geometry.inertia_moments(link).values())
    if link.end_mass == 0.0:
        inertial |= {"euler": euler, "diaginertia": " ".join(moments[:3])}
    else:
        inertial["fullinertia"] = " ".join(moments)
    SubElement(body, "inertial", inertial)


def add_motor(
    carrier: Element, segment: geometry.Segment, body: MotorBody, name: str, attributes: Mapping[str, str] | None = None
) -> None:
    """Add the body of an actuator to the link that carries it, with further attributes of its geometry."""
    element = SubElement(carrier, "body", name=name, pos=numbers(segment.position))
    x, y, z = body.size
    size = (x / 2, y / 2, z / 2) if body.shape == "box" else (body.radius, body.length / 2)
    place = {"pos": numbers(body.centre), "euler": numbers(geometry.body_rpy(body))}
    solid = {"type": body.shape, "size": numbers(size), **place}
    SubElement(element, "geom", {**solid, "material": f"joint_{segment.joint.nearest_axis}", **(attributes or {})})


def add_column(base: Element, column: Column, attributes: Mapping[str, str] | None = None) -> None:
    """Add the column to the base that stands on it, with further attributes of its geometry."""
    element = SubElement(base, "body", name="column")
    solid = {"type": "cylinder", "size": numbers((column.radius, column.length / 2)), "pos": numbers(column.middle)}
    SubElement(element, "geom", {**solid, "material": "link", **(attributes or {})})


def add_tip(body: Element, arm: Arm) -> None:
    """Add the site `tip` to the last link."""
    rpy, size = geometry.tip_rpy(arm), number(arm.links[-1].radius)
    tip = {"name": "tip", "pos": numbers(geometry.tip_position(arm)), "size": size, "rgba": TIP_COLOUR}
    if any(rpy):
        tip["euler"] = numbers(rpy)
    SubElement(body, "site", tip)


def add_tool(body: Element, arm: Arm) -> None:
    """Add the body of a tool with mass to the last link."""
    if arm.tool.mass == 0.0:
        return
    tool = SubElement(body, "body", name="tool", pos=numbers(arm.links[-1].offset))
    inertial = {"pos": numbers(arm.tool.com), "mass": number(arm.tool.mass)}
    SubElement(tool, "inertial", inertial | {"fullinertia": " ".join(geometry.tool_moments(arm).values())})
