"""Inertia of designs: tubes, motors, brackets, rails and tools, composed by Pinocchio, in arrays and exported files."""

from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest

from armwright.problem.assumptions import assumed_values
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Joint, Link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from tests.support.arms import LIGHT

DENSITY = 2700.0
CONTENT: dict[str, Any] = {
    "name": "bodies",
    "joints": [2, 5],
    "joint_types": ["R", "P", "Y", "S", "T"],
    "stroke": [0.1, 0.4],
    "mount": ["floor", "ceiling", "wall+x", "wall-y"],
    "link_directions": ["+z", "-x", "+y"],
    "link": [0.05, 0.3],
    "link_section": {"tubes": [[0.03, 0.002], [0.05, 0.01]], "material": "aluminium"},
    "actuators": ["XM540-W270", "XM430-W350", "AK60-6"],  # boxes off their shafts, and a cylinder
}
SPACE = DesignSpace.model_validate(CONTENT)
TOOL = Tool(tip=(0.02, 0.0, 0.1), mass=0.4, center=(0.01, 0.03, 0.06), inertia=(3e-4, 2e-4, 1e-4))
DESIGNS = SPACE.sample(40, 5)


def along(axis: Any) -> np.ndarray:
    """A rotation whose z axis is this axis of the link's frame."""
    z = np.array(axis, dtype=float)
    return pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z / np.linalg.norm(z)).matrix()


def placed(body: pinocchio.Inertia, rotation: np.ndarray, middle: Any) -> pinocchio.Inertia:
    return body.se3Action(pinocchio.SE3(rotation, np.array(middle, dtype=float)))


def tube(link: Link, length: float) -> pinocchio.Inertia:
    """A round tube about its middle: an outer cylinder less the inner one."""
    parts = []
    for radius in (link.radius, link.radius - (link.wall or link.radius)):
        mass = DENSITY * np.pi * radius**2 * length
        moments = pinocchio.Inertia.FromCylinder(mass, radius, length).inertia if radius > 0.0 else np.zeros((3, 3))
        parts.append((mass, moments))
    (mass, moments), (hole, of_hole) = parts
    return pinocchio.Inertia(mass - hole, np.zeros(3), moments - of_hole)


def carried(joint: Joint, link: Link, end: np.ndarray, bracket: float) -> pinocchio.Inertia:
    """What the link before carries for a joint and the link after it: motor with bracket, and the rail of a slide."""
    assert joint.body is not None
    assert joint.actuator is not None
    mass, (x, y, z), axis = joint.actuator.mass + bracket, joint.body.size, np.eye(3)["xyz".index(joint.axis)]
    middle = end + joint.body.centre
    if joint.body.shape == "box":
        motor = placed(pinocchio.Inertia.FromBox(mass, x, y, z), np.eye(3), middle)
    else:
        motor = pinocchio.Inertia.FromCylinder(mass, joint.body.radius, joint.body.length)
        motor = placed(motor, along(axis), middle)
    if joint.kind != "prismatic":
        return motor
    stroke = joint.upper - joint.lower
    return motor + placed(tube(link, stroke), along(axis), end + axis * (joint.lower + joint.upper) / 2)


def composed(arm: Arm) -> list[pinocchio.Inertia]:
    """What moves with each joint, in the frame of its link."""
    brackets = dict(zip((record.name for record in SPACE.actuators), SPACE.bracket_masses, strict=True))
    bodies = []
    for n, link in enumerate(arm.links):
        end = np.array(link.offset)
        body = placed(tube(link, link.length), along(link.offset), end / 2)
        if n + 1 < len(arm.links):
            following = arm.joints[n + 1]
            assert following.actuator is not None
            body += carried(following, arm.links[n + 1], end, brackets[following.actuator.name])
        else:
            body += pinocchio.Inertia(arm.tool.mass, end + arm.tool.com, np.array(arm.tool.inertia))
        bodies.append(body)
    return bodies


def assert_equal(found: pinocchio.Inertia, expected: pinocchio.Inertia, rel: float) -> None:
    assert found.mass == pytest.approx(expected.mass, rel=rel)
    assert np.allclose(found.lever, expected.lever, atol=rel)
    assert np.allclose(found.inertia, expected.inertia, rtol=0.0, atol=rel * np.trace(expected.inertia))


def test_stacked_bodies_are_those_composed_of_their_parts() -> None:
    arms = stack_designs(SPACE, SPACE.matrix(DESIGNS), TOOL, "float64")
    bodies = arms.rigid_bodies
    for row, design in enumerate(DESIGNS):
        for j, expected in enumerate(composed(SPACE.arm(design, TOOL))):
            values = bodies.mass[row, j], bodies.com[row, j], bodies.inertia[row, j]
            assert_equal(pinocchio.Inertia(*values), expected, 1e-9)


def test_exported_bodies_are_those_composed_of_their_parts() -> None:
    for design in DESIGNS[:15]:
        arm = SPACE.arm(design, TOOL)
        model = pinocchio.buildModelFromXML(to_urdf(arm))
        scene = mujoco.MjModel.from_xml_string(to_mjcf(arm))
        for number, expected in enumerate(composed(arm), start=1):
            assert_equal(model.inertias[number], expected, 1e-8)
            body = scene.body(f"link_{number}")
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, body.iquat)
            tensor = turn.reshape(3, 3) @ np.diag(body.inertia) @ turn.reshape(3, 3).T
            found = pinocchio.Inertia(float(body.mass[0]), np.array(body.ipos), tensor)
            if number == len(arm.links):
                found += pinocchio.Inertia(
                    TOOL.mass, np.array(arm.links[-1].offset) + arm.tool.com, np.array(arm.tool.inertia)
                )
            assert_equal(found, expected, 1e-8)


def test_torques_of_a_motion_are_those_of_the_exported_files() -> None:
    rng = np.random.default_rng(1)
    for design in DESIGNS[:10]:
        arm = SPACE.arm(design, TOOL)
        model, scene = pinocchio.buildModelFromXML(to_urdf(arm)), mujoco.MjModel.from_xml_string(to_mjcf(arm))
        data, state = model.createData(), mujoco.MjData(scene)
        q = rng.uniform([joint.lower for joint in arm.joints], [joint.upper for joint in arm.joints])
        v, a = rng.uniform(-1.0, 1.0, (2, len(arm.joints)))
        state.qpos[:], state.qvel[:], state.qacc[:] = q, v, a
        mujoco.mj_inverse(scene, state)
        assert state.qfrc_inverse == pytest.approx(pinocchio.rnea(model, data, q, v, a), abs=1e-7)


def test_brackets_are_a_share_of_the_motor_unless_stated() -> None:
    assert SPACE.bracket_masses == pytest.approx((0.25 * 0.165, 0.25 * 0.082, 0.25 * 0.38))
    small = DesignSpace.model_validate({**LIGHT, "bracket_mass": None, "actuators": ["XL330-M288"]})
    assert small.bracket_masses == (0.01,)
    assert "brackets: 0.01 kg for each joint that moves, assumed" in small.mass_note
    stated = DesignSpace.model_validate({**LIGHT, "actuators": ["XL330-M288"]})
    assert stated.bracket_masses == (0.0,)
    assert "brackets" not in stated.mass_note
    task = Task(name="near", targets=((0.2, 0.0, 0.2),))
    for own, assumed in ((small, {"bracket_mass": 0.01}), (stated, {})):
        found = assumed_values(Problem(task, own))["XL330-M288"]
        assert {name: value for name, value in found.items() if name == "bracket_mass"} == assumed
        arm = own.arm(own.sample(1, 0)[0])
        assert arm.base_mass == pytest.approx(0.018 + sum(assumed.values()))
