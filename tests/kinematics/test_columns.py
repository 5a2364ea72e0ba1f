"""Columns as solid bodies: clearances against Coal with the exported geometry, and contacts in MuJoCo."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from armwright.kinematics.arms.arm_arrays import Precision, stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Column, Joint, uniform_link
from armwright.robot.collision_pairs import joined_by_column
from armwright.robot.motor_body import MotorBody
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.obstacles import Ground
from armwright.tasks.task import Task
from tests.kinematics.test_clearance import agree
from tests.kinematics.test_motor_bodies import Exported, postures, touching_solids
from tests.support.arms import LIGHT

CONTENT: Mapping[str, Any] = {
    "name": "columns",
    "joints": [3, 6],
    "joint_types": ["R", "P", "Y", "S"],
    "joint_range": [-3.0, 3.0],
    "stroke": [0.05, 0.1],
    "origin_z": [0.0, 0.6],
    "column": {"foot": 0.1},
    "link": [0.06, 0.25],
    "link_directions": ["+z", "-x", "+y"],
    **LIGHT,
    "actuators": ["XM540-W270", "AK60-6", "PH42-020-S300-R", "XL330-M288"],
}
SPACE = DesignSpace.model_validate(CONTENT)
WITH_FIXED = {**CONTENT, "joint_types": ["R", "P", "Y", "S", "F"]}
LINKS_ALONE = DesignSpace.model_validate({**CONTENT, "motor_bodies": False})
COLUMN = Column(0.5, 0.06, 0.003, 1.0)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("space", [SPACE, LINKS_ALONE], ids=["motors", "links"])
def test_column_clearance_agrees_with_coal(space: DesignSpace, precision: Precision) -> None:
    arms = [space.arm(design) for design in space.sample(40, 1)]
    q = postures(arms, 4, 2)
    arrays = stack_arms(arms, precision)
    own, without = clearances(arrays, q)[0], clearances(replace(arrays, columns=None), q)[0]
    nearer, hit = 0, 0
    for n, arm in enumerate(arms):
        exported = Exported(arm)
        for t in range(q.shape[1]):
            column = exported.at(q[n, t, : len(arm.joints)]).column_clearance()
            nearer, hit = nearer + (column < without[n, t]), hit + (column < min(0.0, without[n, t]))
            assert agree(own[n, t], min(without[n, t], column)), (own[n, t], without[n, t], column)
    assert nearer > 20
    assert hit > 5


@pytest.mark.parametrize("has_motors", [True, False])
def test_contacts_in_mujoco_agree_with_the_clearance(has_motors: bool) -> None:
    """An arm whose links and motors are apart touches something if and only if that is its column."""
    space = DesignSpace.model_validate({**WITH_FIXED, "motor_bodies": has_motors})
    touching = free = 0
    for design in space.sample(45, 3):
        arm = space.arm(design)
        q, arrays = postures([arm], 10, 4), stack_arms([arm], "float64")
        own, without = clearances(arrays, q)[0][0], clearances(replace(arrays, columns=None), q)[0][0]
        names = touching_solids(arm, q[0])
        for t in np.flatnonzero((without > 1e-4) & (np.abs(own) > 1e-4)):
            assert bool(names[t]) == (own[t] < 0.0), (design, own[t], names[t])
            assert all(any("column" in name for name in pair) for pair in names[t])
            touching, free = touching + bool(names[t]), free + (not names[t])
    assert touching > 10
    assert free > 100


def test_bases_at_the_foot_have_no_column() -> None:
    low = SPACE.model_copy(update={"origin_z": (0.0, 0.1)})
    designs = low.sample(20, 7)
    arms = stack_designs(low, low.matrix(designs))
    assert arms.columns is None
    assert all(low.arm(design).column is None for design in designs)


def test_obstacles_do_not_count_against_the_column() -> None:
    """The ground is higher than the foot of the column; the arm stretches out level above it."""
    joints, links = (Joint("revolute", "y", -3.2, 3.2),) * 2, (uniform_link((0.0, 0.0, 0.2), 0.1, 0.01),) * 2
    arms = stack_arms([Arm((0.1, 0.2, 0.5), joints, links, column=COLUMN)])
    obstacle = clearances(arms, np.array([[[0.5 * math.pi, 0.0]]]), [Ground(kind="ground", z=0.4)])[1]
    assert obstacle == pytest.approx(0.1 - 0.01, abs=1e-6)


def test_parts_at_rest_do_not_count() -> None:
    """A fixed joint first: its link and the motors at both of its ends stand with the column."""
    body = MotorBody("box", "y", (0.04, 0.04, 0.04))
    fixed, turning = Joint("fixed", "z"), Joint("revolute", "y", -3.0, 3.0, body=body)
    down, out = uniform_link((0.0, 0.0, -0.05), 0.1, 0.01), uniform_link((0.2, 0.0, 0.0), 0.1, 0.01)
    arm = Arm((0.0, 0.0, 0.5), (fixed, turning, turning), (down, out, out), column=COLUMN)
    zeros = np.zeros((1, 1, 3))
    own = clearances(stack_arms([arm], "float64"), zeros)[0]
    without = clearances(stack_arms([replace(arm, column=None)], "float64"), zeros)[0]
    assert without > 0.0
    assert own == pytest.approx(-0.04, abs=1e-3), "the second link starts on the axis of the column and is not excluded"
    lying = replace(arm, joints=(fixed, fixed, turning), links=(down, out, out))
    assert clearances(stack_arms([lying], "float64"), zeros)[0] > 0.1
    assert joined_by_column(lying) == ([2], [0, 1])
    assert joined_by_column(arm) == ([1], [0])


def test_column_implies_that_nothing_collides() -> None:
    task = Task(name="low", targets=((0.02, 0.0, 0.3),))
    content = {"joints": 2, "joint_types": ["P"], "link": [0.1, 0.4], "joint_range": [-3.1, 3.1]}
    content |= {"origin_z": [0.5, 0.5]}
    space, without = (DesignSpace.model_validate({**content, "column": column}) for column in ({}, None))
    assert [one.description for one in Problem(task, space).constraints] == ["collision <= 0"]
    assert not Problem(task, without).constraints
    bounded = task.model_copy(update={"constraints": ("self_clearance >= 0.01",)})
    problem = Problem(bounded, space)
    assert [constraint.description for constraint in problem.constraints] == ["self_clearance >= 0.01"]
    folded = space.clipped((0.0, 0.0, 0.5), "PP", (0.1, 0.3))  # its tip is inside the column at the target
    assert problem.evaluate([folded]).violations[0, 0] > 0.01
