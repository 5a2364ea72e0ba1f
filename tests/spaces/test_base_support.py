"""What bases stand on: columns and obstacles of the task."""

import math
from typing import Any

import numpy as np
import pytest

from armwright.exceptions import SpaceError
from armwright.kinematics.contact.clearance import clearances
from armwright.problem.arm_quantities import mass
from armwright.problem.checks.bounds import intervals_by_modules
from armwright.problem.drive_quantities import price
from armwright.problem.problem import Problem
from armwright.spaces.base_support import supported_space
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests.support.arms import LIGHT

TABLE = {"kind": "box", "name": "table", "center": [0.2, 0.0, 0.35], "size": [0.6, 0.4, 0.7]}
GROUND = {"kind": "ground", "name": "floor", "z": -0.2}
PRICED = {"outer_diameter": 0.05, "wall": 0.002, "density": 7850, "price_per_metre": 20.0}
EXACT = (mass, price)


def space(**keys: Any) -> DesignSpace:
    return DesignSpace.model_validate(
        {"name": "s", "joints": 2, **LIGHT, "actuators": ["XL430-W250"], "motor_bodies": False, **keys}
    )


def problem(of: DesignSpace, *obstacles: dict[str, Any]) -> Problem:
    task = Task.model_validate({"name": "t", "targets": [[0.4, 0.1, 0.9]], "obstacles": obstacles})
    return Problem(task, of, objectives=EXACT)


def values(of: Problem, designs: Any) -> np.ndarray:
    return of.evaluate(designs).values


@pytest.mark.parametrize(
    ("obstacles", "foot"), [((), 0.0), ((GROUND,), -0.2), ((GROUND, {"kind": "ground", "z": -0.1}, TABLE), -0.1)]
)
def test_column_counts_in_mass_and_price(obstacles: tuple[dict[str, Any], ...], foot: float) -> None:
    with_column, without = problem(space(column=PRICED), *obstacles), problem(space(), *obstacles)
    designs = without.space.sample(30, 0)
    lengths = np.maximum([design.origin[2] - foot for design in designs], 0.0)
    assert lengths.min() == 0.0 < lengths.max()
    kg = 7850 * math.pi * (0.025**2 - 0.023**2)
    added = np.column_stack([kg * lengths, 20.0 * lengths])
    assert values(with_column, designs) == pytest.approx(values(without, designs) + added, rel=1e-6)


def test_motor_body_is_between_face_and_base() -> None:
    """The shaft of an XL430-W250, of 28.5 x 46.5 mm, is 14.25 mm from one end of its body, 32.25 mm from the other."""
    keys = {"base_on": "table", "motor_bodies": True, "joint_types": ["P"], "link": [0.1, 0.2]}
    of = problem(space(**keys), TABLE).space
    assert of.origin_z == pytest.approx((0.7, 0.73225))
    checked = problem(space(**keys, origin_x=[0.2, 0.2], origin_y=[0.0, 0.0]), TABLE)
    designs = [checked.space.clipped((0.2, 0.0, z), "PP", (0.15, 0.15)) for z in (0.7, 0.72, 0.73225)]
    arms = checked.arms(checked.space.matrix(designs))
    clear = clearances(arms, np.zeros((3, 1, 2)), checked.task.obstacles)[1][:, 0]
    assert clear[:2] == pytest.approx([-0.03225, -0.01225], abs=1e-5)
    assert clear[2] > -1e-6


def test_default_column_is_an_aluminium_tube_without_a_price() -> None:
    of = space(column={}, origin_z=[0.5, 0.5])
    column = of.arm(of.sample(1, 0)[0]).column
    assert column is not None
    assert (column.length, column.outer_diameter, column.wall, column.price) == (0.5, 0.06, 0.003, 0.0)
    assert column.mass == pytest.approx(2700 * math.pi * (0.03**2 - 0.027**2) * 0.5)


def test_bounds_of_mass_and_price_include_the_column() -> None:
    of = problem(space(column=PRICED, origin_z=[0.3, 0.8]))
    known = intervals_by_modules(of)[2]
    found = values(of, of.space.sample(200, 0))
    for name, column in zip(("mass", "price"), found.T, strict=True):
        assert known[name].low * (1 - 1e-6) <= column.min() <= column.max() <= known[name].high * (1 + 1e-6)
        assert known[name].low > 0.0


@pytest.mark.parametrize(
    "obstacle",
    [
        TABLE,
        {**TABLE, "yaw": 0.7},
        {**TABLE, "rpy": [math.pi, 0.0, 0.4]},
        {"kind": "cylinder", "name": "table", "center": [0.2, -0.1, 0.35], "radius": 0.2, "height": 0.7},
    ],
)
@pytest.mark.parametrize("column", [None, {}])
def test_bases_lie_on_the_top_face(obstacle: dict[str, Any], column: dict[str, Any] | None) -> None:
    placed = problem(space(base_on="table", column=column), obstacle, GROUND)
    (solid,) = [one.solid for one in placed.task.obstacles if one.name == "table"]
    bases = np.array([design.origin for design in placed.space.sample(200, 0)])
    feet = np.column_stack([bases[:, :2], np.full(len(bases), 0.7)])
    assert np.abs(solid.signed_distance(feet)).max() < 1e-9
    assert solid.signed_distance(feet - [0.0, 0.0, 1e-3]).max() < 0.0
    if column is None:
        assert np.abs(bases[:, 2] - 0.7).max() < 1e-9
    else:
        assert placed.space.column is not None
        assert placed.space.column.foot == pytest.approx(0.7)
        assert (bases[:, 2].min(), bases[:, 2].max()) == (pytest.approx(0.7, abs=0.01), pytest.approx(1.0, abs=0.01))


def test_support_is_the_same_when_a_run_resumes() -> None:
    placed = problem(space(base_on="table", column={}), TABLE)
    again = DesignSpace.model_validate(placed.space.model_dump(mode="json"))
    assert supported_space(again, placed.task.obstacles) == again == placed.space
    assert supported_space(space(), placed.task.obstacles) == space()


@pytest.mark.parametrize(
    ("keys", "obstacle", "message"),
    [
        ({"base_on": "tabel"}, TABLE, 'obstacle "tabel". Did you mean "table"? Named obstacles of the task: table'),
        ({"base_on": "table"}, {**GROUND, "name": ""}, "The task names no obstacles"),
        ({"base_on": "table"}, {**TABLE, "rpy": [0.1, 0, 0]}, "expected an obstacle with a level top face, got table:"),
        ({"base_on": "table"}, {"kind": "sphere", "name": "table", "center": [0, 0, 0], "radius": 1}, "level top face"),
        ({"base_on": "table", "origin_z": [0, 0.6]}, TABLE, "[0, 0.6] m does not meet the top of table, 0.7 m"),
        ({"base_on": "table", "origin_x": [-1, -0.2]}, TABLE, "the top of table, [-0.1, 0.5] m"),
        ({"base_on": "table", "restrict": {"origin_z": 0.5}}, TABLE, "restrict: origin_z = [0.5, 0.5] m is outside"),
    ],
)  # fmt: skip
def test_impossible_supports_are_refused(keys: dict[str, Any], obstacle: dict[str, Any], message: str) -> None:
    with pytest.raises(SpaceError) as refusal:
        problem(space(**keys), obstacle)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
