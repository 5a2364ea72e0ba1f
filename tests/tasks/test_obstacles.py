"""Obstacles in task files, prompts, figures and the page."""

from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from playwright.sync_api import Browser

from armwright.exceptions import TaskError
from armwright.page.page import write_report
from armwright.problem.arm_quantities import CLEARANCES, FAR
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.proof.verification import verify
from armwright.study.study import optimize
from armwright.tasks.task import Task
from armwright.yaml_documents import parse_document
from tests.support.browser import Tab

RECORDS: list[dict[str, Any]] = [
    {"kind": "ground", "name": "table", "z": -0.1},
    {"kind": "box", "name": "shelf", "center": [0.4, 0.1, 0.3], "size": [0.2, 0.5, 0.04], "rpy": [0.3, -0.2, 0.5]},
    {"kind": "sphere", "center": [0.2, -0.3, 0.2], "radius": 0.1},
    {"kind": "cylinder", "name": "pole", "center": [0.3, 0.0, 0.1], "radius": 0.03, "height": 0.4, "axis": [1, 2, 2]},
]
POINTS = [[0.4, 0.2, 0.1], [0.4, -0.2, 0.1], [0.3, 0.1, 0.5]]
DESCRIPTIONS = [
    "table: ground, solid everywhere below z = -0.1 m",
    "shelf: box of 0.2 x 0.5 x 0.04 m (along x, y, z) about (0.4, 0.1, 0.3), turned by roll, pitch, yaw "
    "(0.3, -0.2, 0.5) rad",
    "sphere of radius 0.1 m about (0.2, -0.3, 0.2)",
    "pole: cylinder of radius 0.03 m and height 0.4 m about (0.3, 0, 0.1), its axis along (1, 2, 2)",
]


def task_of(records: Sequence[object], **more: object) -> Task:
    content = {"name": "way", "targets": POINTS, "obstacles": [copy(record) for record in records], **more}
    return parse_document(yaml.safe_dump(content), Task, TaskError, "way.yaml")


def test_valid_obstacles_are_accepted() -> None:
    task = task_of(RECORDS)
    assert [obstacle.describe() for obstacle in task.obstacles] == DESCRIPTIONS
    assert task_of(task.model_dump(mode="json")["obstacles"]) == task
    assert Task(name="none", targets=((0.0, 0.0, 0.0),)).obstacles == ()
    yawed = task_of([{"kind": "box", "center": [0, 0, 0], "size": [1, 1, 1], "yaw": 0.5}]).obstacles[0]
    assert yawed.describe() == "box of 1 x 1 x 1 m (along x, y, z) about (0, 0, 0), turned by yaw 0.5 rad"


def test_objectives_of_clearance() -> None:
    task = task_of(RECORDS, objectives=["collision", "clearance_shortfall"])
    problem = Problem(task)
    designs = problem.space.sample(40, 3)
    evaluation, values = problem.physics(designs), problem.evaluate(designs).values
    free = evaluation.clearance
    assert np.any(free < 0.0)
    assert np.any(free.min(axis=1) > 0.0)
    for row in range(40):
        assert values[row, 0] == pytest.approx(sum(max(0.0, -at) for at in free[row]))
        assert values[row, 1] == pytest.approx(max(max(0.0, 0.1 - at) for at in free[row]))
    assert np.array_equal(problem.evaluate(problem.space.matrix(designs)).values, values)
    for quantity in CLEARANCES:
        least = getattr(evaluation, quantity.name).min(axis=1)
        assert np.array_equal(quantity(evaluation), np.minimum(least, FAR))
    assert np.any(verify(problem, problem.space.matrix(designs), values, (1.0, 1.0)).robust)
    alone = Problem(
        Task(name="alone", targets=task.targets), objectives=named_objectives(["collision", "clearance_shortfall"])
    )
    assert np.all(np.isfinite(alone.evaluate(designs).values))
    assert np.all(alone.evaluate(designs).values <= values)


def test_page_draws_obstacles_in_place(tmp_path: Path, browser: Browser) -> None:
    task = task_of(RECORDS, objectives=["worst_error", "clearance_shortfall"])
    optimize(Problem(task), proposer="none", sampler="random", n_init=4, n_total=6, out=tmp_path, verify=False)
    write_report(tmp_path)
    tab = Tab(browser, offline=True)
    try:
        tab.open(tmp_path / "report.html")
        parts = [np.array(part) for part in tab.ask("armwright.drawn('obstacle')")]
        assert "obstacle" in tab.text("#arm-legend")
        assert all(words in tab.text("#design-note") for words in DESCRIPTIONS)
        assert not tab.faults
    finally:
        tab.close()
    solids = [obstacle.solid for obstacle in task.obstacles]
    plate, edge, box, box_edges, ball, bar, rims = parts
    assert plate[:, 2].max() == pytest.approx(-0.1, abs=1e-6)
    assert edge[:, 2] == pytest.approx(-0.1)

    def own(part: np.ndarray, number: int) -> np.ndarray:
        """In the obstacle's own frame, in units of its half sides."""
        return (part - solids[number].centre) @ solids[number].rotation / solids[number].half

    for part in (box, box_edges):
        corners = {tuple(np.sign(row)) for row in own(part, 1) if np.all(np.abs(np.abs(row) - 1.0) < 1e-5)}
        assert len(corners) == 8
        assert np.abs(own(part, 1)).max() == pytest.approx(1.0, abs=1e-5)
    assert np.linalg.norm(own(ball, 2), axis=1) == pytest.approx(1.0, abs=1e-5)
    for part in (bar, rims):
        x, y, z = own(part, 3).T
        across = np.hypot(x, y)
        assert np.all((np.abs(across - 1.0) < 1e-5) | (across < 1e-5))
        assert np.abs(z) == pytest.approx(1.0, abs=1e-5)


def test_signed_distances_are_those_of_the_kernels() -> None:
    """The end of a link at a target is as far from an obstacle as its clearance says, for a link that points at it."""
    boxes = [
        {"kind": "box", "center": [0.4, 0.1, 0.5], "size": [0.3, 0.2, 0.1], "rpy": [0.3, 0.5, -0.4]},
        {"kind": "cylinder", "center": [0.4, 0.1, 0.5], "radius": 0.1, "height": 0.3, "axis": [1, 2, 1]},
        {"kind": "sphere", "center": [0.4, 0.1, 0.5], "radius": 0.2},
    ]
    for obstacle in boxes:
        task = Task.model_validate({"name": "one", "targets": [[0.4, 0.1, 0.3]], "obstacles": [obstacle]})
        problem = Problem(task)
        physics = problem.physics(problem.space.sample(200, 0))
        at_tip = task.obstacles[0].solid.signed_distance(physics.reached[:, 0])
        bound = at_tip - problem.space.tube_values("radius")[0]
        assert (physics.obstacle_clearance[:, 0] <= bound + 1e-5).all()
        assert np.isclose(physics.obstacle_clearance[:, 0], bound, atol=1e-5).sum() > 10  # where the tip is nearest
