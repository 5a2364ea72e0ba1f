"""Shapes and consistency of an evaluation."""

from typing import Any

import numpy as np
import pytest

from armwright.exceptions import ArmError, TaskError
from armwright.problem.evaluation import evaluate
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.catalogue import load_task
from tests.support import reference_kinematics as reference
from tests.support.arms import general_arms, paper_arms

TARGETS = np.array([[0.4, 0.1, 0.3], [-0.2, 0.5, 0.1], [0.0, 0.0, 3.0]])


def test_evaluation_arrays_have_documented_shapes() -> None:
    result = evaluate(paper_arms(5, 4, 31), TARGETS)
    assert len(result) == 5
    assert result.targets.shape == (3, 3)
    assert result.q.shape == result.joint_torques.shape == (5, 3, 4)
    assert result.reached.shape == (5, 3, 3)
    assert result.position_error.shape == (5, 3)
    assert {a.dtype for a in (result.q, result.reached, result.position_error, result.joint_torques)} == {
        np.dtype(float)
    }


def test_position_error_is_the_distance_from_the_target() -> None:
    """Unreachable targets also give a result, not an exception."""
    result = evaluate(paper_arms(50, 4, 32), TARGETS)
    assert np.allclose(result.position_error, np.linalg.norm(result.reached - TARGETS, axis=-1), atol=1e-12)
    assert np.all(result.position_error[:, 2] > 0.5)


def test_fixed_joints_have_columns_of_zeros() -> None:
    """Every joint has a column, in the arm's order; only moving joints have values."""
    fixed, turn = Joint("fixed", "x"), Joint("revolute", "y", -2.0, 2.0)
    joints = (fixed, turn, fixed, Joint("revolute", "x", -2.0, 2.0), fixed)
    arm = Arm((0.0, 0.0, 0.0), joints, (uniform_link((0.0, 0.05, 0.2), 0.3, 0.015),) * 5)
    result = evaluate([arm], TARGETS)
    for values in (result.q, result.joint_torques):
        assert not values[..., [0, 2, 4]].any()
        assert values[..., [1, 3]].any(axis=(0, 1)).all()
    chains = reference.chains([arm])
    assert np.abs(reference.tip(chains, result.q[..., [1, 3]]) - result.reached).max() < 1e-5
    assert (
        np.abs(reference.gravity_torque(chains, result.q[..., [1, 3]]) - result.joint_torques[..., [1, 3]]).max() < 1e-4
    )


def test_joint_limits_hold_exactly() -> None:
    """A float64 reader sees no value beyond the limit: 2.4 rad is 2.4 rad."""
    arms = general_arms(500, 4, 33)
    q = evaluate(arms, TARGETS).q
    lower, upper = (np.array([[getattr(j, end) for j in arm.joints] for arm in arms]) for end in ("lower", "upper"))
    assert np.all(lower[:, None] <= q)
    assert np.all(q <= upper[:, None])
    assert np.abs(evaluate(paper_arms(500, 4, 33), TARGETS).q).max() <= 2.4


@pytest.mark.parametrize("targets", [np.zeros((0, 3)), np.zeros((2, 2)), np.zeros(3), np.array([[0.0, np.nan, 1.0]])])
def test_invalid_targets_are_refused(targets: np.ndarray) -> None:
    with pytest.raises(TaskError, match=r"finite numbers of shape \(T, 3\)"):
        evaluate(paper_arms(1, 4, 37), targets)


def test_evaluation_of_no_arms_is_empty() -> None:
    with pytest.raises(ArmError, match="expected at least one arm"):
        evaluate([], TARGETS)


@pytest.mark.parametrize(
    "links",
    [
        {"mass": {"kind": "per_metre"}},
        {"mass": {"kind": "per_link", "kg": 0.002}},
        {"link_section": {"tubes": [[0.03, 0.002]], "material": "aluminium"}},
    ],
)
@pytest.mark.parametrize("joints", [1, 4, 8])
def test_matrix_evaluation_equals_design_evaluation(joints: int, links: dict[str, Any]) -> None:
    space = DesignSpace.model_validate({"joints": joints, **links, "joint_types": ("Y", "R")})
    problem = Problem(load_task("target-2"), space)
    designs = space.sample(200, seed=joints)
    matrix = space.matrix(designs)
    assert matrix.shape == (200, 2 * joints + 3)
    assert space.designs(matrix) == designs
    assert problem.evaluate(matrix).values.tolist() == problem.evaluate(designs).values.tolist()
