"""Supply currents of designs in records and texts, and as quantities of problems."""

import json
from pathlib import Path
from typing import Any

import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.problem.supply import supply_of
from tests.proof.test_simulation import SPACE, WEAK, Desk
from tests.support.command_line import armwright


def test_records_state_the_quantities(tmp_path: Path) -> None:
    desk = Desk(objectives=["peak_current", "mean_current"])
    aw.optimize(
        desk.problem, proposer="none", n_init=1, n_total=1, initial_designs=[desk.design], verify=False, out=tmp_path
    )
    peak, mean = desk.problem.evaluate([desk.design])[0].values
    record = json.loads((tmp_path / "designs" / "0000" / "design.json").read_text(encoding="utf-8"))
    assert record["supply"] == {"peak_current": peak, "mean_current": mean, "voltage": 12.0}
    assert 0.0 < mean < peak < 5 * 4.4
    text = f"{peak:.3g} A peak, {mean:.3g} A mean, at 12 V"
    assert f"supply along its cycle: {text}" in armwright("pick", tmp_path).stdout


def test_several_voltages_have_no_common_one() -> None:
    weak = {**WEAK, "stall_torque": 10.0, "voltage": 24.0}
    motors = {"restrict": {**SPACE["restrict"], "motor_1": "weak", **{f"motor_{k}": "XM540-W270" for k in range(2, 6)}}}
    desk = Desk(space={**SPACE, "actuators": ["XM540-W270", weak], **motors})
    assert {joint.actuator.voltage for joint in desk.arm.joints if joint.actuator} == {12.0, 24.0}
    supply = supply_of(desk.evaluation, 0)
    assert supply is not None
    assert supply.voltage is None
    assert supply.description.endswith("at several voltages")


@pytest.mark.parametrize(
    ("space", "task"),
    [({**SPACE, "actuators": []}, {}), ({**SPACE, "actuators": [WEAK]}, {}), (SPACE, {"cycle": None})],
    ids=["no actuators", "no voltage", "no cycle"],
)
def test_unknown_drives_and_tasks_without_a_cycle_have_none(space: dict[str, Any], task: dict[str, Any]) -> None:
    assert supply_of(Desk(space=space, **task).evaluation, 0) is None


def test_currents_need_the_voltage_of_every_actuator() -> None:
    desk = Desk(space={**SPACE, "actuators": [WEAK]}, objectives=["peak_current"])
    with pytest.raises(SettingsError, match="objective peak_current needs the voltage of every actuator"):
        desk.problem.evaluate([desk.design])
