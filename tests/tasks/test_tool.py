"""Tools of tasks, on designs and on existing arms."""

from typing import Any

import numpy as np
import pytest

from armwright.kinematics.forward import joint_positions
from armwright.problem.problem import Problem
from armwright.rotations import rotation_from_rpy
from armwright.spaces.design_space import paper_space
from armwright.spaces.tool_mount import with_tool
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from tests.support.exported_arms import ARMS, full, peer_of, postures

TOOL = Tool(tip=(0.02, -0.03, 0.1), rpy=(0.4, -0.3, 2.0))


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
    assert np.allclose(tooled.physics([design]).arms.tip, TOOL.tip)


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        ([0.0, 0.0, 0.1], r"expected a record such as \{tip: \[0, 0, 0.1\]\}"),
        ({"tipp": [0.0, 0.0, 0.1]}, 'Did you mean "tip"?'),
        ({"tip": [0.0, 0.0]}, "tool: tip"),
        ({"tip": [0.0, 0.0, 100.0e3]}, "tool: tip"),
        ({"rpy": [0.0, 0.0, 180.0]}, "tool: rpy"),
    ],
)
def test_invalid_tool_is_refused(tool: object, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("?", r"\?")):
        task(tool=tool)
