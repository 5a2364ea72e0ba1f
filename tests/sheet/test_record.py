"""Data sheets of designs and of existing arms, against Pinocchio, MuJoCo and designs edited by hand."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest

import armwright as aw
from armwright.existing import base_placement
from armwright.existing.base_placement import Placement
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.drive_quantities import (
    bearing_utilisation,
    dynamic_utilisation,
    speed_utilisation,
    thermal_utilisation,
    tilting_moment,
    torque_utilisation,
)
from armwright.problem.failure import Failure
from armwright.proof.design_record import compute_facts
from armwright.robot.mjcf import to_mjcf
from armwright.robot.mounting import Mounting, mounted
from armwright.robot.urdf_reader import read_urdf
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.sheet.design_sheet import design_sheet, sheet_of
from armwright.sheet.record import DataSheet
from armwright.sheet.tables import verdict_of
from armwright.sheet.urdf_sheet import urdf_sheet
from armwright.sheet.writer import sheet_record
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests.proof.test_simulation import DESK
from tests.support.command_line import armwright, refused
from tests.support.robots import robot

SPACE: dict[str, Any] = {
    "joints": 4,
    "joint_types": ["Y", "P"],
    "restrict": {"joint_1": "Y", "joint_2": "P", "joint_3": "P", "joint_4": "P", "link_4": [0.05, 0.055]},
    "tie": {"link_3": "link_2"},
    "origin_z": [0.05, 0.2],
    "column": {"price_per_metre": 30.0},
    "link": [0.05, 0.2],
    "link_section": {
        "tubes": [[0.02, 0.001], [0.03, 0.002]],
        "material": {"density": 2700, "youngs": 70.0e9, "shear": 27.0e9, "price_per_kg": 12.0},
    },
    "actuators": ["XM540-W270", "XM430-W350"],
    "bracket_mass": 0.02,
    "supply": 12.0,
}
NUMBER = 0  # a design that follows the cycle


def made(folder: Path, task: Mapping[str, Any], space: Mapping[str, Any], *lengths: float) -> Path:
    """Return a run whose first design has links of these lengths [m], if any."""
    problem = aw.Problem(Task.model_validate(task), DesignSpace.model_validate(space))
    first = [problem.space.clipped((0.0, 0.0, 0.05), "YPPP", lengths)] if lengths else []
    options: Any = {"proposer": "none", "n_init": 6, "n_total": 1, "seed": 2, "verify": False}
    aw.optimize(problem, initial_designs=first, out=folder, **options)
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    task = {**DESK, "objectives": ["worst_error", "mass"], "constraints": ["mass <= 3"]}
    return made(tmp_path_factory.mktemp("sheets") / "run", task, SPACE, 0.1, 0.2, 0.2, 0.05)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a task without a cycle, in a space without actuators."""
    return made(tmp_path_factory.mktemp("sheets") / "plain", {"name": "one", "targets": [[0.3, 0.0, 0.2]]}, {})


@pytest.fixture(scope="module")
def history(run: Path) -> History:
    return read_run(run)[1]


@pytest.fixture(scope="module")
def sheet(run: Path) -> DataSheet:
    return design_sheet(run, NUMBER)


def test_masses_are_those_of_the_exported_models(sheet: DataSheet, history: History) -> None:
    arm = history.member(NUMBER).arm
    assert sum(line.mass for line in sheet.masses) == pytest.approx(sheet.facts["mass"].value)
    moving = sheet.facts["mass"].value - arm.standing_mass  # what stands has no mass in any format
    pin = pinocchio.buildModelFromXML(to_urdf(arm))
    assert sum(inertia.mass for inertia in pin.inertias[1:]) == pytest.approx(moving)
    assert mujoco.MjModel.from_xml_string(to_mjcf(arm)).body_mass.sum() == pytest.approx(moving)


def test_reach_is_that_of_the_drawing(sheet: DataSheet, history: History) -> None:
    """No posture of Pinocchio is outside of an outline: tests/kinematics/test_reach_outline.py."""
    arm = history.member(NUMBER).arm
    outline = np.array(sheet.drawing.top.points) - arm.base[:2]
    assert np.linalg.norm(outline, axis=1).max() == pytest.approx(sheet.over_reach[-1].distance, rel=1e-3)


def test_utilisation_of_joints_is_that_of_the_quantities(sheet: DataSheet, history: History) -> None:
    evaluation = history.evaluation([NUMBER])
    peaks = [joint.peak_utilisation or 0.0 for joint in sheet.joints]
    both = max(float(torque_utilisation(evaluation)[0]), float(dynamic_utilisation(evaluation)[0]))
    assert max(peaks) == pytest.approx(both)
    for key, quantity in (
        ("thermal_utilisation", thermal_utilisation),
        ("speed_utilisation", speed_utilisation),
        ("tilting_moment", tilting_moment),
        ("bearing_utilisation", bearing_utilisation),
    ):
        values = [getattr(joint, key) for joint in sheet.joints]
        assert max(values) == pytest.approx(float(quantity(evaluation)[0])), key


def test_infeasible_designs_state_what_they_violate(run: Path, history: History) -> None:
    sheet, violations = design_sheet(run, 3), history.trials[3].violations
    assert len(sheet.violated) == sum(violation > 0.0 for violation in violations) > 0
    assert verdict_of(sheet).startswith(f"Infeasible: {sheet.violated[0]}")


def test_failed_evaluations_give_a_sheet_without_objectives(history: History) -> None:
    trial = replace(
        history.trials[NUMBER], number=0, values=(np.inf, np.inf), failure=Failure("exception", "no licence")
    )
    failed = replace(history, trials=[trial])
    sheet = sheet_of(failed, failed.member(0), compute_facts(failed, [0])[0], {})
    assert sheet.violated == ("its evaluation failed: no licence",)
    assert {value for value, _ in sheet.objectives.values()} == {None}
    json.dumps(sheet_record(sheet), allow_nan=False)


def test_price_is_the_sum_of_the_parts(sheet: DataSheet) -> None:
    stated = [part.price for part in sheet.parts if part.price is not None]
    assert sheet.facts["price"].value == pytest.approx(sum(stated))
    motors = [part for part in sheet.parts if part.part.startswith("XM")]
    assert sum(part.count for part in motors) == 4
    assert all(part.source.startswith("https://") and "robotis.us" in part.price_source for part in motors)
    (brackets,) = [part for part in sheet.parts if part.part == "brackets and screws"]
    assert brackets.price is None


def test_unknown_values_are_not_stated_and_never_zero(plain: Path) -> None:
    sheet = design_sheet(plain, 2)
    for key in ("payload_at_full_reach", "deflection", "backlash_error", "cycle_time", "price", "peak_current"):
        assert sheet.facts[key].value is None
    assert sheet.facts["cycle_time"].reason == "the task has no cycle"
    assert sheet.facts["price"].reason == "no actuators are named"
    assert all(line.payload is None for line in sheet.over_reach)


def test_sheet_of_a_urdf_is_that_of_the_design_that_it_was_written_from(
    sheet: DataSheet, history: History, tmp_path: Path
) -> None:
    arm = history.member(NUMBER).arm
    file = tmp_path / "arm.urdf"
    file.write_text(to_urdf(arm), encoding="utf-8")
    existing = urdf_sheet(read_urdf(file, tip="tip"))
    assert existing.over_reach[-1].distance == pytest.approx(sheet.over_reach[-1].distance, rel=1e-3)
    assert existing.facts["payload_at_full_reach"].value == pytest.approx(
        sheet.facts["payload_at_full_reach"].value, rel=1e-2
    )
    assert existing.facts["price"].value is None
    assert existing.facts["price"].reason == "a URDF states no price; try --price"


def test_joints_of_a_urdf_are_stated_as_it_counts_them() -> None:
    """Limits and used ranges, in a place where the base is turned, against Pinocchio's reading of the file."""
    described = read_urdf(robot("panda"))
    task = Task(name="feeder", targets=((0.4, -0.2, 0.3), (0.4, 0.2, 0.3), (0.1, 0.4, 0.5)))
    problem = aw.Problem(task, DesignSpace.model_validate(SPACE))
    there = mounted(described, Mounting((0.0, 0.0, 0.0), 0.4))
    sheet = urdf_sheet(Placement(problem, there, Mounting((0.0, 0.0, 0.0), 0.4)))
    model = pinocchio.buildModelFromUrdf(str(robot("panda")))
    places = [model.joints[model.getJointId(joint.name)].idx_q for joint in sheet.joints]
    assert [joint.lower for joint in sheet.joints] == pytest.approx(model.lowerPositionLimit[places], abs=1e-12)
    assert [joint.upper for joint in sheet.joints] == pytest.approx(model.upperPositionLimit[places], abs=1e-12)
    q = problem.physics(stack_arms([there.arm])).q[0].astype(np.float64)
    assert [joint.used for joint in sheet.joints] == [
        pytest.approx(ends) for ends in zip(q.min(axis=0), q.max(axis=0), strict=True)
    ]
    for joint in sheet.joints:
        assert joint.used is not None
        assert joint.unused == pytest.approx((joint.used[0] - joint.lower, joint.upper - joint.used[1]), abs=1e-12)
    assert (sheet.base_position, sheet.base_yaw) == ((0.0, 0.0, 0.0), 0.4)
    assert not sheet.drawing.is_at_zero  # the fourth joint cannot be at 0
    values = np.clip(pinocchio.neutral(model), model.lowerPositionLimit, model.upperPositionLimit)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, values)
    tip = data.oMf[model.getFrameId(described.tip, pinocchio.FrameType.BODY)].translation
    end = pinocchio.utils.rotate("z", 0.4) @ tip
    assert sheet.drawing.links[-1][2] == pytest.approx(end, abs=1e-6)
    assert sheet.payload is None
    assert all(sheet.facts[name].reason for name in ("cycle_time", "deflection"))
    assert sheet.facts["worst_error"].value is not None


def test_efforts_and_speeds_that_the_cycle_exceeds_are_stated() -> None:
    """A URDF states no corner speed, so that its utilisation is unknown, but its effort and its speed are limits."""
    points = ((0.5, -0.3, 0.2), (0.5, 0.3, 0.2))
    cycle = {"time": 0.2, "steps": [{"to": 1}, {"to": 2}]}
    task = Task(name="fast", targets=points, payload=2.0, cycle=cycle)  # type: ignore[arg-type]
    problem = aw.Problem(task, DesignSpace(joints=3))
    arm = replace(read_urdf(robot("ur5_robot")).arm, safety_factor=1.5)
    described = replace(read_urdf(robot("ur5_robot")), arm=arm)
    sheet = urdf_sheet(Placement(problem, described, Mounting()))
    evaluation = problem.physics(stack_arms([arm]))
    torque = np.abs(evaluation.loads.torques[0]).max(axis=(0, 1))
    speed = np.abs(evaluation.loads.speeds[0]).max(axis=(0, 1))
    efforts = np.array([joint.effort for joint in arm.joints])
    speeds = np.array([joint.speed for joint in arm.joints])
    assert [joint.peak_utilisation for joint in sheet.joints] == pytest.approx(1.5 * torque / efforts, rel=1e-5)
    assert (1.5 * torque / efforts).max() > 1.0
    assert (speed / speeds).max() > 1.0
    effort, fastest = sheet.violated[-2:]
    assert effort.startswith(f"an effort of its file (along the cycle it needs {(1.5 * torque / efforts).max():.0%}, ")
    assert fastest == f"a speed of its file (along the cycle it needs {(speed / speeds).max():.0%})"


def test_command_places_an_existing_arm_on_a_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base_placement, "GENERATIONS", 5)  # which is enough to report a place
    for place, options in (
        ("the best of 1,500 places", ()), ("base at (-0.2, 0, 0) m, turned by 30°", ("--base", "-0.2,0,0,30")),
    ):  # fmt: skip
        asked = ("--task", "target-1", *options, "--price", 15000, "--out", tmp_path, "--json")
        found = json.loads(armwright("datasheet", robot("panda"), *asked).stdout)
        assert place in found["assumptions"]["place"]
        assert (found["name"], found["facts"]["price"]["value"]) == ("panda on target-1", 15000.0)
        assert list(found["objectives"]) == ["position_error", "torque"]


@pytest.mark.slow
def test_command_writes_html_and_json(run: Path) -> None:
    done = armwright("datasheet", run, "--design", NUMBER)
    files = [Path(line) for line in done.stdout.splitlines()]
    assert [file.name for file in files] == ["datasheet.html", "datasheet.json"]
    assert {file.parent for file in files} == {run / "designs" / f"{NUMBER:04d}"}
    record = json.loads(files[1].read_text(encoding="utf-8"))
    assert record["design"] == NUMBER
    assert record["facts"]["reach"]["unit"] == "m"
    assert files[0].read_text(encoding="utf-8").startswith("<!doctype html>")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--base", "0,0,0"), "--base 0,0,0: expected a task, too; try --task TASK"),
        (("--space", "desk"), "--space desk: expected a task, too; try --task TASK"),
        (("--price", "-3"), "price: expected a finite number of at least 0 USD, got -3"),
        (("--price", "nan"), "price: expected a finite number of at least 0 USD, got nan"),
        (("--design", "2"), "--design 2: expected a run folder, got"),
    ],
)
def test_wrong_options_of_an_existing_arm_get_one_line(options: tuple[str, str], message: str) -> None:
    assert message in refused(2, "datasheet", robot("ur5_robot"), *options)


def test_wrong_options_of_a_run_get_one_line(run: Path) -> None:
    assert "has the designs 0 to 6" in refused(2, "datasheet", run, "--design", 99)
    assert "expected a URDF, got the run" in refused(2, "datasheet", run, "--tip", "tool0")
