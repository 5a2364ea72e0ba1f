"""Errors below stated tolerances: 0 in objectives, in full in constraints, and nothing without stated ones."""

from typing import Any

import numpy as np
import pytest

from armwright.problem.checks.instant import check_instantly
from armwright.problem.ignored_errors import describe_ignored_errors, stated_tolerance
from armwright.problem.objectives import OBJECTIVES
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace, default_space, paper_space
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.tasks.targets import ALIGNED, REACHED
from armwright.tasks.task import Task
from tests.support.arms import LIGHT

HERE, THERE = [0.3, 0.1, 0.2], [0.2, 0.3, 0.1]
DOWN = {"axis": [0, 0, -1]}
ERRORS = ("position_error", "worst_error", "orientation_error", "worst_angle")


def task(*targets: Any, **keys: Any) -> Task:
    return Task.model_validate({"name": "mine", "targets": targets, **keys})


def problem(*targets: Any, joints: int = 4, **keys: Any) -> Problem:
    return Problem(task(*targets, **keys), paper_space(joints))


def test_errors_count_beyond_the_tolerances_of_their_targets() -> None:
    stated = problem(
        {"position": HERE, **DOWN, "tolerance": 0.3, "weight": 2.0},
        {"position": THERE, **DOWN, "angle_tolerance": 1.2},
        objectives=ERRORS,
    )
    found = stated.physics(stated.space.sample(300, 0))
    distance = np.maximum(found.position_error - [0.3, 0.0], 0.0)
    angle = np.maximum(found.angle_error - [0.0, 1.2], 0.0)
    expected = [distance @ [2.0, 1.0], distance.max(axis=1), angle @ [2.0, 1.0], angle.max(axis=1)]
    values = stated.outcomes(found).values
    assert values == pytest.approx(np.column_stack(expected))
    assert (distance[:, 0] == 0.0).any()
    assert (angle[:, 1] == 0.0).any()


def test_tolerances_change_no_builtin_task() -> None:
    for name in builtin_names():
        assert describe_ignored_errors(Problem(load_task(name), default_space(name))) == ""


def test_constraints_bound_the_whole_error() -> None:
    keys: dict[str, Any] = {"constraints": ["worst_error <= 0.05"], "objectives": ["worst_error", "torque"]}
    wide, plain = problem({"position": HERE, "tolerance": 0.3}, **keys), problem(HERE, **keys)
    designs = wide.space.sample(300, 0)
    outcomes = wide.evaluate(designs)
    assert np.array_equal(outcomes.violations, plain.evaluate(designs).violations)
    assert np.any((outcomes.values[:, 0] == 0.0) & (outcomes.violations[:, 0] > 0.0))


def test_stated_tolerances_survive_files_even_if_they_equal_the_defaults() -> None:
    stated = task({"position": HERE, **DOWN, "tolerance": REACHED, "angle_tolerance": ALIGNED}, THERE)
    plain = task({"position": HERE, **DOWN}, THERE)
    assert stated != plain
    again = Task.model_validate(stated.model_dump(mode="json"))
    assert again == stated
    for one in (stated, again):
        assert one.target_arrays.stated_tolerance.tolist() == [REACHED, 0.0]
        assert one.target_arrays.stated_angle_tolerance.tolist() == [ALIGNED, 0.0]
    assert not plain.target_arrays.stated_tolerance.any()
    for name in ("tolerance", "angle_tolerance"):
        assert np.array_equal(getattr(stated.target_arrays, name), getattr(plain.target_arrays, name))


def test_deviations_from_lines_count_beyond_the_tolerance_of_the_cycle() -> None:
    keys: dict[str, Any] = {
        "objectives": ["path_error", "path_angle"],
        "cycle": {"steps": [{"to": 1}, {"to": 2, "by": "line"}]},
    }
    targets = [{"position": HERE, **DOWN}, {"position": THERE, **DOWN}]
    plain = problem(*targets, joints=5, **keys)
    keys["cycle"] = {**keys["cycle"], "tolerance": {"path": 0.05}}
    stated = problem(*targets, joints=5, **keys)
    designs = plain.space.sample(40, 0)
    full, beyond = plain.evaluate(designs).values, stated.evaluate(designs).values
    assert full[:, 0].max() > 0.05
    assert np.array_equal(stated_tolerance(stated.task, OBJECTIVES["path_error"]), [0.05])
    found = stated.physics(designs)
    assert np.array_equal(beyond[:, 0], np.maximum(OBJECTIVES["path_error"](found) - 0.05, 0.0))
    assert np.array_equal(beyond[:, 1], OBJECTIVES["path_angle"](found))
    assert not stated_tolerance(plain.task, OBJECTIVES["path_error"]).any()


@pytest.mark.parametrize(
    ("targets", "constraints", "is_idle"),
    [
        ([{"position": HERE, "tolerance": 0.002}], ["unreached_targets <= 0"], True),
        ([{"position": HERE, "tolerance": 0.002}, THERE], ["unreached_targets <= 0"], True),
        ([{"position": HERE, "tolerance": 0.002}], [], False),
        ([HERE], ["unreached_targets <= 0"], True),
        ([HERE], ["unreached_targets <= 1"], False),
    ],
)
def test_objectives_that_no_feasible_design_can_improve_are_reported(
    targets: list[Any], constraints: list[str], is_idle: bool
) -> None:
    keys: dict[str, Any] = {"objectives": ["worst_error", "torque"], "constraints": constraints}
    found = [str(one) for one in check_instantly(problem(*targets, **keys)) if "for every feasible design" in str(one)]
    assert [one.startswith("worst_error: 0 or next to 0 for") for one in found] == [True] * is_idle


def test_objectives_that_suit_the_task_are_suggested() -> None:
    """The suggestion can be evaluated, and the check has nothing against it."""
    cycle = {"steps": [{"to": 1}, {"to": 2}]}
    motors = DesignSpace.model_validate({"name": "m", "joints": 4, **LIGHT, "actuators": ["XL430-W250", "XM430-W350"]})
    for keys, space in (
        ({"constraints": ["unreached_targets <= 0"]}, paper_space()),
        ({"cycle": cycle}, paper_space()),
        ({"cycle": {**cycle, "time": 2.0}}, paper_space()),
        ({"cycle": cycle}, motors),
        ({"cycle": {**cycle, "time": 2.0}}, motors),
    ):
        first = Problem(task(HERE, THERE, **keys), space)  # type: ignore[arg-type]
        (text,) = [str(one) for one in check_instantly(first) if "for every feasible design" in str(one)]
        names = text.partition("objectives: [")[2].partition("]")[0].split(", ")
        second = Problem(task(HERE, THERE, **keys, objectives=names), space)  # type: ignore[arg-type]
        assert check_instantly(second) == []
        assert second.evaluate(space.sample(3, 0)).values.shape == (3, 2)
