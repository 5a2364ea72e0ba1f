"""An arm as URDF, which MuJoCo, Pinocchio, ROS and most simulators load."""

import math
from xml.etree import ElementTree

from armwright.arm import Arm, Joint, Link, Vector

# URDF demands both for a moving joint. The arm has no actuators yet, so they only have to be out of the way.
EFFORT = 100.0  # [N m] or [N]
VELOCITY = 10.0  # [rad/s] or [m/s]

AXIS_VECTORS = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
COLOURS = {
    "link": "0.75 0.75 0.78 1",
    "joint_x": "0.84 0.37 0.00 1",
    "joint_y": "0.00 0.45 0.70 1",
    "joint_z": "0.00 0.62 0.45 1",
}


def to_urdf(arm: Arm, name: str = "arm") -> str:
    """The URDF of an arm: `world`, a fixed joint to `base`, then joint_1, link_1, …, and a frame `tip`.

    Link frames stand at their joints; with all joints at 0 they are parallel to the world's. Links are
    solid cylinders of uniform density from joint to joint, for inertia, collision and sight.
    """
    robot = ElementTree.Element("robot", name=name)
    # MuJoCo would otherwise dissolve `base` and `tip`, drop what is only to be seen, and refuse links without mass.
    compiler = ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", discardvisual="false", boundmass="1e-12", boundinertia="1e-14")
    for material, rgba in COLOURS.items():
        ElementTree.SubElement(ElementTree.SubElement(robot, "material", name=material), "color", rgba=rgba)
    ElementTree.SubElement(robot, "link", name="world")
    ElementTree.SubElement(robot, "link", name="base")
    _add_joint(robot, "world_to_base", "fixed", "world", "base", arm.base)
    parent, place = "base", (0.0, 0.0, 0.0)
    for number, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        child = f"link_{number}"
        _add_link(robot, child, joint, link)
        element = _add_joint(robot, f"joint_{number}", joint.kind, parent, child, place)
        if joint.kind != "fixed":
            ElementTree.SubElement(element, "axis", xyz=AXIS_VECTORS[joint.axis])
            limits = {"lower": joint.lower, "upper": joint.upper, "effort": EFFORT, "velocity": VELOCITY}
            ElementTree.SubElement(element, "limit", {key: _number(value) for key, value in limits.items()})
        parent, place = child, link.offset
    ElementTree.SubElement(robot, "link", name="tip")
    _add_joint(robot, "tip_joint", "fixed", parent, "tip", place)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, xyz: Vector
) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz=_numbers(xyz), rpy="0 0 0")
    return element


def _add_link(robot: ElementTree.Element, name: str, joint: Joint, link: Link) -> None:
    element = ElementTree.SubElement(robot, "link", name=name)
    rpy = _numbers(_along(link.offset))
    # Stated for a mass of 0 too: where it is not, MuJoCo takes water's density and scikit-robot takes 1 g.
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(link.com), rpy=rpy)
    ElementTree.SubElement(inertial, "mass", value=_number(link.mass))
    # A cylinder without length is a disc, 2 across = around: all digits, as MuJoCo refuses what is a rounding below it.
    around = link.mass * link.radius**2 / 2.0
    across = around / 2.0 + link.mass * link.length**2 / 12.0
    moments = {"ixx": f"{across:.17g}", "iyy": f"{across:.17g}", "izz": f"{around:.17g}"}
    ElementTree.SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})
    if link.length > 0.0:
        middle = _numbers((link.offset[0] / 2, link.offset[1] / 2, link.offset[2] / 2))
        for purpose in ("visual", "collision"):
            body = ElementTree.SubElement(element, purpose)
            ElementTree.SubElement(body, "origin", xyz=middle, rpy=rpy)
            shape = ElementTree.SubElement(body, "geometry")
            ElementTree.SubElement(shape, "cylinder", radius=_number(link.radius), length=_number(link.length))
            if purpose == "visual":
                ElementTree.SubElement(body, "material", name="link")
    marker = ElementTree.SubElement(element, "visual")
    ElementTree.SubElement(marker, "origin", xyz="0 0 0", rpy="0 0 0")
    ElementTree.SubElement(ElementTree.SubElement(marker, "geometry"), "sphere", radius=_number(1.4 * link.radius))
    ElementTree.SubElement(marker, "material", name=f"joint_{joint.axis}")


def _along(offset: Vector) -> Vector:
    """Roll, pitch, yaw [rad] of the frame whose z points along `offset`."""
    x, y, z = offset
    return (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))


def _number(value: float) -> str:
    return f"{value:.10g}"


def _numbers(values: Vector) -> str:
    return " ".join(_number(value) for value in values)
