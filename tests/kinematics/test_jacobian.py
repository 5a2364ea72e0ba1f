"""Manipulability and dexterity against Pinocchio."""

import numpy as np
import pytest
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics, jacobian_of
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import load_task
from tests.support.arms import general_arms, moving_arms
from tests.support.exported_arms import peer_of

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
    frames = forward_kinematics(stacked, q)
    ours = jacobian_of(stacked, frames)
    for i, arm in enumerate(arms):
        peer = peer_of(arm)
        moving = [j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"]
        for t in range(3):
            assert ours[i, t][:, moving] == pytest.approx(peer.jacobian(q[i, t, moving])[:3], abs=1e-9)
            assert not ours[i, t][:, [j for j in range(stacked.dof) if j not in moving]].any()
            assert frames.tip[i, t] == pytest.approx(peer.tip(q[i, t, moving])[:3, 3], abs=1e-9)


def test_manipulability_and_dexterity_follow_from_singular_values() -> None:
    arms = moving_arms(30, 6, 5)
    evaluation = evaluate(arms, np.random.default_rng(0).uniform(-0.6, 0.6, (4, 3)))
    for i, arm in enumerate(arms):
        for t in range(4):
            j = peer_of(arm).jacobian(evaluation.q[i, t])[:3]
            assert evaluation.manipulability[i, t] == pytest.approx(np.sqrt(np.linalg.det(j @ j.T)), rel=1e-4, abs=1e-7)
            assert evaluation.dexterity[i, t] == pytest.approx(1.0 / np.linalg.cond(j), rel=1e-3, abs=1e-6)


def test_anisotropy_is_of_the_worst_target() -> None:
    space, task = paper_space(5), load_task("shelf").model_copy(update={"reference_point": None})
    problem = Problem(task, space, objectives=named_objectives(["anisotropy", "position_error"]))
    designs = space.sample(20, 3)
    evaluation = problem.physics(designs)
    assert problem.evaluate(designs).values[:, 0] == pytest.approx((1.0 - evaluation.dexterity).max(axis=1))
    assert np.all((evaluation.dexterity >= 0.0) & (evaluation.dexterity <= 1.0))
