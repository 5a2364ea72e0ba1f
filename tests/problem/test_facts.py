"""What is known of designs, in records and texts."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.problem.facts import alike, describe_supply, facts_of
from armwright.problem.objectives import QUANTITIES
from armwright.robot.actuators import named_actuator, value_of
from tests.problem.test_assumptions import SERVO
from tests.proof.test_simulation import SPACE, WEAK, Desk
from tests.support.command_line import armwright


def test_records_state_values_or_reasons(tmp_path: Path) -> None:
    desk = Desk(objectives=["peak_current", "mean_current"])
    options = {"proposer": "none", "sampler": "random", "n_init": 1, "n_total": 1, "verify": False}
    aw.optimize(desk.problem, initial_designs=[desk.design], out=tmp_path, **options)  # type: ignore[arg-type]
    peak, mean = desk.problem.evaluate([desk.design])[0].values
    files = [tmp_path / "summary.json", tmp_path / "designs" / "0000" / "design.json"]
    summary, record = (json.loads(file.read_text(encoding="utf-8")) for file in files)
    motor, facts = named_actuator("XM540-W270").completed(), record["facts"]
    assert summary["assumed"] == record["assumed"] == {"XM540-W270": {name: value_of(motor, name) for name in SERVO}}
    assert set(facts) == {"reach", "payload_at_full_reach", "voltage", *QUANTITIES}
    assert (facts["peak_current"]["value"], facts["mean_current"]["value"]) == (peak, mean)
    assert (facts["voltage"]["value"], facts["price"]["unit"]) == (12.0, "USD")
    assert all((fact["value"] is None) == bool(fact.get("reason")) for fact in facts.values())
    assert all(fact["explanation"].endswith(".") for fact in facts.values())
    assert facts["dexterous_volume"]["reason"] == "the task has no workspace with directions"
    assert 0.0 < mean < peak < 5 * 4.4
    text = f"{peak:.3g} A peak, {mean:#.3g} A mean, at 12 V"
    assert f"supply along its cycle: {text}" in armwright("pick", tmp_path).stdout


def test_several_voltages_have_no_common_one() -> None:
    weak = {**WEAK, "stall_torque": 10.0, "voltage": 24.0}
    motors = {"restrict": {**SPACE["restrict"], "motor_1": "weak", **{f"motor_{k}": "XM540-W270" for k in range(2, 6)}}}
    desk = Desk(space={**SPACE, "supply": None, "actuators": ["XM540-W270", weak], **motors})
    assert {joint.actuator.voltage for joint in desk.arm.joints if joint.actuator} == {14.8, 24.0}
    (facts,) = facts_of(desk.evaluation, [desk.arm])
    assert facts["voltage"].value is None
    assert describe_supply(facts).endswith("at several voltages")


@pytest.mark.parametrize(
    ("space", "task", "reason"),
    [
        ({**SPACE, "actuators": []}, {}, "no actuators are named"),
        ({**SPACE, "actuators": [WEAK]}, {}, "the voltage of an actuator is not known"),
        (SPACE, {"cycle": None}, "the task has no cycle"),
    ],
    ids=["no actuators", "no voltage", "no cycle"],
)
def test_unknown_drives_and_tasks_without_a_cycle_have_no_currents(
    space: dict[str, Any], task: dict[str, Any], reason: str
) -> None:
    desk = Desk(space=space, **task)
    (facts,) = facts_of(desk.evaluation, [desk.arm])
    assert (facts["peak_current"].value, facts["peak_current"].reason) == (None, reason)
    assert describe_supply(facts) == ""


def test_an_actuator_of_unknown_voltage_hides_only_the_designs_that_use_it() -> None:
    space = aw.DesignSpace.model_validate({**SPACE, "actuators": ["XM540-W270", WEAK], "restrict": {}})
    problem = aw.Problem(Desk().problem.task, space)
    designs = space.sample(60, seed=0)
    groups = alike(problem, designs)
    assert sorted(np.concatenate(groups)) == list(range(60))
    assert len(groups) == 2
    for group in groups:
        chosen = [designs[row] for row in group]
        for design, facts in zip(
            chosen, facts_of(problem.physics(chosen), [problem.arm(design) for design in chosen]), strict=True
        ):
            assert (facts["voltages"].value is None) == ("weak" in design.motors)
