"""Shapes and consistency of an evaluation."""

import numpy as np
import pytest

from armwright.exceptions import ArmError, TaskError
from armwright.problem.evaluation import evaluate
from tests.support.arms import general_arms, paper_arms

TARGETS = np.array([[0.4, 0.1, 0.3], [-0.2, 0.5, 0.1], [0.0, 0.0, 3.0]])


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
