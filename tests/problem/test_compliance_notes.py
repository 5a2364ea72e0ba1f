"""Picks by compliance and backlash, and the values that they assume."""

from pathlib import Path

import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.problem.assumptions import assumed_values
from armwright.problem.conditions import read_condition
from armwright.problem.objectives import BACKLASH_ERROR
from armwright.proof.selection import pick
from armwright.runs.folder import read_run
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with motors whose objectives are error and mass."""
    folder = tmp_path_factory.mktemp("compliance") / "run"
    task = Task.model_validate(
        {"name": "two", "targets": [[0.3, 0.1, 0.2], [0.2, -0.2, 0.1]], "objectives": ["worst_error", "mass"]}
    )
    space = DesignSpace.model_validate({"actuators": ["XM540-W270", "XM430-W350"], "origin_z": [0.0, 0.0]})
    aw.optimize(
        aw.Problem(task, space), proposer="none", sampler="random", n_init=10, n_total=10, verify=False, out=folder
    )
    return folder


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
    with pytest.raises(SettingsError, match="deflection is not known: no section and material of the links are stated"):
        pick(history, [read_condition("deflection <= 0.001")])
    with pytest.raises(SettingsError, match=r'unknown quantity "backlash_eror".*Did you mean "backlash_error"'):
        pick(history, [read_condition("backlash_eror <= 0.001")])
