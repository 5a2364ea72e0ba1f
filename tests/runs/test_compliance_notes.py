"""What build sheets and picks say of compliance, backlash and payload."""

from pathlib import Path

import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.kinematics.payload_limits import payloads_over_reach
from armwright.problem.objectives import BACKLASH_ERROR, DEFLECTION, PAYLOAD_CAPACITY, PAYLOAD_DEFLECTION
from armwright.runs.assumptions import assumed_values
from armwright.runs.compliance_notes import compliance_notes
from armwright.runs.conditions import read_condition
from armwright.runs.folder import read_run
from armwright.runs.selection import pick
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests.runs.test_simulation import SPACE, Desk
from tests.support.command_line import armwright


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with motors whose objectives are error and mass."""
    folder = tmp_path_factory.mktemp("compliance") / "run"
    task = Task.model_validate(
        {"name": "two", "targets": [[0.3, 0.1, 0.2], [0.2, -0.2, 0.1]], "objectives": ["worst_error", "mass"]}
    )
    space = DesignSpace.model_validate({"actuators": ["XM540-W270", "XM430-W350"], "origin_z": [0.0, 0.0]})
    aw.optimize(aw.Problem(task, space), proposer="none", n_init=10, n_total=10, verify=False, out=folder)
    return folder


def test_notes_state_backlash_and_payload() -> None:
    desk = Desk()
    (play,), (capacity,) = BACKLASH_ERROR(desk.evaluation), PAYLOAD_CAPACITY(desk.evaluation)
    backlash, payload = compliance_notes(desk.arm, desk.evaluation)
    assert backlash == f"Backlash moves the tip by {1e3 * play:.2f} mm at most."
    assert payload.startswith(f"The actuators hold {capacity:.3g} kg at all targets, ")
    found = payloads_over_reach(desk.arm)
    assert payload.endswith(f"{found.payloads[1]:.3g} kg at 100% of the reach of {found.reach:.3g} m.")


def test_notes_of_arms_with_sections_state_the_deflection() -> None:
    desk = Desk(space=SPACE | {"link_section": {"tubes": [[0.03, 0.002]], "material": "aluminium"}})
    (by_weight,), (by_payload,) = DEFLECTION(desk.evaluation), PAYLOAD_DEFLECTION(desk.evaluation)
    assert 0.0 < by_payload < by_weight
    first, *_ = compliance_notes(desk.arm, desk.evaluation)
    assert first == (
        f"The weight of arm and load moves the tip by {1e3 * by_weight:.2f} mm at most at the targets, "
        f"{1e3 * by_payload:.2f} mm by the payload alone."
    )


def test_nothing_is_noted_without_actuators() -> None:
    space = {key: value for key, value in SPACE.items() if key != "actuators"}
    desk = Desk(space=space)
    assert not list(compliance_notes(desk.arm, desk.evaluation))


def test_sheet_states_the_notes_and_the_values_that_they_assume(run: Path) -> None:
    sheet = armwright("export", run, "--format", "sheet").stdout
    assert "Backlash moves the tip by" in sheet
    assert "of the reach of" in sheet
    assert "joint stiffness" in sheet


def test_backlash_is_assumed_only_if_a_quantity_depends_on_it() -> None:
    servo = {"name": "servo", "mass": 0.1, "stall_torque": 5.0}
    space = DesignSpace.model_validate({"actuators": [servo], "motor_bodies": False})
    for constraints, names in ((["mass <= 3"], []), (["mass <= 3", "backlash_error <= 0.01"], ["backlash"])):
        task = Task.model_validate({"name": "one", "targets": [[0.3, 0.0, 0.2]], "constraints": constraints})
        problem = aw.Problem(task, space)
        assert [name for values in assumed_values(problem).values() for name in values] == names


def test_designs_can_be_picked_by_quantities_that_the_run_did_not_evaluate(run: Path) -> None:
    history = read_run(run)[1]
    numbers = [member.number for member in history.front]
    errors = dict(zip(numbers, BACKLASH_ERROR(history.evaluation(numbers)), strict=True))
    assert len(numbers) > 1
    bound = float(sorted(errors.values())[len(errors) // 2])
    picked = pick(history, [read_condition(f"backlash_error <= {bound!r}")], by="backlash_error")
    assert [member.number for member in picked] == sorted(
        (number for number in numbers if errors[number] <= bound), key=errors.__getitem__
    )
    with pytest.raises(SettingsError, match="deflection needs the section and the material of the links"):
        pick(history, [read_condition("deflection <= 0.001")])
    with pytest.raises(SettingsError, match=r'unknown quantity "backlash_eror".*Did you mean "backlash_error"'):
        pick(history, [read_condition("backlash_eror <= 0.001")])
