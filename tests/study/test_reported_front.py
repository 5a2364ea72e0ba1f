"""The designs that direct searches report."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armwright import DesignSpace, FrontRun, Problem, Task, find_front
from armwright.exceptions import TaskError
from armwright.pareto import front_mask, hypervolume
from armwright.problem.reduction import reduced
from armwright.runs.config import RunConfig
from armwright.runs.folder import read_config
from armwright.study.front.reported_front import reported_front
from tests.support.arms import LIGHT

EVALUATIONS = 600
SPACE = {
    "name": "plane",
    "joints": [2, 5],
    "origin_y": [0.0, 0.0],
    "joint_types": ["P", "Y"],
    "link": [0.05, 0.3],
    **LIGHT,
    "actuators": ["XL430-W250", "XC430-W240"],
}


def problem(**update: Any) -> Problem:
    """Arms that never leave the plane of their targets, so that their yaw joints are idle."""
    content: dict[str, Any] = {
        "name": "plane",
        "targets": [[0.3, 0.0, 0.2], [0.2, 0.0, 0.35]],
        "objectives": ["worst_error", "price"],
        "reference_point": [1.0, 1000.0],
        **update,
    }
    return Problem(Task.model_validate(content), DesignSpace.model_validate(SPACE))


def test_no_reported_design_is_worse_than_itself_without_an_idle_joint() -> None:
    plane = problem()
    matrix = plane.space.matrix(plane.space.sample(300, 0))
    values = plane.evaluate(matrix).penalised
    kept = front_mask(values) & np.all(values < (1.0, 1000.0), axis=1)
    front = reported_front(plane, matrix[kept], values[kept], (1.0, 1000.0), 300)
    fewer = {row.tobytes() for row in front.matrix} - {row.tobytes() for row in matrix}
    assert fewer, "some reduced designs are reported"
    assert front_mask(front.values).all()
    assert np.array_equal(plane.evaluate(front.matrix).penalised, front.values)
    candidates = plane.evaluate(reduced(plane, front.matrix)).penalised
    for candidate in candidates:
        assert not np.any(np.all(candidate <= front.values, axis=1) & np.any(candidate < front.values, axis=1))
    assert hypervolume(front.values, (1.0, 1000.0)) > hypervolume(values, (1.0, 1000.0))


@pytest.fixture(scope="module")
def fine() -> FrontRun:
    return find_front(problem(resolution={"worst_error": 1e-9, "price": 1e-9}), evaluations=EVALUATIONS, seed=0)


@pytest.mark.parametrize("resolution", [{"worst_error": 0.05, "price": 30.0}, {"price": 200.0}])
def test_reported_designs_differ_by_the_resolution(
    resolution: dict[str, float], fine: FrontRun, tmp_path: Path
) -> None:
    run = find_front(problem(resolution=resolution), evaluations=EVALUATIONS, seed=0, out=tmp_path)
    assert len(run.history) < len(fine.history)
    assert run.history.values.min(axis=0).tolist() == fine.history.values.min(axis=0).tolist()
    assert run.summary["hypervolume"]["final"] == pytest.approx(fine.summary["hypervolume"]["final"])
    config = read_config(tmp_path)
    assert dict(config.task.resolution) == resolution
    assert RunConfig.model_validate(config.model_dump(mode="json")) == config


def test_resolutions_are_of_objectives_of_the_task() -> None:
    with pytest.raises(TaskError, match=r'"pric" is not an objective of the task .*Did you mean "price"\?'):
        problem(resolution={"pric": 5.0})
