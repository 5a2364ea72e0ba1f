"""Workspaces against scipy and closed forms."""

from typing import Any

import numpy as np
import pytest

from armwright.problem.arm_quantities import dexterous_volume, uncovered_fraction
from armwright.problem.evaluation import evaluate
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.spaces.design_space import paper_space
from armwright.tasks.obstacles import Box
from armwright.tasks.task import Task
from armwright.tasks.workspace import Region, sample_regions

CUBE = {"low": (0.0, 0.0, 0.0), "high": (1.0, 1.0, 1.0)}


def region(**content: Any) -> Region:
    return Region.model_validate({**CUBE, **content})


def task(**more: Any) -> Task:
    return Task.model_validate(
        {"name": "cover", "workspace": {"low": (0.2, -0.3, 0.1), "high": (0.6, 0.3, 0.5)}, **more}
    )


def test_workspace_points_lie_in_their_region() -> None:
    one, flat, spot = (
        region(points=50),
        region(low=(0.2, -1.0, 0.5), high=(0.4, 1.0, 0.5)),
        region(high=(0, 0, 0), points=3),
    )
    points = sample_regions((one, flat, spot))
    assert points.shape == (253, 3)
    assert np.array_equal(points[:50], sample_regions((one,)))
    assert np.all((points[50:250] >= flat.low) & (points[50:250] <= flat.high))
    assert np.all(points[250:] == 0.0)
    assert np.array_equal(sample_regions((region(points=10),)), points[:10]), "more points keep those that are there"


def test_two_link_arm_reaches_a_spherical_shell() -> None:
    """Two links with spherical first joints reach all distances from |a - b| to a + b."""
    a, b = 0.45, 0.25
    links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in (1e-4, a, b))
    joints = tuple(Joint("revolute", axis, -3.1, 3.1) for axis in ("z", "y", "y"))
    cube = region(low=(-0.8, -0.8, -0.8), high=(0.8, 0.8, 0.8), points=2000)
    points = sample_regions((cube,))
    far = np.linalg.norm(points, axis=1)
    evaluation = evaluate(Arm((0.0, 0.0, 0.0), joints, links), task(workspace=[cube]))
    inside = (far < a + b - 2e-4) & (far > a - b + 2e-4)
    reached = evaluation.workspace_error[0] < 1e-3
    assert not np.any(reached[(far > a + b + 2e-3) | (far < a - b - 2e-3)])
    assert reached[inside].mean() > 0.97, "but for some that the straight start does not lead to"
    volume = 4 / 3 * np.pi * ((a + b) ** 3 - (a - b) ** 3) / 1.6**3
    assert 1.0 - uncovered_fraction(evaluation)[0] == pytest.approx(volume, abs=0.03)


def test_workspace_points_are_solved_like_targets() -> None:
    problem = Problem(task(objectives=["uncovered_fraction"]))
    designs = problem.space.sample(30, 2)
    arms = [problem.arm(design) for design in designs]
    as_targets = evaluate(arms, sample_regions(problem.task.workspace))
    assert np.array_equal(problem.physics(designs).workspace_error, as_targets.position_error)
    assert problem.evaluate(designs).values[:, 0] == pytest.approx((as_targets.position_error >= 1e-3).mean(axis=1))


def test_default_targets_are_the_workspace_corners() -> None:
    found = task(workspace=[CUBE, {"low": (1, 0, 0), "high": (2, 1, 0), "points": 9}])
    assert len(found.targets) == 8 + 2, "corners that both have count once"
    assert {(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 1.0, 0.0)} <= set(found.targets)
    assert Task.model_validate(found.model_dump(mode="json")) == found
    assert task(targets=[(0.5, 0.0, 0.3)]).targets == ((0.5, 0.0, 0.3),)


CONE: dict[str, Any] = {"axis": (0, 0, 1), "half_angle": 0.6, "count": 9, "share": 0.5}


def test_points_behind_an_obstacle_are_not_dexterous() -> None:
    """A rod on three slides reaches all points of a box, those above a plate only where the plate is not in its way."""
    joints = tuple(Joint("prismatic", axis, -0.5, 0.5) for axis in ("x", "y", "z"))
    short, rod = (uniform_link((0.0, 0.0, length), mass=0.1, radius=0.01) for length in (1e-4, 0.3))
    gantry = Arm((0.0, 0.0, 0.0), joints, (short, short, rod))
    up = {"axis": (0, 0, 1), "half_angle": 0.0, "count": 1}
    box = region(low=(-0.3, -0.3, 0.31), high=(0.3, 0.3, 0.6), points=300, directions=up)
    plate = Box(kind="box", center=(0.25, 0.0, 0.405), size=(0.5, 2.0, 0.01))
    points = sample_regions((box,))
    gap = np.hypot(np.maximum(-points[:, 0], 0.0), np.maximum(0.4 - points[:, 2], 0.0)) - rod.radius
    assert 0.2 < (gap > 0.0).mean() < 0.8
    assert dexterous_volume(evaluate(gantry, task(workspace=[box])))[0] == 1.0
    behind = evaluate(gantry, task(workspace=[box], obstacles=[plate]))
    assert (gap > 1e-3).mean() <= dexterous_volume(behind)[0] <= (gap > -1e-3).mean()  # reached within 1 mm
    around = Box(kind="box", center=(0.0, 0.0, 0.45), size=(1.0, 1.0, 0.4))
    assert dexterous_volume(evaluate(gantry, task(workspace=[box], obstacles=[around])))[0] == 0.0


def test_tasks_bound_and_minimise_directions_of_the_tool() -> None:
    box = {"low": (-0.3, -0.3, 0.1), "high": (0.3, 0.3, 0.4), "points": 10, "directions": CONE}
    asked = task(workspace=box, objectives=["undexterous_fraction", "length"], constraints=["dexterous_volume >= 0.5"])
    assert Task.model_validate(asked.model_dump(mode="json")) == asked
    problem = Problem(asked, paper_space(6))
    outcomes = problem.evaluate(problem.space.sample(5, 3))
    fraction = outcomes.values[:, 0]
    assert np.all((fraction >= 0.0) & (fraction <= 1.0))
    assert np.array_equal(outcomes.violations[:, 0] > 0.0, 1.0 - fraction < 0.5)
