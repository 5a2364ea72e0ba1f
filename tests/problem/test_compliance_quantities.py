"""Deflection, backlash error and payload capacity as objectives, constraints and requirements."""

from dataclasses import replace

import numpy as np
import pytest

from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.reach.compliance import Stiffness
from armwright.problem.compliance_quantities import (
    backlash_error,
    deflection,
    friction_error,
    payload_capacity,
    payload_deflection,
)
from armwright.problem.conditions import read_condition
from armwright.problem.evaluation import evaluate
from armwright.problem.problem import Problem
from armwright.proof.selection import pick
from armwright.robot.actuators import named_actuator
from armwright.robot.arm import GRAVITY, Arm, Joint, uniform_link
from armwright.spaces.design_space import DesignSpace
from armwright.study.study import optimize
from armwright.tasks.moments import MAX_MASS
from armwright.tasks.task import Task
from tests.support.arms import LIGHT, moving_arms
from tests.support.frame_program import frame_displacement

TARGETS = [[0.3, 0.2, 0.1], [-0.2, 0.4, 0.3]]
PAYLOADS = (0.2, 0.6)  # [kg]
MOTOR = named_actuator("XM540-W270").actuator()
SPACE = DesignSpace.model_validate(
    {"joints": 4, **LIGHT, "actuators": ["XM540-W270", "XM430-W350"], "origin_z": [0.0, 0.0]}
)
TUBES = DesignSpace.model_validate(
    {
        "joints": [2, 4],
        "joint_types": ["R", "P", "Y", "S", "O", "F"],
        "motor_bodies": False,  # two joints at one place have no room for them
        "actuators": ["XM540-W270", "FHA-14C-100"],
        "origin_z": [0.0, 0.0],
        "link_section": {"tubes": [[0.020, 0.0015], [0.030, 0.002]], "per_link": True, "material": "aluminium"},
    }
)
TASK = {"name": "shelf", "targets": TARGETS, "payload": 0.2}


def built(arm: Arm) -> Arm:
    """An arm with motors, and links of a known section."""
    joints = tuple(replace(joint, actuator=MOTOR) for joint in arm.joints)
    links = tuple(
        replace(
            link,
            com=tuple(value / 2.0 for value in link.offset),
            end_mass=0.2,
            bending_stiffness=150.0,
            torsional_stiffness=90.0,
        )
        for link in arm.links
    )
    return replace(arm, joints=joints, links=links)


def problem(**changes: object) -> Problem:
    return Problem(Task.model_validate(TASK | changes), SPACE)


def test_deflection_is_that_of_the_worst_target() -> None:
    """By PyNite in the postures of the evaluation."""
    arms = [built(arm) for arm in moving_arms(3, 5, 4)]
    evaluation = evaluate(arms, TARGETS, payload=PAYLOADS)
    for i, arm in enumerate(arms):
        stacked = stack_arms([arm], "float64")
        stiffness = Stiffness(
            stacked.bending_stiffness, stacked.torsional_stiffness, np.full((1, 5), MOTOR.joint_stiffness)
        )
        found = [
            frame_displacement(arm, evaluation.q[i, t], stiffness, payload, np.zeros(3))
            for t, payload in enumerate(PAYLOADS)
        ]
        bare = [frame_displacement(arm, evaluation.q[i, t], stiffness, 0.0, np.zeros(3)) for t in range(2)]
        assert deflection(evaluation)[i] == pytest.approx(np.linalg.norm(found, axis=1).max(), rel=1e-3)
        by_payload = np.linalg.norm(np.subtract(found, bare), axis=1).max()
        assert payload_deflection(evaluation)[i] == pytest.approx(by_payload, rel=1e-3)


def test_friction_stops_a_lifting_joint_where_its_control_does_not_move_it() -> None:
    """A level link of 0.3 m and 0.2 kg with 0.5 kg at its end: the control must exceed the friction at 9.81 m/s²."""
    joint = Joint("revolute", "y", -1.0, 1.0, MOTOR)
    arm = Arm((0.0, 0.0, 0.0), (joint,), (uniform_link((0.3, 0.0, 0.0), 0.2, 0.01),))
    torque = GRAVITY * (0.2 * 0.15 + 0.5 * 0.3)
    friction = (MOTOR.coulomb_friction or 0.0) + (MOTOR.load_friction or 0.0) * torque
    found = friction_error(evaluate([arm], [[0.3, 0.0, 0.0]], payload=0.5))
    assert found == pytest.approx(0.3 * friction / (MOTOR.position_gain or 0.0), rel=1e-5)


def test_designs_of_a_batch_yield_like_single_arms_to_the_bit() -> None:
    bounds = ["payload_deflection <= 0.001", "payload_capacity >= 0.5"]
    task = Task.model_validate(TASK | {"objectives": ["deflection", "backlash_error"], "constraints": bounds})
    tubes = Problem(task, TUBES)
    designs = TUBES.sample(60, 5)
    outcomes = tubes.evaluate(designs)
    assert len({design.params[f"tube_{j}"] for design in designs for j in (1, 2)}) == 2
    for i, design in enumerate(designs):
        evaluation = evaluate([tubes.arm(design)], TARGETS, payload=0.2)
        assert outcomes.values[i].tolist() == [deflection(evaluation)[0], backlash_error(evaluation)[0]]
        assert outcomes.violations[i].tolist() == [constraint(evaluation)[0] for constraint in tubes.constraints]


def test_targets_without_the_payload_of_a_cycle_do_not_limit_it() -> None:
    places = {"above": [0.5, 0.3, 0.1], "near": [0.2, 0.1, 0.1], "beside": [0.2, -0.1, 0.1]}
    steps = [{"to": "above"}, {"to": "near", "do": "pick"}, {"to": "beside", "do": "place"}]
    targets = [{"position": position, "name": name} for name, position in places.items()]
    task = problem(targets=targets, cycle={"steps": steps, "time": 2.0})
    limits = payload_capacity.each(task.physics(SPACE.sample(20, 2)))
    assert (limits[:, 0] == MAX_MASS).all()
    assert (limits[:, 1:] < MAX_MASS).any()


def test_designs_can_be_picked_by_quantities_that_the_run_did_not_evaluate() -> None:
    asked = problem(objectives=["worst_error", "mass"])
    history = optimize(asked, proposer="none", sampler="random", n_init=15, n_total=15, verify=False).history
    numbers = [member.number for member in history.front]
    errors = dict(zip(numbers, backlash_error(history.evaluation(numbers)).tolist(), strict=True))
    bound = sorted(errors.values())[len(errors) // 2]
    picked = pick(history, [read_condition(f"backlash_error <= {bound!r}")], by="backlash_error")
    assert [errors[member.number] for member in picked] == sorted(e for e in errors.values() if e <= bound)
    with pytest.raises(SettingsError, match="deflection is not known: no section and material of the links are stated"):
        pick(history, [read_condition("deflection <= 0.001")])
