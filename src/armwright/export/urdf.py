"""An arm as URDF, which MuJoCo, Pinocchio, ROS and most simulators load."""

from xml.etree import ElementTree

from armwright.arm import Arm, Joint, Link, Vector
from armwright.export.limits import limits_of
from armwright.export.shapes import (
    AXIS_VECTORS,
    BOUNDS,
    COLOURS,
    along,
    inertia_frame,
    marker_radius,
    middle,
    moments,
    number,
    numbers,
    text_of,
    tip_place,
    tip_turn,
)


def to_urdf(arm: Arm, name: str = "arm") -> str:
    """The URDF of an arm: `world`, a fixed joint to `base`, then joint_1, link_1, …, and a frame `tip`.

    Link frames stand at their joints; with all joints at 0 they are parallel to the world's. The tip is the tool's, its
    z along the tool's axis and its x to the tool's side. Links are solid cylinders of uniform density from joint to
    joint, for inertia, collision and sight.

    Examples:
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
    return text_of(urdf_tree(arm, name))


def urdf_tree(arm: Arm, name: str) -> ElementTree.Element:
    """The same before it is text, for what adds to it."""
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
            ElementTree.SubElement(element, "limit", {key: number(value) for key, value in limits_of(joint).items()})
        parent, place = child, link.offset
    ElementTree.SubElement(robot, "link", name="tip")
    _add_joint(robot, "tip_joint", "fixed", parent, "tip", tip_place(arm), tip_turn(arm))
    return robot


def _add_joint(
    robot: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Vector,
    rpy: Vector = (0.0, 0.0, 0.0),
) -> ElementTree.Element:
    element = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz=numbers(xyz), rpy=numbers(rpy))
    return element


def _add_link(robot: ElementTree.Element, name: str, joint: Joint, link: Link) -> None:
    element = ElementTree.SubElement(robot, "link", name=name)
    rpy = numbers(along(link.offset))
    # Stated for a mass of 0 too: where it is not, MuJoCo takes water's density and scikit-robot takes 1 g.
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=numbers(link.total_com), rpy=numbers(inertia_frame(link)))
    ElementTree.SubElement(inertial, "mass", value=number(link.total_mass))
    ElementTree.SubElement(inertial, "inertia", moments(link))
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
