"""Targets with orientations, weights and tolerances."""

import numpy as np
import pinocchio
import pytest

from armwright.exceptions import SettingsError, TaskError
from armwright.problem.arm_quantities import unreached_targets
from armwright.problem.evaluation import evaluate
from armwright.problem.objectives import OBJECTIVES, named_objectives
from armwright.problem.problem import Problem
from armwright.problem.unreached_reason import unreached_reason
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.rotations import rotation_from_rpy
from armwright.spaces.design_space import paper_space
from armwright.tasks.targets import Target
from armwright.tasks.task import Task
from armwright.yaml_documents import parse_document

RECORDS = """
name: insert
targets:
  - {position: [0.3, 0.0, 0.1], axis: [0, 0, -2]}
  - [0.3, 0.1, 0.4]
  - {position: [0.3, -0.2, 0.3], orientation: [1.5, 0, 1.5], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}
  - {position: [0.2, -0.2, 0.3]}
restarts: 1
"""


def task(text: str = RECORDS) -> Task:
    return parse_document(text, Task, TaskError, "insert.yaml")


def test_records_become_positions_and_arrays() -> None:
    one = task()
    assert [isinstance(target, Target) for target in one.targets] == [True, False, True, False]
    assert one.target_positions.tolist() == [[0.3, 0.0, 0.1], [0.3, 0.1, 0.4], [0.3, -0.2, 0.3], [0.2, -0.2, 0.3]]
    target_arrays = one.target_arrays
    assert target_arrays.n_angular.tolist() == [2, 0, 3, 0]
    assert target_arrays.tolerance.tolist() == [1e-3, 1e-3, 2e-3, 1e-3]
    assert target_arrays.angle_tolerance == pytest.approx([np.pi / 180, np.pi / 180, 0.05, np.pi / 180])
    assert target_arrays.weight.tolist() == [1, 1, 2, 1]
    assert target_arrays.rotation[0][:, 2] == pytest.approx([0, 0, -1])
    assert np.allclose(target_arrays.rotation @ target_arrays.rotation.swapaxes(1, 2), np.eye(3))
    assert (target_arrays.restarts, one.is_plain) == (1, False)


def test_roll_pitch_yaw_follow_urdf() -> None:
    for angles in np.random.default_rng(0).uniform(-np.pi, np.pi, (50, 3)):
        assert rotation_from_rpy(*angles) == pytest.approx(pinocchio.rpy.rpyToMatrix(*angles))


def test_task_round_trips() -> None:
    one = task()
    written = one.model_dump(mode="json")
    assert written["targets"][:2] == [{"position": [0.3, 0.0, 0.1], "axis": [0.0, 0.0, -2.0]}, [0.3, 0.1, 0.4]]
    assert written["targets"][3] == [0.2, -0.2, 0.3], "a record that says no more than a point is one"
    assert Task(**written) == one
    assert one != task(RECORDS.replace("-2]", "2]"))
    assert one.model_copy(update={"name": "other"}).targets == one.targets


def test_target_with_only_a_position_is_a_point() -> None:
    record = task("name: a\ntargets: [{position: [0.1, 0.2, 0.3], weight: 1}]")
    assert record == task("name: a\ntargets: [[0.1, 0.2, 0.3]]")
    assert record.is_plain


def test_orientation_counts_only_for_oriented_targets() -> None:
    assert [o.name for o in Problem(task()).objectives] == ["position_error", "torque", "orientation_error"]
    with pytest.raises(SettingsError, match=r"orientation_error needs a target with an axis .* task a has none"):
        Problem(task("name: a\ntargets: [[0, 0, 1]]"), objectives=named_objectives(["orientation_error"]))


def test_objectives_use_weights_and_tolerances() -> None:
    problem = Problem(task(), paper_space(6))
    found = problem.physics(problem.space.sample(200, 0))
    weight = np.array([1.0, 1.0, 2.0, 1.0])
    assert OBJECTIVES["position_error"](found) == pytest.approx(found.position_error @ weight)
    assert OBJECTIVES["orientation_error"](found) == pytest.approx(found.angle_error @ weight)
    assert np.array_equal(OBJECTIVES["worst_angle"](found), found.angle_error.max(axis=1))
    assert np.array_equal(OBJECTIVES["worst_error"](found), found.position_error.max(axis=1))
    assert not found.angle_error[:, [1, 3]].any()
    missed = (found.position_error >= [1e-3, 1e-3, 2e-3, 1e-3]) | (
        found.angle_error >= found.target_arrays.angle_tolerance
    )
    assert np.array_equal(unreached_targets(found), missed.sum(axis=1))
    anywhere = Task(name="a", targets=(Target(position=(0.3, 0.0, 0.3), axis=(0, 0, -1), tolerance=100.0),))
    found = evaluate([problem.arm(design) for design in problem.space.sample(50, 0)], anywhere)
    assert found.position_error.max() > 0.1
    assert 0.5 < 1.0 - unreached_targets(found).mean() < 1.0, "the axis alone counts, and most arms can point there"


def test_reasons_of_missed_targets() -> None:
    links = (uniform_link((0, 0, 0.3), 0.1, 0.01),) * 2
    arm = Arm((0.0, 0.0, 0.0), (Joint("revolute", "y", -0.5, 2.0), Joint("revolute", "y", -2.0, 2.0)), links)
    one = Task(
        name="a",
        targets=(
            (0.3, 0.0, 0.3),
            (1.0, 0.0, 0.0),
            (-0.4, 0.0, 0.1),
            Target(position=(0.3, 0.0, 0.3), axis=(0, 1, 0)),
        ),
    )
    found = evaluate(arm, one)
    reached, far, limited, askew = (unreached_reason(arm, found, 0, target) for target in range(4))
    assert reached == ""
    assert far.startswith(f"{1e3 * found.position_error[0, 1]:.1f} mm: out of reach by 0.400 m")
    assert "out of reach" not in limited
    assert "joint 1 at its lower limit" in limited
    assert " mm and " in askew
    assert f"{np.degrees(found.angle_error[0, 3]):.1f}°" in askew
