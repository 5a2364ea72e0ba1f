"""Where designs are worst along their cycles, and via points around collisions."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco  # noqa: F401 (here, since its window library starts a process, which no fast test may)
import numpy as np
import pytest

import armwright as aw
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.evaluation import Evaluation
from armwright.proof.cycle_faults import describe_faults, describe_path, path_extremes, path_record, via_point
from armwright.robot.arm import Arm, Joint, Link
from armwright.tasks.task import Task
from tests.support.command_line import armwright

UPPER, FORE = 0.4, 0.35  # [m]
SIDES = [[0.4, -0.3, 0.3], [0.4, 0.3, 0.3]]
APART = [[0.45, -0.35, 0.3], [0.45, 0.35, 0.3]]  # reached also by joints of a narrow range
SWEEP: dict[str, Any] = {"closed": False, "time": 1.0, "steps": [{"to": 1}, {"to": 2}]}
POST = {"kind": "cylinder", "name": "post", "center": [0.5, 0.0, 0.2], "radius": 0.03, "height": 0.4}


def turntable(limit: float = 2.8) -> Arm:
    """Return a turntable with a shoulder and an elbow."""
    axes, lengths = ("z", "y", "y"), (0.2, UPPER, FORE)
    joints = tuple(Joint("revolute", axis, -limit, limit) for axis in axes)
    return Arm(
        (0.0, 0.0, 0.0),
        joints,
        tuple(Link((0.0, 0.0, length), 0.01, (0.0, 0.0, length / 2), 0.02) for length in lengths),
    )


def driven(cycle: Any, targets: Any = SIDES, limit: float = 2.8, **more: Any) -> Evaluation:
    """Return the evaluation of the turntable in a cycle."""
    task = Task.model_validate({"name": "driven", "targets": targets, "cycle": cycle, **more})
    return aw.evaluate(turntable(limit), task)


def manipulability(shoulder: np.ndarray, elbow: np.ndarray) -> np.ndarray:
    """Siciliano et al., Robotics (2009), 3.2: of an anthropomorphic arm."""
    radius = UPPER * np.sin(shoulder) + FORE * np.sin(shoulder + elbow)
    return np.abs(UPPER * FORE * np.sin(elbow) * radius)


def test_values_hold_at_the_stated_places() -> None:
    evaluation = driven({"closed": False, "time": 1.0, "steps": [{"to": 1}, {"to": 2, "by": "line"}]}, obstacles=[POST])
    extremes, (arm, (path,)) = path_extremes(evaluation.paths, 0), evaluation.paths.of_arm(0)
    assert all(extreme.step == 2 and extreme.motion == "" for extreme in extremes.values())
    assert "path_angle" not in extremes
    q = {name: path.at(np.array([extreme.share]))[0, 0] for name, extreme in extremes.items()}
    assert extremes["manipulability"].value == pytest.approx(manipulability(*q["manipulability"][1:]))
    assert extremes["limit_distance"].value == pytest.approx(2.8 - np.abs(q["limit_distance"]).max())
    assert extremes["clearance"].value == pytest.approx(
        np.min(clearances(arm, q["clearance"][None, None], evaluation.obstacles)), abs=1e-6
    )
    tip = forward_kinematics(arm, q["path_error"][None, None]).tip[0, 0]
    off = np.linalg.norm((tip - SIDES[0])[[0, 2]])  # the line runs along y
    assert extremes["path_error"].value == pytest.approx(off, abs=1e-6)


def test_extremes_are_the_worst_of_all_samples() -> None:
    evaluation = driven("in_order", targets=[*SIDES, [0.2, 0.4, 0.4]])
    extremes = path_extremes(evaluation.paths, 0)
    q = np.concatenate([path.q[0] for path in evaluation.paths.of_arm(0)[1]])
    assert extremes["limit_distance"].value == pytest.approx(2.8 - np.abs(q).max())
    assert extremes["manipulability"].value == pytest.approx(manipulability(q[:, 1], q[:, 2]).min())


def test_motions_of_a_step_with_approach_are_named() -> None:
    targets = [{"position": position, "axis": [0, 0, -1]} for position in SIDES]
    steps = [{"to": 1, "do": "pick"}, {"to": 2, "do": "place"}]
    task = {"name": "driven", "targets": targets, "cycle": {"time": 1.0, "approach": 0.05, "steps": steps}}
    arm = turntable()
    wrist, hand = Joint("revolute", "y", -2.8, 2.8), Link((0.0, 0.0, 0.1), 0.01, (0.0, 0.0, 0.05), 0.02)
    arm = replace(arm, joints=(*arm.joints, wrist), links=(*arm.links, hand))
    record = path_record(aw.evaluate(arm, Task.model_validate(task)), 0)["path"]
    assert record["path_error"]["motion"] in ("line out", "line in")
    assert record["path_angle"]["motion"] in ("line out", "line in")
    assert {record[name]["step"] for name in ("path_error", "clearance", "limit_distance")} <= {1, 2}
    json.dumps(record, allow_nan=False)


def test_cycle_that_the_arm_follows_has_no_faults() -> None:
    assert describe_faults(driven(SWEEP), 0) == ""
    assert "clearance" in describe_path(path_extremes(driven(SWEEP).paths, 0))


def test_tasks_without_a_cycle_have_nothing_to_report() -> None:
    evaluation = aw.evaluate([turntable()], SIDES)
    assert (describe_path(None), describe_faults(evaluation, 0), path_record(evaluation, 0)) == ("", "", {})


def test_line_out_of_reach_is_reported_with_its_place() -> None:
    faults = describe_faults(driven("in_order", targets=[[0.5, 0.0, 0.2], [1.2, 0.0, 0.2]]), 0)
    assert re.search(r"path error \d+ mm \(step 2, at 100 %\)", faults)


def test_colliding_step_gets_a_via_point_that_avoids_the_obstacle() -> None:
    evaluation = driven(SWEEP, APART, 1.5, obstacles=[POST])  # too little to pass the post backwards
    extreme = path_extremes(evaluation.paths, 0)["clearance"]
    assert extreme.value < 0.0
    arm, (path,) = evaluation.paths.of_arm(0)
    point = via_point(arm, evaluation.paths.plan, path, extreme.share, evaluation.obstacles)
    assert point is not None
    found = solve_postures(arm, point[None], initial_q=path.at(np.array([extreme.share])))
    assert found.reached[0, 0] == pytest.approx(point, abs=1e-3)
    ends, via, share = path.at(np.array([0.0, 1.0]))[0], found.q[0, 0], np.linspace(0.0, 1.0, 301)[:, None]
    ways = np.concatenate([(1 - share) * ends[0] + share * via, (1 - share) * via + share * ends[1]])
    assert np.min(clearances(arm, ways[None], evaluation.obstacles)) > -1e-3
    text = describe_faults(evaluation, 0)
    assert f"mm deep (step 2, at {100 * extreme.share:.0f} %)" in text
    assert str([round(float(c), 3) for c in point]) in text


def test_via_point_is_not_made_up() -> None:
    wall = {"kind": "box", "center": [0.5, 0.0, 0.5], "size": [0.9, 0.1, 4.0]}
    evaluation = driven(SWEEP, APART, 1.5, obstacles=[wall])  # too little to go round the back
    assert "try a via point, a target on a way around it" in describe_faults(evaluation, 0)


def test_jumps_are_reported_by_step() -> None:
    evaluation = driven(SWEEP)
    evaluation.paths.jumps[0, 0] = True

    assert describe_faults(evaluation, 0) == "jump in step 2"
    assert path_record(evaluation, 0)["path"]["jumps"] == [2]


def test_runs_report_where_designs_are_worst(tmp_path: Path) -> None:
    def run(name: str, tolerance: float) -> tuple[dict[str, Any], Path]:
        targets, steps = [[0.2, -0.1, 0.3], [0.2, 0.1, 0.3]], [{"to": 1}, {"to": 2, "by": "line"}]
        cycle = {"steps": steps, "tolerance": {"path": tolerance}}
        task = Task.model_validate({"name": name, "targets": targets, "cycle": cycle})
        folder = tmp_path / name
        aw.optimize(aw.Problem(task, aw.paper_space(joints=4)), n_init=8, n_total=8, out=folder)
        return json.loads((folder / "summary.json").read_text(encoding="utf-8")), folder

    summary, folder = run("possible", 0.002)
    assert summary["feasibility"]["nearest"] is None
    (first, *_) = sorted(folder.glob("designs/*/design.json"))
    assert json.loads(first.read_text(encoding="utf-8"))["path"]["path_error"]["value"] <= 0.002
    assert json.loads(armwright("pick", str(folder), "--json").stdout)[0]["path"]["jumps"] == []
    summary, folder = run("impossible", 1e-8)
    assert summary["feasibility"]["nearest"]["path"]["path_error"]["value"] > 1e-8
    assert "along its cycle: " in armwright("pick", str(folder)).stderr
