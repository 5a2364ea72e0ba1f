"""Arms in tasks, as `aw.evaluate` and `aw.to_mjcf` take them."""

import mujoco
import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.problem.evaluation import Evaluation

JOB = aw.Task.model_validate(
    {
        "name": "job",
        "targets": [
            {"position": [0.35, 0.1, 0.2], "axis": [0.0, 0.0, -1.0], "name": "tray"},
            {"position": [0.3, -0.2, 0.3], "axis": [0.0, 0.0, -1.0]},
        ],
        "tool": {"tip": [0.0, 0.0, 0.08], "mass": 0.2, "center": [0.0, 0.0, 0.03]},
        "payload": 0.3,
        "obstacles": [{"kind": "cylinder", "name": "pole", "center": [0.2, 0.3, 0.5], "radius": 0.03, "height": 1.0}],
        "cycle": {"closed": False, "steps": [{"to": "tray", "time": 1.0}, {"to": 2, "time": 1.0}]},
    }
)
SPACE = aw.paper_space(joints=5)
PROBLEM = aw.Problem(JOB, SPACE)
DESIGNS = SPACE.sample(3, seed=0)


def assert_equal(one: Evaluation, other: Evaluation) -> None:
    """Postures, torques, clearances and paths are equal to the bit."""
    for name in ("q", "reached", "angle_error", "joint_torques", "payload", "clearance"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    assert np.array_equal(one.paths.path_error, other.paths.path_error)


def test_evaluation_in_a_task_is_that_of_the_problem() -> None:
    physics = PROBLEM.physics(DESIGNS)
    arms = [PROBLEM.arm(design) for design in DESIGNS]
    assert_equal(aw.evaluate(arms, JOB), physics)
    assert_equal(aw.evaluate(arms[1], JOB), PROBLEM.physics([DESIGNS[1]]))


def test_task_brings_its_tool_to_arms_that_carry_none() -> None:
    bare = [SPACE.arm(design) for design in DESIGNS]
    assert_equal(aw.evaluate(bare, JOB), PROBLEM.physics(DESIGNS))
    turned = JOB.model_copy(update={"tool": aw.Task.model_validate(
        {"name": "turned", "targets": [[0.3, 0.0, 0.2]], "tool": {"rpy": [0.0, 1.5, 0.0]}}
    ).tool})  # fmt: skip
    problem = aw.Problem(turned, SPACE)
    assert_equal(aw.evaluate([problem.arm(design) for design in DESIGNS], turned), problem.physics(DESIGNS))


def test_task_goes_alone() -> None:
    with pytest.raises(SettingsError, match="expected a task alone, got a payload"):
        aw.evaluate(PROBLEM.arm(DESIGNS[0]), JOB, payload=0.0)


def test_positions_may_come_with_one_arm() -> None:
    arm = SPACE.arm(DESIGNS[0])
    assert np.array_equal(aw.evaluate(arm, [[0.3, 0.0, 0.2]]).q, aw.evaluate([arm], [[0.3, 0.0, 0.2]]).q)


def test_model_of_an_arm_in_a_task_has_tool_payload_obstacles_and_postures() -> None:
    bare = SPACE.arm(DESIGNS[0])
    text = aw.to_mjcf(bare, JOB, name="mine")
    assert text == aw.to_mjcf(PROBLEM.arm(DESIGNS[0]), JOB, name="mine")
    model = mujoco.MjModel.from_xml_string(text)
    assert model.body("payload").mass == pytest.approx(0.3)
    assert model.geom("obstacle_pole").size[0] == pytest.approx(0.03)
    assert sum(model.body_mass) == pytest.approx(
        sum(mujoco.MjModel.from_xml_string(aw.to_mjcf(bare)).body_mass) + 0.2 + 0.3, rel=1e-6
    )
    data = mujoco.MjData(model)
    evaluation = aw.evaluate(bare, JOB)
    for target, name in enumerate(JOB.target_names):
        mujoco.mj_resetDataKeyframe(model, data, model.keyframe(name).id)
        mujoco.mj_forward(model, data)
        assert data.site("tip").xpos == pytest.approx(evaluation.reached[0, target], abs=1e-5)
