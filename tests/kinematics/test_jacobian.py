"""Manipulability and dexterity against Pinocchio, scikit-robot and a closed form."""

import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray
from skrobot.coordinates.math import manipulability

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.arms.jacobian import jacobians
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import load_task
from tests.support.arms import general_arms, moving_arms

Array = NDArray[np.float64]
SLIDING = DesignSpace.model_validate(
    {"joints": [2, 6], "joint_types": ["P", "R", "S", "O", "X"], "link_directions": ["+z", "+x"], "mount": ["ceiling"]}
)


def postures(arms: list[Arm], t: int, dof: int, seed: int = 0) -> Array:
    """(N, T, D) within the limits."""
    rng, q = np.random.default_rng(seed), np.zeros((len(arms), t, dof))
    for i, arm in enumerate(arms):
        for j, joint in enumerate(arm.joints):
            q[i, :, j] = 0.0 if joint.kind == "fixed" else rng.uniform(joint.lower, joint.upper, t)
    return q


@pytest.mark.parametrize(
    "arms", [general_arms(25, 5, 3), moving_arms(25, 1, 0), [SLIDING.arm(design) for design in SLIDING.sample(40, 1)]]
)
def test_jacobian_agrees_with_pinocchio(arms: list[Arm]) -> None:
    stacked = stack_arms(arms, "float64")
    q = postures(arms, 3, stacked.dof)
    ours, frames = jacobians(stacked, q), forward_kinematics(stacked, q)
    for i, arm in enumerate(arms):
        model = pinocchio.buildModelFromXML(to_urdf(arm))
        data = model.createData()
        moving = [j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"]
        for t in range(3):
            tip = model.getFrameId("tip")
            theirs = pinocchio.computeFrameJacobian(
                model, data, q[i, t, moving], tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )[:3]
            assert ours[i, t][:, moving] == pytest.approx(np.reshape(theirs, (3, -1)), abs=1e-9)
            assert not ours[i, t][:, [j for j in range(stacked.dof) if j not in moving]].any()
            assert frames.tip[i, t] == pytest.approx(data.oMf[tip].translation, abs=1e-9)


def test_manipulability_and_dexterity_follow_from_singular_values() -> None:
    arms = moving_arms(30, 6, 5)
    evaluation = evaluate(arms, np.random.default_rng(0).uniform(-0.6, 0.6, (4, 3)))
    for i, arm in enumerate(arms):
        model = pinocchio.buildModelFromXML(to_urdf(arm))
        data, tip = model.createData(), model.getFrameId("tip")
        for t in range(4):
            q = evaluation.q[i, t]
            j = pinocchio.computeFrameJacobian(model, data, q, tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3]
            assert evaluation.manipulability[i, t] == pytest.approx(np.sqrt(np.linalg.det(j @ j.T)), rel=1e-4, abs=1e-7)
            assert evaluation.dexterity[i, t] == pytest.approx(1.0 / np.linalg.cond(j), rel=1e-3, abs=1e-6)


def test_manipulability_agrees_with_scikit_robot() -> None:
    evaluation = evaluate(moving_arms(20, 5, 2), [[0.3, 0.2, 0.1]])
    theirs = manipulability(jacobians(evaluation.arms, evaluation.q)[:, 0])
    assert evaluation.manipulability[:, 0] == pytest.approx(theirs, rel=1e-6, abs=1e-9)


def test_planar_arm_has_the_closed_form_manipulability() -> None:
    """With a joint about z below them: w = a b |sin elbow| times the tip's distance from that axis."""
    a, b = 0.3, 0.2
    links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in (0.1, a, b))
    joints = tuple(Joint("revolute", axis, -3.1, 3.1) for axis in ("z", "y", "y"))
    whole, planar = Arm((0.0, 0.0, 0.0), joints, links), Arm((0.0, 0.0, 0.1), joints[1:], links[1:])
    evaluation = evaluate([whole], [[0.2, 0.15, 0.3], [0.3, -0.1, 0.2], [2.0, 0.1, 0.3]])
    elbow, reached = evaluation.q[0, :, 2], evaluation.reached[0]
    expected = a * b * np.abs(np.sin(elbow)) * np.hypot(reached[:, 0], reached[:, 1])
    assert evaluation.manipulability[0] == pytest.approx(expected, abs=1e-6)
    (anisotropy,) = named_objectives(["anisotropy"])
    assert anisotropy(evaluation)[0] > 0.95, "a stretched arm, which misses its target, cannot go farther"
    assert anisotropy(evaluate([planar], [[0.2, 0.0, 0.3]]))[0] == pytest.approx(1.0, abs=1e-3)


def test_anisotropy_is_of_the_worst_target_and_computed_on_demand() -> None:
    space, task = paper_space(5), load_task("shelf").model_copy(update={"reference_point": None})
    problem = Problem(task, space, objectives=named_objectives(["anisotropy", "position_error"]))
    designs = space.sample(20, 3)
    evaluation = problem.physics(designs)
    assert problem.evaluate(designs).values[:, 0] == pytest.approx((1.0 - evaluation.dexterity).max(axis=1))
    assert np.all((evaluation.dexterity >= 0.0) & (evaluation.dexterity <= 1.0))
    plain = Problem(task, space).physics(designs)
    Problem(task, space).outcomes(plain)
    assert "_singular_values" not in vars(plain)
    assert stack_designs(space, space.matrix(designs)).precision == "float32"
