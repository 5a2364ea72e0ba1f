"""An arm as URDF with the tags of ros2_control."""

from xml.etree.ElementTree import Element, SubElement

from armwright.robot.arm import Arm, Joint
from armwright.robot.link_geometry import home_posture, joint_limits, moving_joints
from armwright.robot.urdf_writer import urdf_tree
from armwright.robot.xml_text import number, to_xml

MOCK = "mock_components/GenericSystem"


def to_ros2_control(arm: Arm, name: str = "arm", plugin: str = MOCK) -> str:
    """Return the URDF of an arm with one `<ros2_control type="system">` for all joints that move.

    Each joint accepts commands of position, velocity and effort within the limits of the URDF, and reports the same
    three. One that follows another only reports; how it follows, says the tag `<mimic>` of the URDF (ROS 2 Jazzy and
    later). A joint starts at 0, or at the limit closest to it. `plugin` is the hardware plugin; the default needs no
    hardware and reports every command as executed.
    """
    robot = urdf_tree(arm, name)
    system = SubElement(robot, "ros2_control", name="arm", type="system")
    SubElement(SubElement(system, "hardware"), "plugin").text = plugin
    home = home_posture(arm)
    for n, joint in moving_joints(arm):
        _add_interfaces(SubElement(system, "joint", name=f"joint_{n}"), joint, home[n - 1])
    return to_xml(robot)


def _add_interfaces(element: Element, joint: Joint, home: float) -> None:
    limits = joint_limits(joint)
    ranges = {
        "position": (limits["lower"], limits["upper"]),
        "velocity": (-limits["velocity"], limits["velocity"]),
        "effort": (-limits["effort"], limits["effort"]),
    }
    for kind, (low, high) in ranges.items() if joint.coupling is None else ():
        command = SubElement(element, "command_interface", name=kind)
        SubElement(command, "param", name="min").text = number(low)
        SubElement(command, "param", name="max").text = number(high)
    for kind in ranges:
        state = SubElement(element, "state_interface", name=kind)
        if kind == "position":
            SubElement(state, "param", name="initial_value").text = number(home)
