"""An arm as SDFormat, which Gazebo and Drake load."""

import re
from xml.etree import ElementTree

from armwright.arm import Arm, Joint, Link
from armwright.exceptions import ArmError
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

VERSION = "1.9"  # Gazebo Fortress reads it, and all since
LEAST_MASS, LEAST_INERTIA = float(BOUNDS["boundmass"]), float(BOUNDS["boundinertia"])  # [kg], [kg m²]


def to_sdf(arm: Arm, name: str = "arm") -> str:
    """The SDFormat model of an arm: a link `base`, fixed to `world`; joint_1, link_1, …; and a frame `tip`.

    Names, frames, masses, inertias, limits and colours are those of `to_urdf`: link frames stand at their joints, and
    with all joints at 0 they are parallel to the world's. SDFormat has no link without mass: the base has 1e-12 kg, as
    has a link without any.

    A model states no gravity: for our torques the world needs `<gravity>0 0 -9.81</gravity>`; Gazebo's has 9.8.
    """
    if not name.strip() or "::" in name or re.fullmatch(r"world|__.*__", name, re.DOTALL):
        raise ArmError(f'name = "{name}": SDFormat takes no empty name, none with "::", and keeps world and __name__')
    sdf = ElementTree.Element("sdf", version=VERSION)
    model = ElementTree.SubElement(sdf, "model", name=name)
    base = ElementTree.SubElement(model, "link", name="base")
    ElementTree.SubElement(base, "pose").text = f"{numbers(arm.base)} 0 0 0"
    _add_inertial(base, Link((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 1.0))
    _add_joint(model, "world_to_base", "fixed", "world", "base")
    parent, place = "base", (0.0, 0.0, 0.0)
    for n, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        child = f"link_{n}"
        element = ElementTree.SubElement(model, "link", name=child)
        ElementTree.SubElement(element, "pose", relative_to=parent).text = f"{numbers(place)} 0 0 0"
        _add_link(element, n, joint, link)
        element = _add_joint(model, f"joint_{n}", joint.kind, parent, child)
        if joint.kind != "fixed":
            _add_axis(element, joint, child)
        parent, place = child, link.offset
    tip = ElementTree.SubElement(model, "frame", name="tip", attached_to=parent)
    ElementTree.SubElement(tip, "pose").text = f"{numbers(tip_place(arm))} {numbers(tip_turn(arm))}"
    return text_of(sdf)


def _add_joint(model: ElementTree.Element, name: str, kind: str, parent: str, child: str) -> ElementTree.Element:
    element = ElementTree.SubElement(model, "joint", name=name, type=kind)
    ElementTree.SubElement(element, "parent").text = parent
    ElementTree.SubElement(element, "child").text = child
    return element


def _add_axis(element: ElementTree.Element, joint: Joint, frame: str) -> None:
    axis = ElementTree.SubElement(element, "axis")
    ElementTree.SubElement(axis, "xyz", expressed_in=frame).text = AXIS_VECTORS[joint.axis]
    limit = ElementTree.SubElement(axis, "limit")
    for key, value in limits_of(joint).items():
        ElementTree.SubElement(limit, key).text = number(value)


def _add_inertial(element: ElementTree.Element, link: Link) -> None:
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "mass").text = number(max(link.total_mass, LEAST_MASS))
    pose = f"{numbers(link.total_com)} {numbers(inertia_frame(link))}"
    ElementTree.SubElement(inertial, "pose").text = pose
    inertia = ElementTree.SubElement(inertial, "inertia")
    # The least moment of a cylinder is at least m r² / 4; a mass at its end takes nothing away.
    added = LEAST_INERTIA if link.mass * link.radius**2 / 4.0 < LEAST_INERTIA else 0.0
    for key, value in moments(link).items():
        text = f"{float(value) + added:.17g}" if key in ("ixx", "iyy", "izz") else value
        ElementTree.SubElement(inertia, key).text = text


def _add_link(element: ElementTree.Element, n: int, joint: Joint, link: Link) -> None:
    _add_inertial(element, link)
    if link.length > 0.0:
        for purpose in ("visual", "collision"):
            body = ElementTree.SubElement(element, purpose, name=f"link_{n}_{purpose}")
            ElementTree.SubElement(body, "pose").text = f"{numbers(middle(link))} {numbers(along(link.offset))}"
            shape = ElementTree.SubElement(ElementTree.SubElement(body, "geometry"), "cylinder")
            ElementTree.SubElement(shape, "radius").text = number(link.radius)
            ElementTree.SubElement(shape, "length").text = number(link.length)
            if purpose == "visual":
                _add_material(body, "link")
    marker = ElementTree.SubElement(element, "visual", name=f"joint_{n}_visual")
    sphere = ElementTree.SubElement(ElementTree.SubElement(marker, "geometry"), "sphere")
    ElementTree.SubElement(sphere, "radius").text = number(marker_radius(link))
    _add_material(marker, f"joint_{joint.axis}")


def _add_material(visual: ElementTree.Element, colour: str) -> None:
    material = ElementTree.SubElement(visual, "material")
    for light in ("ambient", "diffuse"):
        ElementTree.SubElement(material, light).text = COLOURS[colour]
