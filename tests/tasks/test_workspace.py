"""Workspaces against scipy and closed forms."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import qmc
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import SettingsError, TaskError
from armwright.kinematics.ik.solve import solve
from armwright.problem.evaluation import Evaluation, evaluate
from armwright.problem.objectives import DEXTEROUS_VOLUME, OBJECTIVES, UNCOVERED_FRACTION, UNDEXTEROUS_FRACTION
from armwright.problem.problem import Outcomes, Problem
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.rotations import cone_directions
from armwright.spaces.design_space import paper_space
from armwright.tasks.catalogue import load_task, random_task
from armwright.tasks.obstacles import Box
from armwright.tasks.task import Task
from armwright.tasks.workspace import Region, sample_regions
from armwright.yaml_documents import parse_document

Array = NDArray[np.float64]
CUBE = {"low": (0.0, 0.0, 0.0), "high": (1.0, 1.0, 1.0)}


def region(**content: Any) -> Region:
    return Region.model_validate({**CUBE, **content})


def task(**more: Any) -> Task:
    return Task.model_validate(
        {"name": "cover", "workspace": {"low": (0.2, -0.3, 0.1), "high": (0.6, 0.3, 0.5)}, **more}
    )


# The points


def radical_inverse(number: int, base: int) -> float:
    """Return the digits of a number in reverse order behind the point (Halton 1960)."""
    return 0.0 if number == 0 else (number % base + radical_inverse(number // base, base)) / base


def test_workspace_points_are_halton_points() -> None:
    expected = [[radical_inverse(i, base) for base in (2, 3, 5)] for i in range(1, 3001)]
    assert sample_regions((region(points=3000),)) == pytest.approx(np.array(expected))
    by_chance = np.mean([qmc.discrepancy(np.random.default_rng(i).random((200, 3))) for i in range(10)])
    assert qmc.discrepancy(sample_regions((region(points=200),))) < 0.2 * by_chance


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


# What is reached


def test_two_link_arm_reaches_a_spherical_shell() -> None:
    """Two links with spherical first joints reach all distances from |a - b| to a + b."""
    a, b = 0.45, 0.25
    links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in (1e-4, a, b))
    joints = tuple(Joint("revolute", axis, -3.1, 3.1) for axis in ("z", "y", "y"))
    cube = region(low=(-0.8, -0.8, -0.8), high=(0.8, 0.8, 0.8), points=2000)
    points = sample_regions((cube,))
    far = np.linalg.norm(points, axis=1)
    evaluation = evaluate([Arm((0.0, 0.0, 0.0), joints, links)], [[0.3, 0.2, 0.1]], workspace=[cube])
    inside = (far < a + b - 2e-4) & (far > a - b + 2e-4)
    reached = evaluation.workspace_error[0] < 1e-3
    assert not np.any(reached[(far > a + b + 2e-3) | (far < a - b - 2e-3)])
    assert reached[inside].mean() > 0.97, "but for some that the straight start does not lead to"
    volume = 4 / 3 * np.pi * ((a + b) ** 3 - (a - b) ** 3) / 1.6**3
    assert 1.0 - UNCOVERED_FRACTION(evaluation)[0] == pytest.approx(volume, abs=0.03)


def test_workspace_points_are_solved_like_targets() -> None:
    problem = Problem(task(objectives=["uncovered_fraction"]))
    designs = problem.space.sample(30, 2)
    arms = [problem.arm(design) for design in designs]
    as_targets = evaluate(arms, sample_regions(problem.task.workspace))
    assert np.array_equal(problem.physics(designs).workspace_error, as_targets.position_error)
    assert problem.evaluate(designs).values[:, 0] == pytest.approx((as_targets.position_error >= 1e-3).mean(axis=1))


def test_longer_arms_cover_at_least_as_much() -> None:
    """Scaling arm and workspace together changes nothing."""
    space = paper_space(5)
    small = [space.arm(design) for design in space.sample(40, 1)]
    large = [
        Arm(
            tuple(2 * x for x in arm.base),
            arm.joints,
            tuple(uniform_link((0, 0, 2 * link.length), 0.1, 0.01) for link in arm.links),
        )
        for arm in small
    ]
    boxes = [region(low=(-k * 0.4,) * 3, high=(k * 0.4,) * 3) for k in (1, 2)]
    one, other = (
        evaluate(arms, [[0.1, 0.2, 0.3]], workspace=[box]) for box, arms in zip(boxes, (small, large), strict=True)
    )
    points = sample_regions((boxes[0],))
    reach = np.array([arm.reach for arm in small])
    beyond = np.linalg.norm(points - np.array([arm.base for arm in small])[:, None], axis=-1) > reach[:, None] + 1e-3
    for evaluation in (one, other):
        assert np.all(evaluation.workspace_error[beyond] >= 1e-3)
    assert UNCOVERED_FRACTION(one).mean() == pytest.approx(UNCOVERED_FRACTION(other).mean(), abs=0.02)


def test_workspace_is_computed_on_demand() -> None:
    designs = paper_space().sample(10, 0)
    target_1 = load_task("target-1")
    with_ = target_1.model_copy(update={"workspace": task().workspace})
    evaluation = Problem(with_).physics(designs)
    assert np.array_equal(Problem(with_).outcomes(evaluation).values, Problem(target_1).evaluate(designs).values)
    assert "workspace_error" not in vars(evaluation)
    assert not Problem(with_).uses(UNCOVERED_FRACTION)
    assert Problem(task(), objectives=(UNCOVERED_FRACTION,)).uses(UNCOVERED_FRACTION)


def test_no_workspace_means_nothing_uncovered() -> None:
    with pytest.raises(SettingsError, match="uncovered_fraction needs a workspace in the task; try workspace: "):
        Problem(
            random_task(1).model_copy(update={"reference_point": None}), objectives=(OBJECTIVES["uncovered_fraction"],)
        ).evaluate(paper_space().sample(1, 0))


def test_large_batches_equal_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem(task(objectives=["uncovered_fraction", "torque"]))
    designs = problem.space.sample(30, 5)
    values = problem.evaluate(designs).values
    sizes: list[int] = []
    outcomes_of = Problem.outcomes

    def counted(self: Problem, evaluation: Evaluation, *measured: Mapping[str, Array]) -> Outcomes:
        sizes.append(len(evaluation))
        return outcomes_of(self, evaluation, *measured)

    monkeypatch.setattr("armwright.problem.problem.POSTURES_AT_ONCE", {"cpu": 1000})
    monkeypatch.setattr(Problem, "outcomes", counted)
    assert np.array_equal(problem.evaluate(problem.space.matrix(designs)).values, values)
    assert max(sizes) * (200 + 8) <= 1000


# From the file on


def test_default_targets_are_the_workspace_corners() -> None:
    found = task(workspace=[CUBE, {"low": (1, 0, 0), "high": (2, 1, 0), "points": 9}])
    assert len(found.targets) == 8 + 2, "corners that both have count once"
    assert {(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 1.0, 0.0)} <= set(found.targets)
    assert Task.model_validate(found.model_dump(mode="json")) == found
    assert task(targets=[(0.5, 0.0, 0.3)]).targets == ((0.5, 0.0, 0.3),)


FAULTS = {
    "{low: [0, 0, 0.5], high: [1, 1, 0.4]}": "workspace: expected low z <= high z, got 0.5 m and 0.4 m",
    "{low: [0, 0], high: [1, 1, 1]}": "workspace.*low",
    "{low: [0, 0, 0]}": "workspace.*high",
    "{low: [0, 0, 0], high: [1, 1, 1], points: 0}": "points",
    "{low: [0, 0, 0], high: [1, 1, 1], point: 9}": "point",
    "{low: [0, 0, 0], high: [1, 1, 2000]}": "high",
    "[[0, 0, 0], [1, 1, 1]]": "workspace",
    "everything": r"workspace: expected \{low: \[x, y, z\], high",
    "[]": "targets",
    "[{low: [0, 0, 0], high: [1, 1, 1], points: 6000}, {low: [0, 0, 0], high: [1, 1, 1], points: 6000}]": "10000",
}


@pytest.mark.parametrize("written", FAULTS)
def test_invalid_workspaces_are_refused_in_one_line(written: str) -> None:
    text = f"name: x\nworkspace: {written}"
    with pytest.raises(TaskError, match=FAULTS[written]) as refused:
        parse_document(text, Task, TaskError, "it.yaml")
    assert "\n" not in str(refused.value)


def test_targets_allow_an_empty_workspace() -> None:
    text = "name: x\ntargets: [[0.1, 0.2, 0.3]]\nworkspace: []"
    assert parse_document(text, Task, TaskError, "it").workspace == ()


def test_too_many_boxes_are_refused() -> None:
    with pytest.raises(ValueError, match="should have at most 20 items after validation, not 21"):
        task(workspace=[CUBE] * 21)


@pytest.mark.slow
def test_covering_a_box_from_the_command_line(in_folder: Path) -> None:
    (in_folder / "cover.yaml").write_text(
        "name: cover\nworkspace: {low: [0.2, -0.3, 0.1], high: [0.5, 0.3, 0.4], points: 60}\n"
        "objectives: [uncovered_fraction, torque]\n",
        encoding="utf-8",
    )
    told = CliRunner().invoke(app, ["optimize", "cover.yaml", "--n-total", "20", "--out", "run"])
    assert told.exit_code == 0, told.output
    shown = CliRunner().invoke(app, ["tasks", "cover.yaml"]).output
    assert "workspace: box from (0.2, -0.3, 0.1) to (0.5, 0.3, 0.4), 60 points" in shown
    told = CliRunner().invoke(
        app, ["optimize", "cover.yaml", "--objectives", "torque", "--n-total", "2", "--no-figures", "--out", "other"]
    )
    assert "no objective or constraint uses the task's workspace; quantities for it: uncovered_fraction" in told.output


# Directions of the tool


CONE: dict[str, Any] = {"axis": (0, 0, 1), "half_angle": 0.6, "count": 9, "share": 0.5}


@pytest.mark.slow
def test_dexterous_volume_is_that_of_many_restarts() -> None:
    box = region(low=(-0.3, -0.3, 0.0), high=(0.3, 0.3, 0.3), points=40, directions=CONE)
    arms = [paper_space(6).arm(design) for design in paper_space(6).sample(4, 1)]
    together = evaluate(arms, [[0.1, 0.2, 0.3]], workspace=[box])
    points = sample_regions((box,))
    for arm, value in zip(arms, DEXTEROUS_VOLUME(together), strict=True):
        alone = evaluate(arm, [[0.1, 0.2, 0.3]], workspace=[box])
        assert DEXTEROUS_VOLUME(alone)[0] == value, "independent of the batch"
        assert UNDEXTEROUS_FRACTION(alone)[0] == 1.0 - value
        axes = np.tile(cone_directions(CONE["axis"], 0.6, 9), (40, 1))
        peer = (
            solve(arm, np.repeat(points, 9, axis=0), axes=axes, restarts=40, angle_tolerance=np.radians(1.0))
            .reached[0]
            .reshape(40, 9)
        )
        assert value == pytest.approx((peer.mean(axis=1) >= 0.5).mean(), abs=0.05)


def test_dexterous_volume_of_padded_arms_is_their_own() -> None:
    box = region(low=(-0.4, -0.4, 0.0), high=(0.4, 0.4, 0.4), points=20, directions=CONE)
    short, long = paper_space(5).arm(paper_space(5).sample(1, 2)[0]), paper_space(7).arm(paper_space(7).sample(1, 2)[0])
    both = evaluate([short, long], [[0.1, 0.2, 0.3]], workspace=[box])
    alone = evaluate(short, [[0.1, 0.2, 0.3]], workspace=[box])
    assert DEXTEROUS_VOLUME(both)[0] == DEXTEROUS_VOLUME(alone)[0]


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
    assert DEXTEROUS_VOLUME(evaluate(gantry, [[0.0, 0.0, 0.3]], workspace=[box]))[0] == 1.0
    behind = evaluate(gantry, [[0.0, 0.0, 0.3]], workspace=[box], obstacles=[plate])
    assert (gap > 1e-3).mean() <= DEXTEROUS_VOLUME(behind)[0] <= (gap > -1e-3).mean()  # reached within 1 mm
    around = Box(kind="box", center=(0.0, 0.0, 0.45), size=(1.0, 1.0, 0.4))
    assert DEXTEROUS_VOLUME(evaluate(gantry, [[0.0, 0.0, 0.3]], workspace=[box], obstacles=[around]))[0] == 0.0


def test_regions_without_directions_do_not_count() -> None:
    (arm,) = (paper_space(6).arm(design) for design in paper_space(6).sample(1, 1))
    asked = region(points=20, directions=CONE)
    first, second = (evaluate(arm, [[0.1, 0.2, 0.3]], workspace=boxes) for boxes in ([asked], [asked, region()]))
    assert np.array_equal(DEXTEROUS_VOLUME(first), DEXTEROUS_VOLUME(second))
    with pytest.raises(SettingsError, match="need a workspace with directions in the task; try workspace: "):
        DEXTEROUS_VOLUME(evaluate(arm, [[0.1, 0.2, 0.3]], workspace=[region()]))


def test_tasks_bound_and_minimise_directions_of_the_tool() -> None:
    box = {"low": (-0.3, -0.3, 0.1), "high": (0.3, 0.3, 0.4), "points": 10, "directions": CONE}
    asked = task(workspace=box, objectives=["undexterous_fraction", "length"], constraints=["dexterous_volume >= 0.5"])
    assert Task.model_validate(asked.model_dump(mode="json")) == asked
    problem = Problem(asked, paper_space(6))
    outcomes = problem.evaluate(problem.space.sample(5, 3))
    fraction = outcomes.values[:, 0]
    assert np.all((fraction >= 0.0) & (fraction <= 1.0))
    assert np.array_equal(outcomes.violations[:, 0] > 0.0, 1.0 - fraction < 0.5)


def test_unstated_directions_leave_a_region_as_it_was() -> None:
    assert region().describe() == "box from (0, 0, 0) to (1, 1, 1), 200 points"
    assert region(directions={}).describe().endswith("200 points, 12 tool directions within 180° of (0, 0, -1)")


@pytest.mark.parametrize(
    ("directions", "message"),
    [
        ("{axis: [0, 0, 0]}", r"axis = \[0.0, 0.0, 0.0\] is no direction; try \[0, 0, -1\]"),
        ("{axis: down}", "axis"),
        ("{half_angle: 45}", "half_angle"),
        ("{count: 0}", "count"),
        ("{share: 0}", "share"),
        ("{cone: 1}", "cone"),
        ("{count: 100}", "workspace: expected at most 50000 points x directions in all boxes together, got 60000"),
    ],
)
def test_invalid_directions_are_refused_in_one_line(directions: str, message: str) -> None:
    text = f"name: x\nworkspace: {{low: [0, 0, 0], high: [1, 1, 1], points: 600, directions: {directions}}}"
    with pytest.raises(TaskError, match=message) as refused:
        parse_document(text, Task, TaskError, "it.yaml")
    assert "\n" not in str(refused.value)
