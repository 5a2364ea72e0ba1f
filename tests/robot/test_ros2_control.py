"""URDF with ros2_control tags."""

import io
from xml.etree import ElementTree

import mujoco
import pytest
import yourdfpy

from armwright.robot.arm import Arm
from armwright.robot.ros2_control import to_ros2_control
from armwright.robot.urdf_writer import to_urdf
from tests.support.exported_arms import ARMS, MIXED, Peer, moving


def text_of(element: ElementTree.Element) -> str:
    return ElementTree.tostring(element, encoding="unicode").strip()


@pytest.mark.parametrize("arm", ARMS)
def test_ros2_control_without_its_tags_is_the_urdf(arm: Arm) -> None:
    robot, urdf = ElementTree.fromstring(to_ros2_control(arm, "x")), ElementTree.fromstring(to_urdf(arm, "x"))
    (system,) = robot.findall("ros2_control")
    robot.remove(system)
    assert [text_of(element) for element in robot] == [text_of(element) for element in urdf]
    assert robot.attrib == urdf.attrib


@pytest.mark.parametrize("arm", ARMS)
def test_urdf_parsers_accept_ros2_control(arm: Arm) -> None:
    text = to_ros2_control(arm)
    assert Peer(text).model.nq == mujoco.MjModel.from_xml_string(text).nq == len(moving(arm))
    assert yourdfpy.URDF.load(io.BytesIO(text.encode())).validate()


@pytest.mark.parametrize("arm", ARMS)
def test_interfaces_match_moving_joints_and_urdf_limits(arm: Arm) -> None:
    """Read command_interface and state_interface with min, max and initial_value."""
    robot = ElementTree.fromstring(to_ros2_control(arm))
    (system,) = robot.findall("ros2_control")
    assert system.get("type") == "system"
    assert system.findtext("hardware/plugin") == "mock_components/GenericSystem"
    joints = {joint.attrib["name"]: joint.find("limit") for joint in robot.findall("joint")}
    assert [e.get("name") for e in system.findall("joint")] == [f"joint_{number}" for number, _ in moving(arm)]
    for element in system.findall("joint"):
        limit = joints[element.attrib["name"]]
        assert limit is not None
        stated = {key: float(value) for key, value in limit.attrib.items()}
        wanted = {
            "position": (stated["lower"], stated["upper"]),
            "velocity": (-stated["velocity"], stated["velocity"]),
            "effort": (-stated["effort"], stated["effort"]),
        }
        commands = element.findall("command_interface")
        assert [command.get("name") for command in commands] == list(wanted)
        for command in commands:
            params = {param.get("name"): float(param.text or "") for param in command.findall("param")}
            assert (params["min"], params["max"]) == wanted[command.attrib["name"]]
        assert [state.get("name") for state in element.findall("state_interface")] == list(wanted)
        (start,) = element.findall("state_interface/param[@name='initial_value']")
        assert stated["lower"] <= float(start.text or "") <= stated["upper"]


def test_plugin_is_configurable_and_escaped() -> None:
    for plugin in ("gz_ros2_control/GazeboSimSystem", "<&>"):
        robot = ElementTree.fromstring(to_ros2_control(MIXED, plugin=plugin))
        assert robot.findtext("ros2_control/hardware/plugin") == plugin
