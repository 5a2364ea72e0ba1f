"""The branches of designs: of an arm with four of them, in a task where some are blocked."""

from typing import Any

import numpy as np

import armwright as aw
from armwright.problem.branches import Branches, branches_of
from tests.proof.test_cycle_faults import SIDES, SWEEP

SPACE: dict[str, Any] = {
    "name": "turntable",
    "joints": 3,
    "restrict": {"joint_1": "Y", "joint_2": "P", "joint_3": "P"},
    "link": [0.35, 0.35],
    "origin_x": [0.0, 0.0],
    "origin_y": [0.0, 0.0],
    "origin_z": [0.0, 0.0],
}


def found(limit: float = 2.8, **more: Any) -> tuple[aw.Problem, Branches]:
    content = {"name": "driven", "targets": SIDES, "cycle": SWEEP, "objectives": ["torque"], **more}
    space = aw.DesignSpace.model_validate({**SPACE, "joint_range": [-limit, limit]})
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


def test_other_way_through_an_obstacle_is_said_to_collide() -> None:
    """A table leaves the elbow above; the joints do not turn far enough to reach behind."""
    table = {"kind": "box", "name": "table", "center": [0.5, 0.0, 0.05], "size": [0.6, 2.0, 0.2]}
    _, branches = found(limit=2.46, obstacles=[table])
    assert branches.found == [2, 2]
    assert "collision <= 0" in branches.why


def test_tasks_without_a_cycle_have_none() -> None:
    problem = aw.Problem(aw.load_task("target-1"))
    assert branches_of(problem, problem.space.matrix(problem.space.sample(1, 0)), None) == []
