"""`armwright check`: what a task and a space mean, and what is wrong with them."""

import json
from pathlib import Path

import pytest
import yaml

from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.command_line import armwright, refused

BOX = {"kind": "box", "center": [0.2, 0.0, 0.1], "size": [0.1, 0.2, 0.3], "yaw": 0.5}


def test_check_describes_a_builtin_task_and_the_default_space() -> None:
    done = armwright("check", "target-1", "--no-picture")
    assert done.returncode == 0, done.stderr
    for text in ("8 targets", "position_error [m]", "reference point: (5, 5)", "11 free parameters", "a toy"):
        assert text in done.stdout
    assert done.stdout.endswith("task and space are valid; warnings: none\n")


def test_check_prints_json(in_folder: Path) -> None:
    (in_folder / "task.yaml").write_text(
        yaml.safe_dump({"name": "far", "targets": [[0.2, 0.0, 0.1], [9.0, 0.0, 0.0]], "obstacles": [BOX]}),
        encoding="utf-8",
    )
    (in_folder / "space.yaml").write_text(
        "joints: 3\nrestrict: {joint_1: Y}\ntie: {link_3: link_2}\n", encoding="utf-8"
    )
    done = armwright("check", "task.yaml", "--space", "space.yaml", "--json")
    record = json.loads(done.stdout)
    assert done.returncode == 2
    assert record["space"]["free_parameters"] == 7  # three of the base, two joint types, two links
    assert record["space"]["parameters"]["joint_1"] == "Y"
    assert [objective["name"] for objective in record["objectives"]] == ["position_error", "torque"]
    found = [(one["message"].split(" (")[0], one["evidence"]) for one in record["findings"]]
    assert found == [("target 2", "proven"), ("target 1", "suspected")]
    assert (in_folder / record["picture"]).is_file()
    assert "obstacles" in record["unused"][0]


def test_cycle_is_shown_with_its_durations_and_constraints(in_folder: Path) -> None:
    steps = "[{to: bin, do: pick}, {to: 2, by: line, do: place, time: 2.5}]"
    (in_folder / "task.yaml").write_text(
        "name: cell\ntargets: [{name: bin, position: [0.2, 0, 0.3], axis: [0, 0, -1]}, "
        "{position: [0, 0.2, 0.3], axis: [0, 0, -1]}]\n"
        f"cycle: {{dwell: 0.2, time: 1.5, tolerance: {{path: 0.003}}, steps: {steps}}}\n"
        "constraints: [clearance >= 0.01]\n",
        encoding="utf-8",
    )
    (in_folder / "space.yaml").write_text(
        "joints: 5\nmass: {kind: per_metre, kg: 0.5}\nactuators: [XM430-W350]\n", encoding="utf-8"
    )
    bounds = ["unreached_targets <= 0", "path_error <= 0.003", "path_angle <= 0.02", "jumps <= 0"]
    drives = ["dynamic_utilisation <= 1", "speed_utilisation <= 1", "thermal_utilisation <= 1", "voltages <= 1",
              "bearing_utilisation <= 1"]  # fmt: skip
    assert "durations: 2.5 s, 1.5 s; 0.2 s at rest" in armwright("tasks", "task.yaml").stdout
    checked = armwright("check", "task.yaml", "--space", "space.yaml", "--no-picture")
    assert checked.returncode == 0, checked.stderr
    assert not list(in_folder.glob("*.png"))
    assert "cycle: bin (pick), by a line to 2 (place), by a joint motion back to bin" in checked.stdout
    record = json.loads(armwright("check", "task.yaml", "--space", "space.yaml", "--json").stdout)
    assert record["constraints"] == ["clearance >= 0.01", *bounds, *drives]


def write(folder: Path, **keys: object) -> str:
    """Write a task file and return its name."""
    (folder / "task.yaml").write_text(yaml.safe_dump({"name": "mine", **keys}), encoding="utf-8")
    return "task.yaml"


# What an engineer's trial found to be accepted in silence

HERE = [0.4, 0.2, 0.3]
SHELF = {"kind": "box", "name": "shelf", "center": [0.4, -0.2, 0.3], "size": [0.2, 0.2, 0.2]}
NONSENSE = [
    ({"targets": [[450, 0, 100], [450, 200, 300]]}, ("all 2 targets are out of reach", "in metres", "0.45 for 450 mm")),
    (
        {
            "targets": [HERE, [0.4, -0.2, 0.3]],
            "obstacles": [SHELF],
            "constraints": ["collision <= 0", "worst_error <= 0.01"],
        },
        ("target 2 (0.4, -0.2, 0.3) m is 100 mm inside an obstacle: shelf",),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "texts"), NONSENSE)
def test_nonsense_that_is_proven_stops_every_command(
    in_folder: Path, keys: dict[str, object], texts: tuple[str, ...]
) -> None:
    for command in ("check", "design", "optimize"):
        line = refused(2, command, write(in_folder, **keys))
        for text in (*texts, "(proven)"):
            assert text in line
    assert not (in_folder / "runs").exists()


def test_every_proven_fault_is_reported_in_a_line_of_its_own(in_folder: Path) -> None:
    task = write(in_folder, targets=[HERE], constraints=["worst_error <= -1", "clearance >= 2"])
    first, second = sorted(armwright("check", task, "--no-picture").stderr.splitlines())
    assert first.startswith('armwright: constraints: no design satisfies "clearance >= 2": clearance is at most 1 m')
    assert second.startswith('armwright: constraints: no design satisfies "worst_error <= -1"')


def test_deep_check_samples_the_constraints(in_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armwright.cli.check.DEEP_SECONDS", 0.0)
    task = write(in_folder, targets=[HERE], constraints=["worst_error >= 50", "mass <= 1"])
    shallow = armwright("check", task, "--no-picture")
    assert "warnings: none" in shallow.stdout
    done = armwright("check", task, "--deep", "--no-picture")
    assert done.returncode == 0, done.stderr
    assert 'warning: no random design satisfies "worst_error >= 50"; the best has' in done.stdout
    assert "(none of 1,0" in done.stdout
    assert "mass <= 1" not in done.stdout.partition("warning:")[2]


def test_picture_has_a_known_format(in_folder: Path) -> None:
    task = write(
        in_folder,
        targets=[HERE],
        obstacles=[SHELF, {"kind": "ground"}],
        workspace={"low": [0, 0, 0], "high": [0.5, 0.5, 0.5]},
    )
    assert armwright("check", task, "--out", "mine.svg").returncode == 0
    assert (in_folder / "mine.svg").read_text(encoding="utf-8").startswith("<?xml")
    assert "expected a name that ends in .png, .pdf, .svg" in refused(2, "check", task, "--out", "mine.doc")


def test_samples_before_a_search_do_not_change_it(in_folder: Path) -> None:
    task = write(in_folder, targets=[HERE], constraints=["worst_error <= 0.5"])
    options = ("--n-init", "4", "--n-total", "6", "--proposer", "rules", "--seed", "3", "--no-figures")
    armwright("optimize", task, *options, "--out", "sampled")
    problem = Problem(load_task(in_folder / task))
    run = optimize(problem, proposer="rules", n_init=4, n_total=6, seed=3)
    _, sampled = read_run(in_folder / "sampled")
    assert [(trial.design, trial.values) for trial in sampled] == [(trial.design, trial.values) for trial in run.trials]
