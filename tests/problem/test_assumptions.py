"""Assumed values of actuators in the results of a run."""

from typing import Any

import armwright as aw
from armwright.problem.assumptions import assumed_values
from armwright.robot.actuators import named_actuator
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests.proof.test_simulation import DESK, SPACE, Desk
from tests.support.arms import LIGHT

SERVO = ["rated_torque", "corner_speed", "rotor_inertia", "coulomb_friction", "viscous_friction", "load_friction",
         "shaft_offset"]  # fmt: skip
SIZE = {"width": 0.03, "height": 0.04, "depth": 0.03}


def assumed_of(actuators: list[Any], with_cycle: bool = True) -> dict[str, list[str]]:
    task = Task.model_validate(DESK if with_cycle else {**DESK, "cycle": None})
    problem = aw.Problem(task, DesignSpace.model_validate({**SPACE, "supply": None, "actuators": actuators}))
    return {name: list(values) for name, values in assumed_values(problem).items()}


def test_values_along_a_cycle_are_those_that_move_and_heat_the_motors() -> None:
    assert assumed_of(["XM540-W270"]) == {"XM540-W270": SERVO}


def test_without_a_cycle_only_torques_at_rest_count() -> None:
    assert named_actuator("XM540-W270").assumed
    assert assumed_of(["XM540-W270"], with_cycle=False) == {"XM540-W270": ["shaft_offset"]}
    assert assumed_of(["PH42-020-S300-R"], with_cycle=False) == {"PH42-020-S300-R": ["peak_torque", "shaft_offset"]}


def test_estimates_are_assumed_and_stated_values_are_not() -> None:
    stated = dict.fromkeys((*SERVO, "position_gain", "current"), 1.0)
    full = {"name": "full", "mass": 0.1, "stall_torque": 9.0, "speed": 4.0, "voltage": 12.0, **SIZE, **stated}
    estimate = {**full, "name": "estimate", "estimates": ["rotor_inertia", "price"], "price": 9.0}
    assert assumed_of([full, estimate]) == {"estimate": ["rotor_inertia"]}


def test_only_actuators_in_use_count() -> None:
    desk = Desk(space={**SPACE, "actuators": ["XM540-W270", "XM430-W350"], "restrict": SPACE["restrict"] | {
        f"motor_{k}": "XM540-W270" for k in range(1, 6)
    }})  # fmt: skip
    assert set(assumed_values(desk.problem)) == {"XM540-W270", "XM430-W350"}
    assert set(assumed_values(desk.problem, [desk.arm])) == {"XM540-W270"}


def test_backlash_is_assumed_only_if_a_quantity_depends_on_it() -> None:
    servo = {"name": "servo", "mass": 0.1, "stall_torque": 5.0}
    space = DesignSpace.model_validate({**LIGHT, "actuators": [servo], "motor_bodies": False})
    for constraints, names in ((["mass <= 3"], []), (["mass <= 3", "backlash_error <= 0.01"], ["backlash"])):
        task = Task.model_validate({"name": "one", "targets": [[0.3, 0.0, 0.2]], "constraints": constraints})
        problem = aw.Problem(task, space)
        assert [name for values in assumed_values(problem).values() for name in values] == names
