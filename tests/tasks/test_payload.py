"""Rigid payloads, off the tip and with inertia, and tools, on designs and on existing arms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.arms.arm_arrays import carrying, stack_arms
from armwright.kinematics.arms.forward import joint_positions
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.problem import Problem
from armwright.robot.arm import MountedTool
from armwright.rotations import rotation_from_rpy
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.tool_mount import with_tool
from armwright.tasks.payload import Payload
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from tests.support.dynamics import inverse_dynamics
from tests.support.exported_arms import ARMS, carrying_peer, full, load, moving, peer_of, postures

BOX = Payload(mass=0.8, center=(0.02, -0.01, 0.05), size=(0.06, 0.04, 0.1))
BODY = Payload(mass=1.3, center=(-0.03, 0.02, 0.04), inertia=(3e-3, 2e-3, 4e-3))
HELD = Tool(
    tip=(0.02, -0.03, 0.1), rpy=(0.4, -0.3, 2.0), mass=0.7, center=(0.03, 0.01, 0.06), inertia=(3e-4, 2e-4, 4e-4)
)
POINTS = [[0.3, 0.1, 0.2], [0.1, 0.3, 0.3]]
TOOL = {"tip": [0.02, -0.03, 0.1], "rpy": [0.4, -0.3, 2.0], "mass": 0.7, "center": [0.0, 0.0, 0.05]}
SPACE = DesignSpace.model_validate(
    {"name": "heavy", "mount": ["floor", "wall+x"], "mass": {"kind": "per_link", "kg": 0.2}}
)


def task(**more: Any) -> Task:
    return Task.model_validate({"name": "handling", "targets": POINTS, **more})


def body_of(payload: Payload, factor: float = 1.0) -> Any:
    """The payload by Pinocchio's own means; it has a formula of its own for boxes."""
    mass = factor * payload.mass
    moments = factor * np.diag(payload.inertia or (0.0, 0.0, 0.0))
    tensor = moments if payload.size is None else pinocchio.Inertia.FromBox(mass, *payload.size).inertia
    return pinocchio.Inertia(mass, np.array(payload.center), tensor)


@pytest.mark.parametrize("payload", [BOX, BODY], ids=["box", "inertia"])
@pytest.mark.parametrize("arm", ARMS)
def test_gravity_torque_and_inverse_dynamics_agree_with_pinocchio(arm: Any, payload: Payload) -> None:
    peer = carrying_peer(arm, body_of(payload, 1.2))
    arrays, rng = carrying(stack_arms([arm], "float64"), payload.shape), np.random.default_rng(2)
    own, mass = [number - 1 for number, _ in moving(arm)], np.array([1.2 * payload.mass])
    size = load(arm) + 20.0
    for q in postures(arm, 3):
        v, a = rng.uniform(-2.0, 2.0, (2, len(q)))
        rows = [full(arm, values)[None, None] for values in (q, v, a)]
        expected = pinocchio.rnea(peer.model, peer.data, q, v, a)
        assert inverse_dynamics(arrays, *rows, mass)[0, 0, own] == pytest.approx(expected, rel=1e-8, abs=1e-8 * size)
        solved = solve_postures(arrays, np.zeros((1, 3)), 0, initial_q=rows[0], payload=mass, precision="float64")
        assert solved.torque[0, 0, own] == pytest.approx(peer.gravity(q), rel=1e-8, abs=1e-8 * size)


def test_problem_carries_the_payload_of_its_task_and_factors_multiply_it() -> None:
    problem = Problem(task(tool=TOOL, payload=BODY.model_dump(), payload_factors=[0.0, 1.5]), SPACE)
    designs = SPACE.sample(20, 1)
    arms = problem.arms(SPACE.matrix(designs))
    for case, factor in enumerate((1.0, 0.0, 1.5)):
        evaluation = problem.physics(arms, case)
        for row, design in enumerate(designs):
            peer = carrying_peer(problem.arm(design), body_of(BODY, factor))
            for t in range(len(POINTS)):
                expected = peer.gravity(evaluation.q[row, t])
                assert evaluation.joint_torques[row, t] == pytest.approx(expected, abs=2e-5)


def test_point_mass_written_as_a_record_equals_a_number_to_the_bit() -> None:
    designs = SPACE.sample(50, 3)
    one, other = (Problem(task(tool=TOOL, payload=kg), SPACE).physics(designs) for kg in (0.8, {"mass": 0.8}))
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.joint_torques, other.joint_torques)


@pytest.mark.parametrize("arm", ARMS)
def test_tool_on_an_existing_arm_is_placed_in_its_tip_frame(arm: Any) -> None:
    held = with_tool(arm, HELD)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_from_rpy(*HELD.rpy), HELD.tip
    for q in postures(arm, 3):
        expected = peer_of(arm).tip(q) @ pose
        assert np.allclose(peer_of(held).tip(q), expected, atol=1e-9)
        assert np.allclose(joint_positions(held, full(arm, q))[-1], expected[:3, 3], atol=1e-9)


def test_arms_of_a_problem_carry_the_tool_of_its_task() -> None:
    bare, tooled = (Problem(task(**more)) for more in ({}, {"tool": HELD.model_dump()}))
    design = paper_space().sample(1, 0)[0]
    assert bare.arm(design) == paper_space().arm(design)
    assert tooled.arm(design) == paper_space().arm(design, HELD) == with_tool(bare.arm(design), HELD)
    assert tooled.max_reach == pytest.approx(bare.max_reach + np.linalg.norm(HELD.tip))
    assert np.allclose(tooled.physics([design]).arms.tool.tip, HELD.tip)
    assert tooled.arm(design).mass == pytest.approx(bare.arm(design).mass + HELD.mass)


@pytest.mark.parametrize("arm", ARMS)
def test_mass_of_a_tool_counts_as_in_pinocchio(arm: Any) -> None:
    """Add the tool to Pinocchio's model by its own means; compare gravity, inverse dynamics and the mass matrix."""
    bare = replace(arm, tool=replace(arm.tool, mass=0.0, com=(0.0, 0.0, 0.0), inertia=MountedTool().inertia))
    body = pinocchio.Inertia(HELD.mass, np.array(HELD.center), np.diag(HELD.inertia))
    peer, held = carrying_peer(bare, body), with_tool(bare, HELD)
    arrays, rng = stack_arms([held], "float64"), np.random.default_rng(1)
    own = [number - 1 for number, _ in moving(arm)]
    for q in postures(arm, 3):
        v, a = rng.uniform(-2.0, 2.0, (2, len(q)))
        expected = pinocchio.rnea(peer.model, peer.data, q, v, a)
        rows = [full(arm, values)[None, None] for values in (q, v, a)]
        found = inverse_dynamics(arrays, *rows, np.zeros(1))[0, 0, own]
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * load(held))
        solved = solve_postures(arrays, np.zeros((1, 3)), 0, initial_q=rows[0], precision="float64")
        assert solved.torque[0, 0, own] == pytest.approx(peer.gravity(q), rel=1e-8, abs=1e-8 * load(held))
        assert peer_of(held).gravity(q) == pytest.approx(peer.gravity(q), rel=1e-8, abs=1e-8 * load(held))
        assert peer_of(held).mass_matrix(q) == pytest.approx(peer.mass_matrix(q), rel=1e-8, abs=1e-8 * load(held))


@pytest.mark.parametrize("body", [{"size": (0.06, 0.04, 0.1)}, {"radius": 0.03}], ids=["box", "cylinder"])
def test_tool_without_stated_inertia_has_that_of_its_body(body: Any) -> None:
    """Pinocchio has formulas of its own for boxes and cylinders."""
    tool = Tool(tip=(0.02, -0.03, 0.1), rpy=(0.4, -0.3, 2.0), mass=0.7, center=(0.03, 0.01, 0.06), **body)
    arm = paper_space().arm(paper_space().sample(1, 0)[0], Tool())
    found = np.array(with_tool(arm, tool).tool.inertia)
    # The frame of the tool is that of the bare arm's tip.
    z, x = np.array(arm.tool.axis), np.array(arm.tool.side)
    frame = np.column_stack([x, np.cross(z, x), z])
    if "size" in body:
        expected, axes = pinocchio.Inertia.FromBox(0.7, *body["size"]).inertia, rotation_from_rpy(*tool.rpy)
    else:
        expected = pinocchio.Inertia.FromCylinder(0.7, body["radius"], float(np.linalg.norm(tool.tip))).inertia
        axes = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(tool.tip)).matrix()
    assert found == pytest.approx(frame @ axes @ expected @ axes.T @ frame.T, abs=1e-15)
    stated = with_tool(arm, tool.model_copy(update={"inertia": HELD.inertia})).tool.inertia
    assert np.array(stated) == pytest.approx(frame @ np.diag(HELD.inertia) @ frame.T, abs=1e-15)
