"""The branches of designs: of an arm with four of them, in a task where some are blocked."""

from typing import Any

import numpy as np

import armwright as aw
from armwright.problem.branches import Branches, branches_of
from tests.proof.test_cycle_faults import POST, SIDES, SWEEP

SPACE: dict[str, Any] = {
    "name": "turntable",
    "joints": 3,
    "restrict": {"joint_1": "Y", "joint_2": "P", "joint_3": "P"},
    "joint_range": [-2.8, 2.8],
    "link": [0.35, 0.35],
    "origin_x": [0.0, 0.0],
    "origin_y": [0.0, 0.0],
    "origin_z": [0.0, 0.0],
}


def found(**more: Any) -> tuple[aw.Problem, Branches]:
    content = {"name": "driven", "targets": SIDES, "cycle": SWEEP, "objectives": ["torque"], **more}
    space = aw.DesignSpace.model_validate(SPACE)
    problem = aw.Problem(aw.Task.model_validate(content), space)
    matrix = problem.space.matrix(problem.space.sample(1, 0))
    (branches,) = branches_of(problem, matrix, problem.evaluate(matrix).entry)
    return problem, branches


def test_other_way_is_another_solution_of_the_same_poses() -> None:
    problem, branches = found()
    assert branches.steps == [1, 2]
    assert branches.found == [4, 4]  # shoulder before or behind, elbow up or down
    matrix = problem.space.matrix(problem.space.sample(1, 0))
    assert branches.other is not None
    assert np.abs(np.subtract(branches.other, branches.taken)).max() > 0.5
    evaluation = problem.physics(matrix, entry=np.array(branches.other)[None, None])
    assert not evaluation.unreached.any()
    torque, other = (
        problem.physics(matrix, entry=np.array(q)[None, None]).joint_torques for q in (branches.taken, branches.other)
    )
    assert np.abs(torque).sum() <= np.abs(other).sum() + 1e-6
    assert str(branches).startswith("branches where joint motions end: 4 in step 1, 4 in step 2; the best other way, ")


def test_what_the_other_way_violates_is_named() -> None:
    """A post between the targets lets an arm pass that leans backwards over its base, with its elbow on either side."""
    _, branches = found(obstacles=[POST])
    way = "the best other way, with another branch in steps 1, 2, "
    assert branches.why == f"{way}has torque 1.782 instead of 1.646 N m x 40"
    _, branches = found(obstacles=[POST], constraints=["torque <= 1.7"])
    assert branches.why == f"{way}violates torque <= 1.7 (1.782 N m x 40)"


def test_tasks_without_a_cycle_have_none() -> None:
    problem = aw.Problem(aw.load_task("target-1"))
    assert branches_of(problem, problem.space.matrix(problem.space.sample(1, 0)), None) == []
