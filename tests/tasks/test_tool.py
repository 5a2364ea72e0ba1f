"""Tools of tasks, on designs and on existing arms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import joint_positions
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.problem import Problem
from armwright.robot.arm import MountedTool
from armwright.rotations import rotation_from_rpy
from armwright.spaces.design_space import paper_space
from armwright.spaces.tool_mount import with_tool
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from tests.support.dynamics import inverse_dynamics
from tests.support.exported_arms import ARMS, full, load, moving, peer_of, postures

NO_INERTIA = MountedTool().inertia
TOOL = Tool(
    tip=(0.02, -0.03, 0.1), rpy=(0.4, -0.3, 2.0), mass=0.7, center=(0.03, 0.01, 0.06), inertia=(3e-4, 2e-4, 4e-4)
)


def task(**more: Any) -> Task:
    return Task.model_validate({"name": "handling", "targets": [[0.3, 0.1, 0.2], [0.1, 0.3, 0.3]], **more})


@pytest.mark.parametrize("arm", ARMS)
def test_tool_on_an_existing_arm_is_placed_in_its_tip_frame(arm: Any) -> None:
    held = with_tool(arm, TOOL)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_from_rpy(*TOOL.rpy), TOOL.tip
    for q in postures(arm, 3):
        expected = peer_of(arm).tip(q) @ pose
        assert np.allclose(peer_of(held).tip(q), expected, atol=1e-9)
        assert np.allclose(joint_positions(held, full(arm, q))[-1], expected[:3, 3], atol=1e-9)


def test_arms_of_a_problem_carry_the_tool_of_its_task() -> None:
    bare, tooled = (Problem(task(**more)) for more in ({}, {"tool": TOOL.model_dump()}))
    design = paper_space().sample(1, 0)[0]
    assert bare.arm(design) == paper_space().arm(design)
    assert tooled.arm(design) == paper_space().arm(design, TOOL) == with_tool(bare.arm(design), TOOL)
    assert tooled.max_reach == pytest.approx(bare.max_reach + np.linalg.norm(TOOL.tip))
    assert np.allclose(tooled.physics([design]).arms.tool.tip, TOOL.tip)
    assert tooled.arm(design).mass == pytest.approx(bare.arm(design).mass + TOOL.mass)


@pytest.mark.parametrize("arm", ARMS)
def test_mass_of_a_tool_counts_as_in_pinocchio(arm: Any) -> None:
    """Add the tool to Pinocchio's model by its own means; compare gravity, inverse dynamics and the mass matrix."""
    bare = replace(arm, tool=replace(arm.tool, mass=0.0, com=(0.0, 0.0, 0.0), inertia=NO_INERTIA))
    peer, held = peer_of(bare), with_tool(bare, TOOL)
    model = peer.model
    frame = model.frames[model.getFrameId("tip")]
    body = pinocchio.Inertia(TOOL.mass, np.array(TOOL.center), np.diag(TOOL.inertia))
    model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    peer.data = model.createData()
    arrays, rng = stack_arms([held], "float64"), np.random.default_rng(1)
    own = [number - 1 for number, _ in moving(arm)]
    for q in postures(arm, 3):
        v, a = rng.uniform(-2.0, 2.0, (2, len(q)))
        expected = pinocchio.rnea(model, peer.data, q, v, a)
        rows = [full(arm, values)[None, None] for values in (q, v, a)]
        found = inverse_dynamics(arrays, *rows, np.zeros(1))[0, 0, own]
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * load(held))
        solved = solve_postures(arrays, np.zeros((1, 3)), 0, initial_q=rows[0], precision="float64")
        assert solved.torque[0, 0, own] == pytest.approx(peer.gravity(q), rel=1e-8, abs=1e-8 * load(held))
        assert peer_of(held).gravity(q) == pytest.approx(peer.gravity(q), rel=1e-8, abs=1e-8 * load(held))
        assert peer_of(held).mass_matrix(q) == pytest.approx(peer.mass_matrix(q), rel=1e-8, abs=1e-8 * load(held))
