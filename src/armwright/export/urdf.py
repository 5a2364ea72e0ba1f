"""An arm as URDF, which MuJoCo, Pinocchio, ROS and most simulators load."""

from xml.etree import ElementTree

from armwright.arm import Arm, Joint, Link, Vector
from armwright.export.shapes import (
    AXIS_VECTORS,
    BOUNDS,
    COLOURS,
    along,
    cylinder_inertia,
    inertia_tensor,
    marker_radius,
    middle,
    number,
    numbers,
    text_of,
)

# URDF demands both for a moving joint; without an actuator they only have to be out of the way.
EFFORT = 100.0  # [N m] or [N]
VELOCITY = 10.0  # [rad/s] or [m/s]


def to_urdf(arm: Arm, name: str = "arm") -> str:
    """The URDF of an arm: `world`, a fixed joint to `base`, then joint_1, link_1, …, and a frame `tip`.

    Link frames stand at their joints; with all joints at 0 they are parallel to the world's. Links are
    solid cylinders of uniform density from joint to joint, for inertia, collision and sight.
    """
    robot = ElementTree.Element("robot", name=name)
    # MuJoCo would otherwise dissolve `base` and `tip`, drop what is only to be seen, and refuse links without mass.
    compiler = ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", discardvisual="false", **BOUNDS)
    for material, rgba in COLOURS.items():
        ElementTree.SubElement(ElementTree.SubElement(robot, "material", name=material), "color", rgba=rgba)
    ElementTree.SubElement(robot, "link", name="world")
    ElementTree.SubElement(robot, "link", name="base")
    _add_joint(robot, "world_to_base", "fixed", "world", "base", arm.base)
    parent, place = "base", (0.0, 0.0, 0.0)
    for n, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        child = f"link_{n}"
        _add_link(robot, child, joint, link)
        element = _add_joint(robot, f"joint_{n}", joint.kind, parent, child, place)
        if joint.kind != "fixed":
            ElementTree.SubElement(element, "axis", xyz=AXIS_VECTORS[joint.axis])
            motor = joint.actuator
            effort = EFFORT if motor is None else motor.effort
            velocity = VELOCITY if motor is None or motor.speed is None else motor.speed
            limits = {"lower": joint.lower, "upper": joint.upper, "effort": effort, "velocity": velocity}
            ElementTree.SubElement(element, "limit", {key: number(value) for key, value in limits.items()})
        parent, place = child, link.offset
    ElementTree.SubElement(robot, "link", name="tip")
    _add_joint(robot, "tip_joint", "fixed", parent, "tip", place)
    return text_of(robot)


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, xyz: Vector
) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz=numbers(xyz), rpy="0 0 0")
    return element


def _moments(link: Link) -> dict[str, str]:
    """About the centre of mass: along the link's own axes, or with what sits at its end in the link's frame."""
    if link.end_mass == 0.0:
        across, around = cylinder_inertia(link)
        return {"ixx": across, "iyy": across, "izz": around, "ixy": "0", "ixz": "0", "iyz": "0"}
    tensor = inertia_tensor(link)
    places = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    return {name: f"{tensor[place]:.17g}" for name, place in places.items()}


def _add_link(robot: ElementTree.Element, name: str, joint: Joint, link: Link) -> None:
    element = ElementTree.SubElement(robot, "link", name=name)
    rpy = numbers(along(link.offset))
    # Stated for a mass of 0 too: where it is not, MuJoCo takes water's density and scikit-robot takes 1 g.
    inertial = ElementTree.SubElement(element, "inertial")
    turned = rpy if link.end_mass == 0.0 else "0 0 0"
    ElementTree.SubElement(inertial, "origin", xyz=numbers(link.total_com), rpy=turned)
    ElementTree.SubElement(inertial, "mass", value=number(link.total_mass))
    ElementTree.SubElement(inertial, "inertia", _moments(link))
    if link.length > 0.0:
        for purpose in ("visual", "collision"):
            body = ElementTree.SubElement(element, purpose)
            ElementTree.SubElement(body, "origin", xyz=numbers(middle(link)), rpy=rpy)
            shape = ElementTree.SubElement(body, "geometry")
            ElementTree.SubElement(shape, "cylinder", radius=number(link.radius), length=number(link.length))
            if purpose == "visual":
                ElementTree.SubElement(body, "material", name="link")
    marker = ElementTree.SubElement(element, "visual")
    ElementTree.SubElement(marker, "origin", xyz="0 0 0", rpy="0 0 0")
    ElementTree.SubElement(ElementTree.SubElement(marker, "geometry"), "sphere", radius=number(marker_radius(link)))
    ElementTree.SubElement(marker, "material", name=f"joint_{joint.axis}")
