"""The public inverse kinematics against Pinocchio's forward kinematics, and its promises."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

import armwright as aw
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.evaluation import evaluate_arrays
from armwright.problem.scene import Scene
from armwright.robot.arm import Arm
from armwright.tasks.targets import ALIGNED, AXIS, ORIENTATION, position_targets
from tests.support.arms import general_arms, paper_arms
from tests.support.exported_arms import MIXED, moving, odd_arms, peer_of
from tests.support.reference_kinematics import Array
from tests.support.robots import robot

ROUNDING = 1e-5  # [m] or [rad] of float32 kinematics


def reachable(arm: Arm, n: int, seed: int = 0) -> tuple[Array, Array]:
    """Positions (n, 3) and orientations (n, 3, 3) of the tip at random postures."""
    peer, rng = peer_of(arm), np.random.default_rng(seed)
    limits = [(joint.lower, joint.upper) for _, joint in moving(arm)]
    tips = np.array([peer.tip(q) for q in rng.uniform(*np.transpose(limits), (n, len(limits)))])
    return tips[:, :3, 3], tips[:, :3, :3]


def angle_between(first: Array, second: Array) -> float:
    return float(np.linalg.norm(pinocchio.log3(first.T @ second)))


def test_errors_are_those_of_pinocchio_and_limits_hold() -> None:
    for arm in [*odd_arms(3, 6, 1), *general_arms(3, 5, 2), MIXED]:
        positions, orientations = reachable(arm, 12)
        own = [number - 1 for number, _ in moving(arm)]
        fixed = [index for index in range(len(arm.joints)) if index not in own]
        for directions in ({}, {"axes": 3.0 * orientations[:, :, 2]}, {"orientations": orientations}):
            solutions = aw.solve(arm, positions, restarts=2, **directions)
            q = solutions.q[0]
            assert q.shape == (12, len(arm.joints))
            assert not q[:, fixed].any()
            for index in own:
                assert np.all((arm.joints[index].lower <= q[:, index]) & (q[:, index] <= arm.joints[index].upper))
            for pose in range(12):
                tip = peer_of(arm).tip(q[pose, own])
                distance = np.linalg.norm(tip[:3, 3] - positions[pose])
                assert solutions.position_error[0, pose] == pytest.approx(distance, abs=ROUNDING)
                angle = 0.0
                if "axes" in directions:
                    z, wanted = tip[:3, 2], orientations[pose, :, 2]
                    angle = float(np.arctan2(np.linalg.norm(np.cross(z, wanted)), z @ wanted))
                elif directions:
                    angle = angle_between(tip[:3, :3], orientations[pose])
                assert solutions.angle_error[0, pose] == pytest.approx(angle, abs=1e-4)


def test_reached_is_both_errors_below_their_tolerances() -> None:
    (arm,) = paper_arms(1, 6, 3)
    positions, orientations = reachable(arm, 40)
    for tolerances in ({}, {"tolerance": 1e-6}, {"angle_tolerance": 1e-6}, {"tolerance": 0.1, "angle_tolerance": 0.1}):
        s = aw.solve(arm, positions, orientations=orientations, **tolerances)
        limits = {"tolerance": 1e-3, "angle_tolerance": 1e-3} | tolerances
        below = (s.position_error < limits["tolerance"]) & (s.angle_error < limits["angle_tolerance"])
        assert np.array_equal(s.reached, below)
    assert s.reached.mean() > 0.5


def test_restarts_never_worsen_and_find_more() -> None:
    arms = paper_arms(6, 6, 4)
    positions, orientations = reachable(arms[0], 30)
    before = aw.solve(arms, positions, orientations=orientations)
    first = before
    for restarts in (1, 2, 5, 20):
        after = aw.solve(arms, positions, orientations=orientations, restarts=restarts)
        assert np.all(after.reached[before.reached])
        assert np.array_equal(after.q[first.reached], first.q[first.reached])
        assert np.all(error(after)[~after.reached] <= error(before)[~after.reached])
        before = after
    assert after.reached[0].sum() > first.reached[0].sum()


def error(solutions: aw.Solutions) -> Array:
    return np.hypot(solutions.position_error, solutions.angle_error)


@pytest.mark.parametrize("restarts", [0, 3])
def test_batch_equals_single_to_the_bit(restarts: int) -> None:
    arms = [*paper_arms(2, 6, 5), *paper_arms(1, 4, 5), *odd_arms(2, 5, 5)]
    positions, orientations = reachable(arms[1], 11)
    batch = aw.solve(arms, positions, orientations=orientations, restarts=restarts)
    again = aw.solve(arms, positions, orientations=orientations, restarts=restarts)
    for name, values in vars(batch).items():
        assert values.tobytes() == getattr(again, name).tobytes()
    for i, arm in enumerate(arms):
        for j in range(11):
            one = aw.solve(arm, positions[j : j + 1], orientations=orientations[j : j + 1], restarts=restarts)
            dof = len(arm.joints)
            assert np.array_equal(one.q[0, 0], batch.q[i, j, :dof])
            assert not batch.q[i, j, dof:].any()
            for name in ("position_error", "angle_error", "reached"):
                assert getattr(one, name)[0, 0] == getattr(batch, name)[i, j]


def test_results_are_those_of_evaluate() -> None:
    arms = general_arms(5, 6, 6)
    positions, orientations = reachable(arms[0], 9)
    for n_angular, directions in (
        (0, {}),
        (AXIS, {"axes": orientations[:, :, 2]}),
        (ORIENTATION, {"orientations": orientations}),
    ):
        arrays = replace(position_targets(9), n_angular=np.full(9, n_angular), rotation=orientations)
        evaluation = evaluate_arrays(stack_arms(arms), Scene(positions, np.zeros(9), arrays))
        solutions = aw.solve(arms, positions, angle_tolerance=ALIGNED, **directions)
        assert np.array_equal(solutions.q, evaluation.q)
        assert np.array_equal(solutions.position_error, evaluation.position_error)
        assert np.array_equal(solutions.angle_error, evaluation.angle_error)
        assert np.array_equal(solutions.reached, ~evaluation.unreached)


@pytest.mark.parametrize("name", ["ur5_robot", "panda"])
def test_values_of_a_urdf_are_those_of_its_joints(name: str) -> None:
    """Pinocchio reads the file itself; joints that are not in the chain stay at 0."""
    read = aw.read_urdf(robot(name))
    model = pinocchio.buildModelFromUrdf(str(robot(name)))
    data, tip = model.createData(), model.getFrameId(read.tip)
    joints = [model.joints[model.getJointId(joint)] for joint in read.joints]
    own = [joint.idx_q for joint in joints]
    rng = np.random.default_rng(8)

    def pose(values: Array) -> Array:
        q = pinocchio.neutral(model)
        q[own] = values
        pinocchio.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[tip].homogeneous)

    lower, upper = model.lowerPositionLimit[own], model.upperPositionLimit[own]
    poses = np.array([pose(values) for values in rng.uniform(lower, upper, (20, len(own)))])
    solutions = aw.solve(read, poses[:, :3, 3], orientations=poses[:, :3, :3], restarts=16)
    assert solutions.reached.mean() > 0.8
    assert np.all((lower - 1e-9 <= solutions.q) & (solutions.q <= upper + 1e-9))
    for j in np.flatnonzero(solutions.reached[0]):
        found = pose(solutions.q[0, j])
        assert np.linalg.norm(found[:3, 3] - poses[j, :3, 3]) < 2e-3
        assert angle_between(found[:3, :3], poses[j, :3, :3]) < 2e-3


GOOD = [[0.2, 0.1, 0.3]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"positions": [0.2, 0.1, 0.3]}, r"positions: expected shape \(n, 3\), n >= 1, got \(3,\)"),
        ({"positions": [*GOOD, [0.1, np.nan, 0.0]]}, "positions: row 1 is not finite"),
        ({"axes": [[0, 0, 1], [0, 0, 1]]}, r"axes: expected shape \(1, 3\)"),
        ({"axes": [[0, 0, 0]]}, "axes: row 0 has no direction"),
        ({"orientations": [[0, 0, 0, 1]]}, r"orientations: expected shape \(1, 3, 3\).* got \(1, 4\)"),
        ({"orientations": [2 * np.eye(3)]}, "orientations: expected rotation matrices"),
        ({"axes": GOOD, "orientations": [np.eye(3)]}, "expected axes or orientations, got both"),
        ({"angle_tolerance": np.nan}, "angle_tolerance"),
        ({"arms": ["ur5.urdf"]}, r"expected arms, got 'ur5.urdf'; try aw.read_urdf"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    (arm,) = paper_arms(1, 4, 10)
    with pytest.raises(aw.UsageError, match=message):
        aw.solve(**({"arms": arm, "positions": GOOD} | arguments))  # type: ignore[arg-type]
