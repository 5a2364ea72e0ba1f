"""Verdicts on designs with the assumed values of their actuators halved and doubled."""

from types import SimpleNamespace
from typing import Any

import pytest

import armwright as aw
from armwright.robot.actuators import named_actuator, value_of
from armwright.runs import assumed_changes
from armwright.runs.assumed_changes import AssumedVerdict, vary_assumed
from armwright.runs.history import History
from tests.runs.test_simulation import SPACE, Desk

SERVO = "XM540-W270"
VALUES = ("rated_torque", "rotor_inertia", "coulomb_friction", "viscous_friction")  # assumed, and not 0
BOUNDS = {"constraints": ["thermal_utilisation <= 0.9"]}


def history_of(desk: Desk) -> History:
    return aw.optimize(
        desk.problem, proposer="none", n_init=1, n_total=1, initial_designs=[desk.design], verify=False
    ).history


def verdict_on(desk: Desk, simulates: bool = False) -> AssumedVerdict:
    return vary_assumed(history_of(desk), {0: simulates})[0]


def stated(*changed: str, factor: float) -> dict[str, Any]:
    """The servo as a record of its own with all values stated, some of them changed."""
    record = named_actuator(SERVO).completed()
    values = record.model_dump(exclude={"estimates"}) | {name: factor * value_of(record, name) for name in changed}
    return {**SPACE, "actuators": [values]}


def test_changes_break_what_evaluation_of_the_changed_motors_breaks() -> None:
    """The same motors from a space file that states the changed values."""
    expected: dict[str, tuple[str, float]] = {}
    for text, names in (*((name, (name,)) for name in VALUES), ("all", VALUES)):
        for verb, factor in (("halved", 0.5), ("doubled", 2.0)):
            desk = Desk(space=stated(*names, factor=factor), **BOUNDS)
            violations = desk.problem.evaluate([desk.design]).violations[0]
            constraint = desk.problem.constraints[violations.argmax()]
            if violations.max() > 0.0:
                expected[f"{text} {verb}"] = constraint.description, constraint.measured(violations.max())
    found = verdict_on(Desk(**BOUNDS))
    assert found.changes == 2 * (len(VALUES) + 1)
    assert {one.change: (one.constraint, one.measured) for one in found.broken} == {
        change: (constraint, pytest.approx(value, rel=1e-9)) for change, (constraint, value) in expected.items()
    }
    assert "rated_torque halved" in expected
    assert len(expected) < found.changes
    assert found.verdict.startswith("not with rated_torque halved (thermal utilisation ")


def test_half_of_the_continuous_torque_is_twice_the_thermal_utilisation() -> None:
    desk = Desk()
    (heat,) = (c for c in desk.problem.constraints if c.quantity.name == "thermal_utilisation")
    measured = float(heat.quantity(desk.evaluation)[0])
    halved = next(one for one in verdict_on(desk).broken if one.change == "rated_torque halved")
    assert halved.measured == pytest.approx(2.0 * measured)


def test_verdicts_hold_with_room_to_the_limits() -> None:
    found = verdict_on(Desk(constraints=["thermal_utilisation <= 9", "dynamic_utilisation <= 9"]))
    assert (found.broken, found.verdict) == ((), "holds with assumed values halved and doubled")


def test_stated_values_are_not_changed() -> None:
    desk = Desk(space=stated(factor=1.0))
    assert vary_assumed(history_of(desk), {0: False}) == {}


def test_feasible_changes_of_all_values_are_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = Desk(constraints=["thermal_utilisation <= 9", "dynamic_utilisation <= 9"])
    found = verdict_on(desk, simulates=True)
    assert (found.simulated, found.broken) == (("all halved", "all doubled"), ())
    tight = verdict_on(Desk(), simulates=True)
    assert "all halved" in {one.change for one in tight.broken}
    assert "all halved" not in tight.simulated
    monkeypatch.setattr(
        assumed_changes, "simulate_arm", lambda *_: SimpleNamespace(result=SimpleNamespace(reasons=["link_2 touches"]))
    )
    failing = verdict_on(desk, simulates=True)
    assert failing.verdict == "not with all halved (link_2 touches), all doubled (link_2 touches)"
    assert {one.measured for one in failing.broken} == {None}


def test_scaled_values_stay_within_each_other() -> None:
    drive = named_actuator("AK80-6")
    doubled = drive.scaled(["corner_speed"], 2.0)
    assert doubled.corner_speed == doubled.speed == drive.speed
    assert drive.scaled(["rotor_inertia"], 2.0).rotor_inertia == 2.0 * value_of(drive, "rotor_inertia")
    guess = drive.model_copy(update={"stall_torque": 8.0, "peak_torque": None})
    assert guess.scaled(["stall_torque"], 0.5).actuator().peak_torque == 4.0
