"""Survival of designs: what they break if the arm, its supply, its motors or its payload are off."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.problem.problem import Problem
from armwright.proof import perturbations as survival
from armwright.proof.perturbations import (
    ASSUMED,
    HEAVIER,
    MOVED,
    SHIFTED,
    SUPPLY,
    Broken,
    Perturbation,
    Survival,
    evaluate_survival,
)
from armwright.robot.actuators import ActuatorRecord, catalogue, named_actuator, value_of
from armwright.runs.history import History
from armwright.spaces.design_space import paper_space
from armwright.spaces.tolerance import perturbed
from armwright.tasks.task import Task
from tests.proof.test_simulation import DESK, SPACE, Desk

SERVO = "XM540-W270"
VALUES = (  # assumed, and not 0
    "rated_torque", "rotor_inertia", "coulomb_friction", "viscous_friction", "load_friction", "shaft_offset",
)  # fmt: skip
BOUNDS: dict[str, Any] = {"constraints": ["thermal_utilisation <= 0.9"]}
ROOM: dict[str, Any] = {
    "constraints": ["thermal_utilisation <= 9", "dynamic_utilisation <= 9", "speed_utilisation <= 9"]
}
STEADY = 2e-3  # relative; postures are solved again from near ones


def history_of(desk: Desk) -> History:
    return aw.optimize(
        desk.problem, proposer="none", n_init=1, n_total=1, initial_designs=[desk.design], verify=False
    ).history


def survival_of(desk: Desk, simulates: bool = False) -> Survival:
    return evaluate_survival(history_of(desk), {0: simulates})[0]


def perturbation(desk: Desk, name: str, simulates: bool = False) -> Perturbation:
    return next(one for one in survival_of(desk, simulates).perturbations if one.name == name)


def stated(*changed: str, factor: float) -> dict[str, Any]:
    """The servo as a record of its own with all values stated, some of them changed."""
    record = named_actuator(SERVO).completed()
    values = record.model_dump(exclude={"estimates"}) | {name: factor * value_of(record, name) for name in changed}
    return {**SPACE, "actuators": [values]}


def measured(desk: Desk, name: str) -> float:
    """A quantity that a constraint of the task bounds."""
    (constraint,) = (c for c in desk.problem.constraints if c.quantity.name == name)
    return float(constraint.quantity(desk.evaluation)[0])


def assert_breaks(found: Perturbation, change: str, changed: Desk) -> None:
    """Check that a change breaks what an arm or a task that state it break."""
    violations = changed.problem.violations(changed.evaluation)[0]
    expected = {
        c.description: c.measured(float(v))
        for c, v in zip(changed.problem.constraints, violations, strict=True)
        if v > 0.01
    }
    assert expected
    broken = {one.constraint: one.measured for one in found.broken if one.change == change}
    assert broken == {constraint: pytest.approx(value, rel=STEADY) for constraint, value in expected.items()}


def test_assumed_values_break_what_motors_with_these_values_break() -> None:
    found = perturbation(Desk(**BOUNDS), ASSUMED)
    assert found.changes == 2 * (len(VALUES) + 1)
    for text, names in (("rated_torque", VALUES[:1]), ("all", VALUES)):
        assert_breaks(found, f"{text} halved", Desk(space=stated(*names, factor=0.5), **BOUNDS))
    assert {one.change for one in found.broken} < {f"{name} {verb}" for name in (*VALUES, "all") for verb in
                                                  ("halved", "doubled")}  # fmt: skip
    assert "rated_torque doubled" not in {one.change for one in found.broken}


def test_lower_voltage_breaks_what_motors_rated_for_it_break() -> None:
    """A servo without a corner speed: torque and speed fall with the voltage."""
    bounds: dict[str, Any] = {
        "constraints": ["torque_utilisation <= 0.4", "speed_utilisation <= 0.2", "dynamic_utilisation <= 0.3"]
    }
    weak = stated("stall_torque", "speed", factor=0.9)
    weak["actuators"][0]["peak_torque"] = None
    full, weaker = Desk(**bounds), Desk(space=weak, **bounds)
    found = perturbation(full, SUPPLY)
    assert_breaks(found, SUPPLY, weaker)
    assert found.changes == 1
    ratio = measured(weaker, "speed_utilisation") / measured(full, "speed_utilisation")
    assert ratio == pytest.approx(1.0 / 0.9, rel=0.01)  # motions share the time of a step by their least durations


@pytest.mark.parametrize("record", [r for r in catalogue().values() if r.speed is not None], ids=lambda r: r.name)
def test_torque_at_less_voltage_is_that_at_a_higher_speed(record: ActuatorRecord) -> None:
    """Less voltage acts like a higher back-EMF, whatever the kind of motor."""

    def available(motor: ActuatorRecord, speed: np.ndarray) -> np.ndarray:
        peak, no_load, corner = (value_of(motor, name) for name in ("peak_torque", "speed", "corner_speed"))
        assert peak is not None
        assert no_load is not None
        assert corner is not None
        return peak * np.clip((no_load - speed) / (no_load - corner), 0.0, 1.0)

    full, less = record.completed(), record.at_voltage(0.9)
    speed = np.linspace(0.0, record.speed or 0.0, 50)
    assert available(less, speed) == pytest.approx(available(full, speed + 0.1 * (record.speed or 0.0)), abs=1e-9)
    assert (less.rated_torque, less.rotor_inertia) == (full.rated_torque, full.rotor_inertia)
    if full.current and full.voltage and less.current and less.voltage and full.peak_torque and less.peak_torque:
        loss = full.current * full.voltage / full.peak_torque**2
        assert less.current * less.voltage / less.peak_torque**2 == pytest.approx(loss)
    assert record.at_voltage(1.0).actuator() == record.actuator()


def test_changed_payload_breaks_what_a_task_with_it_breaks() -> None:
    bounds: dict[str, Any] = {"constraints": ["torque_utilisation <= 0.3", "dynamic_utilisation <= 0.3"]}
    shifted, heavier = (perturbation(Desk(**bounds), name) for name in (SHIFTED, HEAVIER))
    assert (shifted.changes, heavier.changes) == (6, 1)
    for found, change, values in (
        (heavier, HEAVIER, {"mass": 1.1 * DESK["payload"]["mass"]}),
        (shifted, "x +10 mm", {"center": [0.01, 0.0, 0.02]}),
        (shifted, "z -10 mm", {"center": [0.0, 0.0, 0.01]}),
    ):
        assert_breaks(found, change, Desk(payload=DESK["payload"] | values, **bounds))


def test_moved_base_and_links_break_what_their_evaluation_breaks() -> None:
    content = {"name": "two", "targets": [[0.3, 0.1, 0.2], [0.2, 0.3, 0.1]], "constraints": ["worst_error <= 0.001"]}
    problem = Problem(Task.model_validate(content), paper_space())
    history = aw.optimize(problem, proposer="none", n_init=1, n_total=20, verify=False).history
    numbers = [0, 7]
    matrix = problem.space.matrix([history.trials[number].design for number in numbers])
    values = [problem.violations(problem.physics(rows))[:, 0] for rows in perturbed(problem.space, matrix)]
    for row, found in enumerate(evaluate_survival(history, dict.fromkeys(numbers, False)).values()):
        (moved,) = found.perturbations
        assert (moved.name, moved.changes) == (MOVED, 14)
        assert [one.violation for one in moved.broken] == [value[row] for value in values if value[row] > 1e-3]
        expected = f"holds none: {MOVED} (" if moved.broken else "holds all perturbations"
        assert found.verdict.startswith(expected)


def test_stated_motors_and_empty_grippers_are_not_changed() -> None:
    names = [one.name for one in survival_of(Desk(space=stated(factor=1.0), payload=0.0)).perturbations]
    assert names == [MOVED, SUPPLY]


@pytest.mark.slow
def test_feasible_changes_of_all_values_are_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    found = survival_of(Desk(**ROOM), simulates=True)
    assert {one.name for one in found.perturbations if one.broken} <= {MOVED}  # the tolerances of the targets are 1 mm
    assert found.simulated == ("all halved", "all doubled")
    tight = survival_of(Desk(), simulates=True)
    assert "all halved" not in tight.simulated
    monkeypatch.setattr(
        survival, "simulate_arm", lambda *_: SimpleNamespace(result=SimpleNamespace(reasons=["link_2 touches"]))
    )
    failing = perturbation(Desk(**ROOM), ASSUMED, simulates=True)
    assert failing.broken == (Broken("all halved", "link_2 touches"), Broken("all doubled", "link_2 touches"))
    assert f"{ASSUMED} (all halved: link_2 touches and 1 more)" in survival_of(Desk(**ROOM), simulates=True).verdict


def test_verdict_names_the_perturbation_and_the_worst_constraint() -> None:
    bound = 1.002 * measured(Desk(constraints=["torque_utilisation <= 9"]), "torque_utilisation")
    found = survival_of(Desk(constraints=[f"torque_utilisation <= {bound}", "dynamic_utilisation <= 9"]))
    assert found.verdict.startswith("holds all but: ") or all(one.broken for one in found.perturbations)
    heavier = next(one for one in found.perturbations if one.name == HEAVIER)
    (broken,) = heavier.broken
    assert broken.violation is not None
    assert broken.measured == pytest.approx(bound * (1.0 + broken.violation))
    assert f"{HEAVIER} (torque_utilisation {broken.measured:.4g} > {bound:g})" in found.verdict
    assert f"{ASSUMED} (rated_torque halved: thermal_utilisation" in found.verdict


def test_scaled_values_stay_within_each_other() -> None:
    drive = named_actuator("AK80-6")
    doubled = drive.scaled(["corner_speed"], 2.0)
    assert doubled.corner_speed == doubled.speed == drive.speed
    assert drive.scaled(["rotor_inertia"], 2.0).rotor_inertia == 2.0 * value_of(drive, "rotor_inertia")
    guess = drive.model_copy(update={"stall_torque": 8.0, "peak_torque": None})
    assert guess.scaled(["stall_torque"], 0.5).actuator().peak_torque == 4.0
