"""An arm as URDF with the tags of ros2_control."""

from xml.etree import ElementTree

from armwright.arm import Arm, Joint
from armwright.export.limits import home_of, limits_of
from armwright.export.shapes import number, text_of
from armwright.export.urdf import urdf_tree

MOCK = "mock_components/GenericSystem"


def to_ros2_control(arm: Arm, name: str = "arm", plugin: str = MOCK) -> str:
    """The URDF of `to_urdf` and one `<ros2_control type="system">` of all its joints that move.

    Each takes commands of position, velocity and effort within the limits of the URDF, and tells the same three. It
    begins at 0, or at the limit nearest to it.
    plugin: the hardware's; the default reports as done what it was told, and needs no hardware.
    """
    robot = urdf_tree(arm, name)
    system = ElementTree.SubElement(robot, "ros2_control", name="arm", type="system")
    ElementTree.SubElement(ElementTree.SubElement(system, "hardware"), "plugin").text = plugin
    for n, joint in enumerate(arm.joints, start=1):
        if joint.kind != "fixed":
            _add_interfaces(ElementTree.SubElement(system, "joint", name=f"joint_{n}"), joint)
    return text_of(robot)


def _add_interfaces(element: ElementTree.Element, joint: Joint) -> None:
    limits = limits_of(joint)
    ranges = {
        "position": (limits["lower"], limits["upper"]),
        "velocity": (-limits["velocity"], limits["velocity"]),
        "effort": (-limits["effort"], limits["effort"]),
    }
    for kind, (low, high) in ranges.items():
        command = ElementTree.SubElement(element, "command_interface", name=kind)
        ElementTree.SubElement(command, "param", name="min").text = number(low)
        ElementTree.SubElement(command, "param", name="max").text = number(high)
    for kind in ranges:
        state = ElementTree.SubElement(element, "state_interface", name=kind)
        if kind == "position":
            ElementTree.SubElement(state, "param", name="initial_value").text = number(home_of(joint))
