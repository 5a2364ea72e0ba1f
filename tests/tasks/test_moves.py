"""Straight moves against Pinocchio and a closed form."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import RunConflictError, SettingsError, TaskError
from armwright.kinematics.clearance import clearances
from armwright.kinematics.ik import solve_postures
from armwright.kinematics.paths import UPDATES_OF_STEP
from armwright.problem.evaluation import Evaluation, evaluate
from armwright.problem.objectives import MOVE_QUANTITIES, UNCOVERED_FRACTION, named_objectives
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.batch_builder import stack_designs
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.moves import Moves, sample_moves
from armwright.tasks.obstacles import Sphere
from armwright.tasks.task import Task
from armwright.yaml_documents import parse_document
from tests.support.arms import moving_arms

Array = NDArray[np.float64]
CORNERS = ((0.35, 0.1, 0.3), (0.1, 0.45, 0.2), (0.3, -0.3, 0.3))
SLIDING = DesignSpace.model_validate(
    {"joints": 5, "joint_types": ["P", "R", "X", "Z"]} | {"joint_types": ["P", "R", "S"]}
)


def task(**more: Any) -> Task:
    return Task.model_validate({"name": "moves", "targets": CORNERS, **more})


def planar(*lengths: float, limit: float = 3.1) -> Arm:
    links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in lengths)
    return Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", "y", -limit, limit) for _ in lengths), links)


def pinocchio_of(arm: Arm, payload: float) -> tuple[Any, Any]:
    carried = Link(offset=(0.0, 0.0, 0.0), mass=payload, com=(0.0, 0.0, 0.0), radius=0.01)
    loaded = Arm(arm.base, (*arm.joints, Joint("fixed", "x")), (*arm.links, carried))
    model = pinocchio.buildModelFromXML(to_urdf(loaded))
    return model, model.createData()


# Where the samples are


def test_lines_are_cut_into_equal_steps() -> None:
    targets = np.array(CORNERS)
    lines = sample_moves(Moves(((0, 1), (1, 2), (2, 0)), 0.03), targets)
    lengths = [np.linalg.norm(np.subtract(CORNERS[a], CORNERS[b])) for a, b in ((0, 1), (1, 2), (2, 0))]
    assert np.array_equal(np.diff(lines.first), [np.ceil(length / 0.03) + 1 for length in lengths])
    for (start, end), first, beyond in zip(((0, 1), (1, 2), (2, 0)), lines.first, lines.first[1:], strict=False):
        points = lines.points[first:beyond]
        assert np.array_equal(points[0], targets[start])
        assert np.array_equal(points[-1], targets[end])
        way = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert way == pytest.approx(way[0])
        assert way[0] <= 0.03
        assert way[0] * len(way) / (len(way) - 1) > 0.03, "no more of them than are needed"
    assert len(sample_moves(Moves(((0, 1),), 0.1), np.array([[0.0, 0, 0], [0.3, 0, 0]]))) == 4, (
        "a whole number of steps"
    )


# What an arm does along them


@pytest.mark.parametrize("arms", [moving_arms(30, 5, 1), [SLIDING.arm(design) for design in SLIDING.sample(30, 2)]])
def test_tip_and_torque_along_a_move_agree_with_pinocchio(arms: list[Arm]) -> None:
    payload = np.array([0.3, 1.2, 0.0])
    evaluation = evaluate(arms, CORNERS, payload=payload, moves=Moves(((0, 1), (2, 0))))
    paths = evaluation.paths
    assert np.array_equal(np.unique(paths.payload[: paths.samples.first[1]]), [1.2]), "the heavier of both"
    assert np.array_equal(np.unique(paths.payload[paths.samples.first[1] :]), [0.3])
    for row, arm in enumerate(arms):
        moving = np.array([joint.kind != "fixed" for joint in arm.joints])
        load = 9.81 * (sum(link.total_mass for link in arm.links) + 1.2) * max(1.0, arm.reach)
        for kg in (1.2, 0.3):
            model, data = pinocchio_of(arm, kg)
            for k in np.flatnonzero(paths.payload == kg)[::3]:
                q = paths.q[row, k, : len(arm.joints)][moving]
                pinocchio.framesForwardKinematics(model, data, q)
                assert paths.reached[row, k] == pytest.approx(data.oMf[model.getFrameId("tip")].translation, abs=2e-5)
                torque = pinocchio.computeGeneralizedGravity(model, data, q)
                ours = paths.joint_torques[row, k, : len(arm.joints)][moving]
                assert ours == pytest.approx(torque, abs=1e-5 * load)
    assert paths.error == pytest.approx(np.linalg.norm(paths.reached - paths.samples.points, axis=-1))


def test_planar_move_matches_the_closed_form() -> None:
    """The law of cosines gives both elbows; the arm keeps its initial one."""
    a, b = 0.3, 0.25
    targets = np.array([[0.2, 0.0, 0.2], [0.35, 0.0, -0.2]])
    evaluation = evaluate([planar(a, b)], targets, moves=Moves(((0, 1),), 0.01))
    paths = evaluation.paths
    x, z = paths.samples.points[:, 0], paths.samples.points[:, 2]
    elbow = np.arccos((x**2 + z**2 - a**2 - b**2) / (2 * a * b))
    elbow *= np.sign(evaluation.q[0, 0, 1])
    shoulder = np.arctan2(x, z) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
    assert paths.error.max() < 1e-4
    assert paths.q[0] == pytest.approx(np.column_stack([shoulder, elbow]), abs=1e-3)
    assert paths.jumps.max() == pytest.approx(
        np.abs(np.diff(np.column_stack([shoulder, elbow]), axis=0)).max(), abs=1e-3
    )


def test_move_through_the_unreachable_centre_fails() -> None:
    arm, limit = planar(0.3, 0.2), 0.1  # reaches no nearer than 0.1 m to its base
    through = evaluate([arm], [[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]], moves=Moves(((0, 1),)))
    past = evaluate([arm], [[0.3, 0.0, 0.15], [-0.3, 0.0, 0.15]], moves=Moves(((0, 1),)))
    assert through.position_error.max() < 1e-3
    assert past.position_error.max() < 1e-3, "each of the targets by itself is reached"
    assert through.paths.error.max() >= limit - 1e-3
    assert past.paths.error.max() < 1e-3


def test_flip_is_reported_as_a_joint_jump() -> None:
    """On a line close to the base axis, the first joint makes half a turn within a few steps."""
    links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in (0.2, 0.3, 0.3))
    axes = ("z", "y", "y")
    arm = Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", axis, -3.1, 3.1) for axis in axes), links)
    targets = [[0.3, 0.02, 0.4], [-0.3, 0.02, 0.4], [0.3, 0.3, 0.4]]
    paths = evaluate([arm], targets, moves=Moves(((0, 1), (0, 2)))).paths
    turn = paths.samples.first[1]
    flips, calm = paths.jumps[0, :turn].max(), paths.jumps[0, turn:].max()
    assert flips > 0.5
    assert calm < 0.15
    assert paths.jumps[0, turn] == 0.0, "from the end of a move to the start of the next is none"


def test_moves_continue_from_sample_to_sample() -> None:
    """The result is bit-identical to solving sample after sample."""
    space = paper_space(5)
    arms = stack_designs(space, space.matrix(space.sample(40, 3)))
    targets, pairs = np.array(CORNERS), ((0, 1), (2, 1), (1, 0))
    evaluation = Problem(task(moves=[(a + 1, b + 1) for a, b in pairs], move_step=0.05), space).physics_of_arms(arms)
    paths = evaluation.paths
    for (start, _), first, beyond in zip(pairs, paths.samples.first, paths.samples.first[1:], strict=False):
        q = evaluation.q[:, start][:, None]
        assert np.array_equal(paths.q[:, first], q[:, 0])
        assert np.array_equal(paths.reached[:, first], evaluation.reached[:, start])
        assert np.array_equal(paths.joint_torques[:, first], evaluation.joint_torques[:, start])
        for k in range(first + 1, beyond):
            by_hand = solve_postures(arms, paths.samples.points[[k]], UPDATES_OF_STEP, initial_q=q)
            assert np.array_equal(paths.q[:, k], by_hand.q[:, 0])
            q = by_hand.q
    assert targets[0] == pytest.approx(paths.samples.points[0])


def test_moves_do_not_depend_on_the_batch() -> None:
    space, moves = paper_space(4), Moves(((0, 1), (1, 2)))
    arms = [space.arm(design) for design in space.sample(1500, 0)]
    many = evaluate(arms, CORNERS, moves=moves).paths
    for i in (0, 700, 1499):
        one = evaluate(arms[i : i + 1], CORNERS, moves=moves).paths
        assert np.array_equal(one.q[0], many.q[i])
        assert np.array_equal(one.joint_torques[0], many.joint_torques[i])


def test_mirrored_arms_mirror_their_moves() -> None:
    """Mirroring at y = 0 reverses rotations about x and z."""
    arms = moving_arms(60, 5, 8)
    flip = np.array([1.0, -1.0, 1.0])

    def mirrored(arm: Arm) -> Arm:
        joints = tuple(
            joint if joint.axis == "y" else replace(joint, lower=-joint.upper, upper=-joint.lower)
            for joint in arm.joints
        )
        links = tuple(
            replace(link, offset=tuple((flip * link.offset).tolist()), com=tuple((flip * link.com).tolist()))
            for link in arm.links
        )
        return Arm(tuple((flip * arm.base).tolist()), joints, links)

    moves = Moves(((0, 1), (1, 2)))
    one = evaluate(arms, CORNERS, moves=moves)
    other = evaluate([mirrored(arm) for arm in arms], flip * CORNERS, moves=moves)
    alike = np.abs(one.paths.error - other.paths.error).max(axis=1) < 1e-4
    assert alike.mean() > 0.85, "but for the few arms for which the solver is chaotic"


@pytest.mark.slow
def test_finer_steps_follow_the_line_no_worse() -> None:
    """This holds in distribution for arms that can follow the line."""
    space = paper_space(6)
    arms = [space.arm(design) for design in space.sample(400, 1)]
    shares = []
    for step in (0.04, 0.02, 0.005):
        evaluation = evaluate(arms, CORNERS, moves=Moves(((0, 1),), step))
        begins = evaluation.position_error[:, 0] < 1e-3
        shares.append((evaluation.paths.error.max(axis=1)[begins] < 1e-3).mean())
    assert begins.sum() > 60
    assert shares[0] <= shares[2] + 0.02
    assert shares[1] > 0.5


# What counts in which objective


def of_all(arms: Sequence[Arm], **how: Any) -> tuple[Evaluation, Evaluation]:
    moves = Moves(((0, 1), (1, 2), (0, 2)))
    return evaluate(arms, CORNERS, **how), evaluate(arms, CORNERS, moves=moves, **how)


def test_target_share_counts_the_moves_that_end_there() -> None:
    arms = moving_arms(50, 5, 4)
    ball = Sphere(kind="sphere", center=(0.25, 0.25, 0.25), radius=0.1)
    still, moving = of_all(arms, obstacles=[ball])
    paths = moving.paths
    own, clear = clearances(moving.arms, paths.q, [ball])
    first = paths.samples.first
    nearest = np.minimum(own, clear)
    assert np.array_equal(moving.clearance[:, 0], still.clearance[:, 0]), "no move ends at the first"
    assert np.array_equal(moving.clearance[:, 1], np.minimum(still.clearance[:, 1], nearest[:, : first[1]].min(axis=1)))
    assert np.array_equal(moving.clearance[:, 2], np.minimum(still.clearance[:, 2], nearest[:, first[1] :].min(axis=1)))
    collision, peak = named_objectives(["collision", "peak_torque"])
    assert collision(moving).sum() > collision(still).sum() + 0.1
    torque = np.abs(paths.joint_torques).max(axis=-1)
    assert peak(moving) == pytest.approx(np.maximum(peak(still), torque.max(axis=1)))
    error, jump = named_objectives(["path_error", "max_joint_step"])
    assert error(moving) == pytest.approx(paths.error.max(axis=1))
    assert jump(moving) == pytest.approx(np.abs(paths.jumps).max(axis=1))
    for name in ("position_error", "torque", "rms_torque", "unreached_targets", "worst_error"):
        (objective,) = named_objectives([name])
        assert np.array_equal(objective(moving), objective(still)), name


def test_torque_utilisation_includes_moves() -> None:
    space = DesignSpace.model_validate({"joints": 4, "actuators": ["XM430-W350"], "safety_factor": 2.0})
    designs = space.sample(40, 0)
    still = Problem(task(objectives=["torque_utilisation"]), space)
    moving = Problem(task(objectives=["torque_utilisation"], moves="in_order"), space)
    effort = designs and space.arm(designs[0]).joints[0].actuator.peak_torque / 2.0  # type: ignore[union-attr]
    expected = np.abs(moving.physics(designs).paths.joint_torques).max(axis=(1, 2)) / effort
    assert moving.evaluate(designs).values[:, 0] == pytest.approx(
        np.maximum(still.evaluate(designs).values[:, 0], expected)
    )
    assert np.any(moving.evaluate(designs).values > 1.01 * still.evaluate(designs).values)


def test_moves_are_computed_on_demand() -> None:
    designs = paper_space().sample(20, 0)
    plain, moving = Problem(task()), Problem(task(moves="in_order"))
    evaluation = moving.physics(designs)
    assert np.array_equal(moving.outcomes(evaluation).values, plain.evaluate(designs).values)
    assert "paths" not in vars(evaluation)
    assert [
        moving.uses(*MOVE_QUANTITIES),
        Problem(task(moves="in_order"), objectives=MOVE_QUANTITIES[:1]).uses(*MOVE_QUANTITIES),
    ] == [False, True]


def test_objectives_of_moves_need_moves() -> None:
    problem = Problem(task(objectives=["position_error", "path_error"]))
    with pytest.raises(SettingsError, match="need moves in the task; try moves: in_order"):
        problem.evaluate(paper_space().sample(1, 0))


def test_large_batches_equal_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem(task(moves="in_order", objectives=["position_error", "path_error"]))
    designs = problem.space.sample(50, 5)
    values = problem.evaluate(designs).values
    monkeypatch.setattr("armwright.problem.problem.POSTURES_AT_ONCE", {"cpu": 700})
    assert np.array_equal(problem.evaluate_matrix(problem.space.matrix(designs)).values, values)


# From the file on


def test_task_file_states_moves_in_either_form() -> None:
    text = "name: x\ntargets: [[0.1, 0, 0], [0.2, 0, 0], [0.3, 0.1, 0]]\nmoves: {}\nmove_step: 0.01"
    in_order = parse_document(text.format("in_order"), Task, TaskError, "it")
    pairs = parse_document(text.format("[[1, 2], [2, 3]]"), Task, TaskError, "it")
    assert in_order.straight_moves == pairs.straight_moves == Moves(((0, 1), (1, 2)), 0.01)
    assert not load_task("target-1").straight_moves


FAULTS = {
    "[[1, 4]]": "there is no target 4; targets are counted from 1 to 3",
    "[[0, 1]]": "there is no target 0; targets are counted from 1 to 3",
    "[[1, 2], [1, 2]]": r"move 2 = \[1, 2\] is given twice",
    "[[2, 2]]": "the targets are at the same position",
    "[1, 2]": "a list of pairs of targets, counted from 1",
    "[[1, 2, 3]]": "a list of pairs of targets, counted from 1",
    "[[1, 2.5]]": "a list of pairs of targets, counted from 1",
    "inorder": "moves: expected in_order or a list of pairs",
    "{1: 2}": "moves: expected in_order or a list of pairs",
    "[[1, 3]]\nmove_step: 0.0001": "2 m long, more than 200 steps of 0.0001 m; try move_step: 0.01",
    "[[1, 3]]\nmove_step: 0": "move_step",
    "[[1, 3]]\nmove_step: .nan": "move_step",
}


@pytest.mark.parametrize(("written", "words"), FAULTS.items())
def test_invalid_moves_are_refused_in_one_line(written: str, words: str) -> None:
    text = f"name: x\ntargets: [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\nmoves: {written}"
    with pytest.raises(TaskError, match=words) as refused:
        parse_document(text, Task, TaskError, "it.yaml")
    assert "\n" not in str(refused.value)


def test_moves_in_order_are_bounded() -> None:
    with pytest.raises(ValueError, match="needs at least two targets"):
        Task.model_validate({"name": "x", "targets": [[0, 0, 0]], "moves": "in_order"})
    many = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]] * 120
    many = [[x, 0.001 * i, 0.0] for i, (x, _, _) in enumerate(many)]
    with pytest.raises(ValueError, match="at most 10000 samples in all"):
        Task.model_validate({"name": "x", "targets": many, "moves": "in_order", "move_step": 0.006})


def test_suggested_step_is_accepted() -> None:
    targets = [[0.0, 0.0, 0.0], [4.4444, 0.0, 0.0]]
    with pytest.raises(ValueError, match=r"try move_step: 0\.023\b"):
        Task.model_validate({"name": "x", "targets": targets, "moves": "in_order"})
    Task.model_validate({"name": "x", "targets": targets, "moves": "in_order", "move_step": 0.023})


@pytest.mark.slow
def test_run_with_moves_from_the_command_line(in_folder: Path) -> None:
    text = f"name: line\ntargets: {[list(point) for point in CORNERS]}\nmoves: in_order\nobjectives: "
    (in_folder / "line.yaml").write_text(f"{text} [position_error, path_error]\n")
    words = ["optimize", "line.yaml", "--proposer", "rules", "--n-total", "15", "--out", "run"]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    shown = CliRunner().invoke(app, ["tasks", "line.yaml"])
    assert "straight moves between targets: 1 to 2, 2 to 3; in steps of 20 mm" in shown.output
    (in_folder / "line.yaml").write_text(f"{text} [position_error, path_error]\nmove_step: 0.01\n")
    again = CliRunner().invoke(app, words)
    assert isinstance(again.exception, RunConflictError)
    assert "move_step: 0.02 stored, 0.01 requested" in str(again.exception)
    (in_folder / "line.yaml").write_text(f"{text} [position_error, torque]\n")
    told = CliRunner().invoke(app, [*words, "--no-figures", "--out", "other"])
    assert "no objective or constraint uses the task's moves" in told.output


def test_constraints_bound_moves_and_workspaces() -> None:
    sentences = ["path_error <= 0.01", "max_joint_step <= 0.5", "uncovered_fraction <= 0.4", "manipulability >= 0.001"]
    box = {"low": (0.2, -0.2, 0.1), "high": (0.5, 0.2, 0.3), "points": 30}
    problem = Problem(
        task(moves="in_order", workspace=box, constraints=[*sentences, "anisotropy <= 0.99"]), paper_space(6)
    )
    designs = problem.space.sample(40, 1)
    evaluation, broken = problem.physics(designs), problem.evaluate(designs).violations
    assert (problem.uses(*MOVE_QUANTITIES), problem.uses(UNCOVERED_FRACTION)) == (True, True)
    measured = np.column_stack(
        [
            evaluation.paths.error.max(axis=1),
            evaluation.paths.jumps.max(axis=1),
            (evaluation.workspace_error >= 1e-3).mean(axis=1),
            -evaluation.manipulability.min(axis=1),
            1.0 - evaluation.dexterity.min(axis=1),
        ]
    )
    kept = measured <= np.array([0.01, 0.5, 0.4, -0.001, 0.99])
    assert np.array_equal(broken <= 0.0, kept)
    assert np.all((kept.sum(axis=0) > 0) & (kept.sum(axis=0) < 40)), "each is kept by some and broken by others"
