"""Perturbed designs: what changes of the arm, its supply, its motors or its payload leave of limits and geometry."""

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.arrays import Array
from armwright.kinematics.cycle.cycle_loads import MIN_TIME, MORE_PAYLOAD, VOLTAGE_SHARE
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.proof.perturbations import (
    ASSUMED,
    HEAVIER,
    MOVED,
    NOMINAL,
    SHIFTED,
    SUPPLY,
    Left,
    Survival,
    evaluate_survival,
)
from armwright.proof.verification import front_survival, verify_front
from armwright.robot.actuators import named_actuator, value_of
from armwright.runs.history import FRONT_SEARCH, History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.design_space import default_space, paper_space
from armwright.spaces.tolerance import perturbed
from armwright.tasks.task import Task
from tests.proof.test_simulation import DESK, SPACE, Desk

SERVO = "XM540-W270"
VALUES = (  # assumed, and not 0
    "rated_torque", "rotor_inertia", "coulomb_friction", "viscous_friction", "load_friction", "shaft_offset",
)  # fmt: skip
STEADY = 2e-3  # relative; postures are solved again from near ones


def history_of(desk: Desk) -> History:
    return aw.optimize(
        desk.problem, proposer="none", n_init=1, n_total=1, initial_designs=[desk.design], verify=False
    ).history


@cache
def nominal_desk() -> Desk:
    return Desk()


@cache
def stated_desk() -> Desk:
    """The desk with motors of which no value is assumed."""
    return Desk(space=stated(factor=1.0))


@cache
def survival_of(desk: Desk) -> Survival:
    return evaluate_survival(history_of(desk), [0], {})[0]


def perturbation(found: Survival, name: str) -> Left:
    return next(one for one in found.perturbations if one.name == name)


def stated(*changed: str, factor: float) -> dict[str, Any]:
    """The servo as a record of its own with all values stated, some of them changed."""
    record = named_actuator(SERVO).completed()
    values = record.model_dump(exclude={"estimates"}) | {name: factor * value_of(record, name) for name in changed}
    return {**SPACE, "actuators": [values]}


def reserve_of(changed: Desk, desk: Desk) -> float:
    """The reserve of an arm or a task that state a change, with the durations of those that do not."""
    return float(changed.evaluation.keeping(desk.evaluation.loads.durations).reserves.least[0])


def test_a_changed_payload_leaves_what_a_task_with_it_leaves() -> None:
    desk = nominal_desk()
    found = survival_of(desk)
    heavier = Desk(payload=DESK["payload"] | {"mass": 1.1 * DESK["payload"]["mass"]})
    assert perturbation(found, HEAVIER).reserve == pytest.approx(reserve_of(heavier, desk), rel=STEADY)
    shifts = [sign * axis for axis in np.eye(3) for sign in (-0.01, 0.01)]
    shifted = [
        Desk(payload=DESK["payload"] | {"center": (shift + np.array([0, 0, 0.02])).tolist()}) for shift in shifts
    ]
    least = min(reserve_of(one, desk) for one in shifted)
    assert perturbation(found, SHIFTED).reserve == pytest.approx(least, rel=STEADY)
    assert perturbation(found, NOMINAL).reserve == pytest.approx(reserve_of(desk, desk), rel=1e-9)


def test_less_voltage_leaves_what_motors_rated_for_it_leave() -> None:
    """A servo without a corner speed: torque and speed fall with the voltage."""
    weak = stated("stall_torque", "speed", factor=VOLTAGE_SHARE)
    weak["actuators"][0]["peak_torque"] = None
    full, weaker = stated_desk(), Desk(space=weak)
    found = perturbation(survival_of(full), SUPPLY)
    assert found.reserve == pytest.approx(reserve_of(weaker, full), rel=STEADY)


def test_assumed_values_are_apart_and_leave_what_motors_with_them_leave() -> None:
    desk = nominal_desk()
    found = survival_of(desk)
    assert found.assumed is not None
    assert (found.assumed.name, ASSUMED in {one.name for one in found.perturbations}) == (ASSUMED, False)
    halved = [Desk(space=stated(*names, factor=0.5)) for names in (*([name] for name in VALUES[:4]), VALUES)]
    doubled = [Desk(space=stated(*names, factor=2.0)) for names in (*([name] for name in VALUES[:4]), VALUES)]
    assert found.assumed.reserve == pytest.approx(min(reserve_of(one, desk) for one in (*halved, *doubled)), rel=STEADY)
    assert re.search(r"(halved|doubled): reserve ", found.assumed.text)


def test_moved_base_and_links_fail_where_their_evaluation_does() -> None:
    content = {"name": "two", "targets": [[0.3, 0.1, 0.2], [0.2, 0.3, 0.1]], "constraints": ["worst_error <= 0.001"]}
    problem = Problem(Task.model_validate(content), paper_space())
    history = aw.optimize(problem, proposer="none", n_init=1, n_total=20, verify=False).history
    numbers = [0, 7]
    matrix = problem.space.matrix([history.trials[number].design for number in numbers])
    values = [problem.violations(problem.physics(rows))[:, 0] for rows in perturbed(problem.space, matrix)]
    for row, found in enumerate(evaluate_survival(history, numbers, {}).values()):
        nominal, moved = found.perturbations
        assert (nominal.name, moved.name, moved.reserve) == (NOMINAL, MOVED, None)
        fails = max(value[row] for value in values) > 1e-3
        assert (moved.holds, "worst position error" in moved.text) == (not fails, fails)
        assert found.verdict.startswith("does not hold: " if fails or not nominal.holds else "holds")


def test_stated_motors_and_empty_grippers_are_not_changed() -> None:
    found = survival_of(Desk(space=stated(factor=1.0), payload=0.0))
    assert [one.name for one in found.perturbations] == [NOMINAL, MOVED, SUPPLY]
    assert found.assumed is None


def test_a_design_that_reaches_a_limit_does_not_hold_and_names_it() -> None:
    loaded = {"payload": DESK["payload"] | {"mass": 0.3}}
    causes = Desk(space=stated(factor=1.0), **loaded).evaluation.reserves.by_cause
    reserve = min(causes["torque"].min(), causes["heat"].min())
    torques = ("stall_torque", "peak_torque", "rated_torque")
    found = survival_of(Desk(space=stated(*torques, factor=0.85 / reserve), **loaded))
    heavier = perturbation(found, HEAVIER)
    assert heavier.reserve is not None
    assert heavier.reserve < 1.0
    assert not found.holds
    assert f"{HEAVIER} (reserve {heavier.reserve:.2f} (" in found.verdict
    assert " of joint " in heavier.text
    assert survival_of(nominal_desk()).holds


def test_a_load_across_an_axis_beyond_what_the_maker_allows_names_joint_and_motion() -> None:
    desk = nominal_desk()
    allowed = 0.9 * float(desk.evaluation.bearing_loads[..., 0].max())
    motor = stated(factor=1.0)
    motor["actuators"][0] |= {"tilting_limit": allowed, "axial_limit": None, "radial_limit": None}
    loaded = Desk(space=motor)
    joint = int(loaded.evaluation.bearing_loads[0, ..., 0].max(axis=0).argmax()) + 1
    found = perturbation(survival_of(loaded), NOMINAL)
    assert (found.holds, found.reserve) == (False, pytest.approx(0.9, rel=STEADY))
    assert re.fullmatch(rf"reserve 0.90 \(load across the axis of joint {joint}, step \d.*\)", found.text)


def test_feasible_designs_hold_as_designed() -> None:
    """Verified in double precision, on the paths that the search found."""
    problem = Problem(aw.load_task("dispensing"), default_space("dispensing"))
    known = known_front(problem)
    assert known is not None
    pairs = zip(known.designs, problem.evaluate(known.designs), strict=True)
    trials = [FinishedTrial(n, FRONT_SEARCH, design, **vars(outcome)) for n, (design, outcome) in enumerate(pairs)]
    history = History(problem, trials, 0, known.reference_point)
    survival = front_survival(history, verify_front(history))
    assert len(survival) == len(history.front) > 1
    assert all(perturbation(found, NOMINAL).holds for found in survival.values())


def torque_and_speed(evaluation: Any) -> Array:
    """(N, M) smallest reserve of torque and speed along each motion."""
    causes = evaluation.reserves.by_cause
    return np.minimum(causes["torque"].min(axis=2), causes["speed"].min(axis=2))


@pytest.mark.parametrize("name", ["desk-sorting", "lathe-tending"])
@pytest.mark.parametrize("safety_factor", [1.0, 1.5])
def test_fastest_motions_keep_the_makers_limits_with_less_voltage_and_more_payload(
    name: str, safety_factor: float
) -> None:
    """No limit is exceeded in any of the three cases, and one of them is reached by each motion."""
    space = aw.load_space(name).model_copy(update={"safety_factor": safety_factor})
    problem = Problem(aw.load_task(name), space)
    known = known_front(Problem(problem.task, default_space(name)))
    assert known is not None
    evaluation = problem.physics(known.designs[:12])
    scene, durations = problem.scenes[0], evaluation.loads.durations
    heavier = scene.__class__(**vars(scene) | {"payload": (1.0 + MORE_PAYLOAD) * scene.payload})
    weak = evaluation.reloaded(scene, evaluation.drives.at_voltage(VOLTAGE_SHARE))
    left = [torque_and_speed(one.keeping(durations)) for one in (weak, evaluation.reloaded(heavier))]
    plan = evaluation.paths.plan
    is_free = np.array([plan.times[motion.step] is None for motion in plan.motions])
    moves = (durations > MIN_TIME) & (durations < 100.0) & is_free
    assert moves.sum() > 20
    assert min(one[moves].min() for one in left) >= 1.0 - 1e-9
    wanted = evaluation.reserves.by_cause["torque"].min(axis=2) / safety_factor
    assert wanted[moves].min() >= 1.0 - 1e-9
    decisive = np.min([wanted, *left], axis=0)
    faster = [torque_and_speed(one.keeping(0.999 * durations)) for one in (weak, evaluation.reloaded(heavier))]
    faster.append(evaluation.keeping(0.999 * durations).reserves.by_cause["torque"].min(axis=2) / safety_factor)
    assert (np.min(faster, axis=0)[moves] < np.maximum(1.0, decisive[moves])).mean() > 0.95


def test_scaled_values_stay_within_each_other() -> None:
    drive = named_actuator("AK80-6")
    doubled = drive.scaled(["corner_speed"], 2.0)
    assert doubled.corner_speed == doubled.speed == drive.speed
    assert drive.scaled(["rotor_inertia"], 2.0).rotor_inertia == 2.0 * value_of(drive, "rotor_inertia")
    guess = drive.model_copy(update={"stall_torque": 8.0, "peak_torque": None})
    assert guess.scaled(["stall_torque"], 0.5).actuator().peak_torque == 4.0
