"""`armwright check`: what a task and a space mean, and warnings from geometry."""

import json
from pathlib import Path

import pytest
import yaml

from armwright.cli.check import contains, free_parameters, geometry_warnings
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.task import Task
from tests.support.command_line import armwright, refused

BOX = {"kind": "box", "center": [0.2, 0.0, 0.1], "size": [0.1, 0.2, 0.3], "yaw": 0.5}
SPHERE = {"kind": "sphere", "center": [0.0, 0.0, 0.5], "radius": 0.1}
CYLINDER = {"kind": "cylinder", "center": [0.0, 0.4, 0.1], "radius": 0.1, "height": 0.4, "axis": "x"}
GROUND = {"kind": "ground", "z": -0.1}


def task_of(targets: list[list[float]], **keys: object) -> Task:
    return Task.model_validate({"name": "checked", "targets": targets, **keys})


def test_check_describes_a_builtin_task_and_the_default_space() -> None:
    done = armwright("check", "target-1")
    assert done.returncode == 0, done.stderr
    for text in ("8 targets", "position_error [m]", "reference point: (5, 5)", "11 free parameters", "a toy"):
        assert text in done.stdout
    assert done.stdout.endswith("task and space are valid; warnings: none\n")


def test_check_prints_json(in_folder: Path) -> None:
    (in_folder / "task.yaml").write_text(
        yaml.safe_dump({"name": "far", "targets": [[0.2, 0.0, 0.1], [9.0, 0.0, 0.0]], "obstacles": [BOX]})
    )
    (in_folder / "space.yaml").write_text("joints: 3\nrestrict: {joint_1: Y}\ntie: {link_3: link_2}\n")
    record = json.loads(armwright("check", "task.yaml", "--space", "space.yaml", "--json").stdout)
    assert record["space"]["free_parameters"] == 7  # three of the base, two joint types, two links
    assert record["space"]["parameters"]["joint_1"] == "Y"
    assert [objective["name"] for objective in record["objectives"]] == ["position_error", "torque"]
    assert [line.split(" (")[0] for line in record["warnings"]] == ["target 1", "target 2"]
    assert "obstacles" in record["unused"][0]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("name: bad\ntargets: []\n", "targets is empty"),
        ("name: bad\ntargets: [[0.1, 0, 0.1]]\nobjectives: [position_error, price]\n", "needs actuators"),
        ("name: bad\ntargets: [[0.1, 0, 0.1]]\nconstraints: [mass < 3]\n", "mass < 3"),
    ],
)
def test_check_reports_an_invalid_task_in_one_line(in_folder: Path, text: str, reason: str) -> None:
    (in_folder / "bad.yaml").write_text(text)
    assert reason in refused(2, "check", "bad.yaml")


def test_targets_beyond_the_longest_arm_are_warned_of() -> None:
    space = paper_space(joints=4)  # bases within 1 m of the origin along each axis, arms up to 1.2 m
    task = task_of([[2.19, 0.0, 0.0], [2.21, 0.0, 0.0], [0.0, 0.0, -2.3]])
    assert [line.split(" (")[0] for line in geometry_warnings(Problem(task, space))] == ["target 2", "target 3"]


@pytest.mark.parametrize(
    ("obstacle", "inside", "outside"),
    [
        (BOX, (0.2, 0.0, 0.2), (0.25, 0.09, 0.1)),  # the corner leaves the turned box
        (SPHERE, (0.0, 0.05, 0.55), (0.08, 0.08, 0.5)),
        (CYLINDER, (0.15, 0.4, 0.1), (0.0, 0.4, 0.25)),
        (GROUND, (3.0, 3.0, -0.2), (0.0, 0.0, 0.0)),
    ],
)
def test_obstacle_contains_points_inside_it(
    obstacle: dict[str, object], inside: tuple[float, float, float], outside: tuple[float, float, float]
) -> None:
    (read,) = task_of([[0.0, 0.0, 0.0]], obstacles=[obstacle]).obstacles
    assert contains(read, inside)
    assert not contains(read, outside)


def test_fixed_and_tied_parameters_are_not_free() -> None:
    space = DesignSpace.model_validate({"origin_z": [0.0, 0.0], "tie": {"link_2": "link_1"}})
    names = {parameter.name for parameter in free_parameters(space)}
    assert names == {p.name for p in space.parameters} - {"origin_z", "link_2"}


def test_cycle_is_shown_with_its_durations_and_constraints(in_folder: Path) -> None:
    steps = "[{to: bin, do: pick}, {to: 2, by: line, do: place, time: 2.5}]"
    (in_folder / "task.yaml").write_text(
        "name: cell\ntargets: [{name: bin, position: [0.2, 0, 0.3], axis: [0, 0, -1]}, "
        "{position: [0, 0.2, 0.3], axis: [0, 0, -1]}]\n"
        f"cycle: {{dwell: 0.2, time: 1.5, tolerance: {{path: 0.003}}, steps: {steps}}}\n"
        "constraints: [clearance >= 0.01]\n"
    )
    (in_folder / "space.yaml").write_text("joints: 5\nactuators: [XM430-W350]\n")
    bounds = ["unreached_targets <= 0", "path_error <= 0.003", "path_angle <= 0.02", "jumps <= 0"]
    drives = ["dynamic_utilisation <= 1", "speed_utilisation <= 1", "thermal_utilisation <= 1", "voltages <= 1"]
    shown = armwright("tasks", "task.yaml").stdout
    assert "cycle: bin (pick), by a line to 2 (place), by a joint motion back to bin" in shown
    assert "durations: 2.5 s, 1.5 s; 0.2 s at rest after each pick and place" in shown
    assert f"constraints of the cycle: {', '.join(bounds)}\n" in shown
    checked = armwright("check", "task.yaml", "--space", "space.yaml")
    assert checked.returncode == 0, checked.stderr
    assert f"constraints of the cycle: {', '.join([*bounds, *drives])}\n" in checked.stdout
    record = json.loads(armwright("check", "task.yaml", "--space", "space.yaml", "--json").stdout)
    assert record["constraints"] == ["clearance >= 0.01", *bounds, *drives]
