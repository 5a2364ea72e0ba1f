"""Pose IK kernels against other libraries, a plain reference, and invariants.

As in tests/kinematics/test_position_ik.py, single updates are compared exactly and whole solves in distribution.
"""

from dataclasses import replace

import numpy as np
import pytest

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.evaluation import evaluate_arrays
from armwright.problem.scene import Scene
from armwright.robot.arm import Arm, Joint, MountedTool, uniform_link
from armwright.robot.urdf_writer import to_urdf
from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.targets import TargetArrays, position_targets
from tests.support import reference_kinematics as reference
from tests.support import reference_poses
from tests.support.arms import general_arms, paper_arms
from tests.support.exported_arms import peer_of
from tests.support.moving_joints import solve_postures, update_once
from tests.support.reference_kinematics import Array, random_states

KINDS = pytest.mark.parametrize("rows", [2, 3])
DOWN = (0.0, 0.0, -1.0)


def target_arrays(rows: list[int], seed: int = 0, restarts: int = 0) -> TargetArrays:
    """Targets of these kinds, with random orientations."""
    rng, plain = np.random.default_rng(seed), position_targets(len(rows), restarts)
    rotations = np.linalg.qr(rng.normal(size=(len(rows), 3, 3)))[0]
    rotations *= np.linalg.det(rotations)[:, None, None]
    return replace(plain, n_angular=np.array(rows), rotation=rotations)


def tooled_arms(n: int, dof: int, seed: int) -> list[Arm]:
    """General arms whose tools point anywhere."""
    frames = target_arrays([3] * n, seed + 1).rotation
    return [
        replace(arm, tool=MountedTool(axis=tuple(frame[:, 2].tolist()), side=tuple(frame[:, 0].tolist())))
        for arm, frame in zip(general_arms(n, dof, seed), frames, strict=True)
    ]


def tools(arms: list[Arm]) -> tuple[Array, Array]:
    return np.array([arm.tool.axis for arm in arms]), np.array([arm.tool.side for arm in arms])


@pytest.mark.parametrize("dof", range(1, 9))
def test_reference_agrees_with_pinocchio(dof: int) -> None:
    """The tool's frame and the angular Jacobian of 20 general arms."""
    arms = tooled_arms(20, dof, 1)
    chains = reference.chains(arms)
    q = np.random.default_rng(dof).uniform(chains.lower, chains.upper)
    frames = reference_poses.tool(chains, q, *tools(arms))[:, 0]
    angular = reference_poses.angular_jacobian(chains, q)[:, 0]
    for i, arm in enumerate(arms):
        peer = peer_of(arm)
        assert np.abs(peer.jacobian(q[i, 0])[3:] - angular[i]).max() < 1e-9
        assert np.abs(peer.tip(q[i, 0])[:3, :3] - frames[i]).max() < 1e-9


@KINDS
@pytest.mark.parametrize("dof", [1, 2, 4, 5, 6, 7, 8])
@pytest.mark.fast_cases(3)
def test_single_updates_in_float64_agree_with_the_reference(dof: int, rows: int) -> None:
    """Within 1e-8 rad, without exception, and 1 + H within 1e-12 of itself: arms with fewer joints than rows, too."""
    arms = tooled_arms(200, dof, 5)
    chains, arrays = reference.chains(arms), stack_arms(arms, "float64")
    q, h_before, points = random_states(chains, dof)
    asked = target_arrays([rows], dof)
    after, gradient = update_once(arrays, points[:, 0], q[:, 0], h_before[:, 0], asked)
    expected, expected_h = reference_poses.update(chains, points, asked, *tools(arms), q, h_before)
    assert np.abs(after - expected[:, 0]).max() < 1e-8
    assert np.abs((gradient - expected_h[:, 0]) / (1.0 + expected_h[:, 0])).max() < 1e-12


@pytest.mark.parametrize("dof", [3, 6, 7])
def test_mixed_target_kinds_agree_with_the_reference(dof: int) -> None:
    """Points, axes and orientations in one kernel, 8 updates from a posture of their own: as the reference's."""
    arms = tooled_arms(200, dof, 7)
    chains, arrays = reference.chains(arms), stack_arms(arms, "float64")
    asked, points = target_arrays([2, 0, 3, 0, 2, 3], dof), np.random.default_rng(dof).uniform(-0.5, 0.5, (6, 3))
    asked = replace(asked, angle_tolerance=np.array([0.02, 0.02, 0.1, 0.02, 0.5, 0.01]))
    inside = np.random.default_rng(1).uniform(0.3, 0.7, (200, 6, dof))
    start = chains.lower + inside * (chains.upper - chains.lower)
    ours = solve_postures(arrays, points, 8, initial_q=start, target_arrays=asked, precision="float64")
    q, distance, angle = reference_poses.solve(chains, points, asked, *tools(arms), 8, start)
    agree = np.abs(ours.q - q).max(axis=-1) < 1e-6
    assert agree.mean() > 0.995
    assert np.abs(np.linalg.norm(ours.reached - points, axis=-1) - distance)[agree].max() < 1e-6
    assert np.abs(ours.angle - angle)[agree].max() < 1e-6
    assert np.all(ours.angle[:, [1, 3]] == 0.0)


@KINDS
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_rotation_by_pi_is_defined(rows: int, precision: str) -> None:
    """A tool that stands the wrong way round, exactly: about its own y for an axis, and finite for any frame."""
    pitch = Arm((0.0, 0.0, 0.0), (Joint("revolute", "y", -3.1, 3.1),) * 3, (uniform_link((0, 0, 0.2), 0.1, 0.01),) * 3)
    points = np.array([[0.2, 0.0, 0.1]])
    halves = [
        rotation_from_rpy(np.pi, 0, 0),
        rotation_from_rpy(0, np.pi, 0),
        rotation_from_rpy(0, 0, np.pi),
        np.diag([1.0, -1, -1]),
        np.diag([-1.0, 1, -1]),
    ]
    for half in halves:
        asked = replace(position_targets(1), n_angular=np.array([rows]), rotation=half[None])
        found = solve_postures(stack_arms([pitch], precision), points, target_arrays=asked, precision=precision)
        assert all(np.isfinite(values).all() for values in (found.q, found.reached, found.torque, found.angle))
    asked = replace(position_targets(1), n_angular=np.array([2]), rotation=rotation_to_axis(DOWN)[None])
    found = solve_postures(stack_arms([pitch], precision), points, 1, target_arrays=asked, precision=precision)
    assert found.q[0, 0].max() > 0.1, "it turns about y, which its joints can"
    assert found.angle[0, 0] < np.pi - 0.1


# scikit-robot


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@KINDS
@pytest.mark.parametrize("dof", [6, 7])
def test_whole_solves_agree_with_scikit_robot(dof: int, rows: int) -> None:
    """The JSK solver itself on 25 arms at 4 targets: the share that is reached within 3 points.

    At least 90 % of the pairs have the same errors within 1 % + 1 mm and 1 % + 1°, the rest being the solver's chaos.
    """
    arms = [replace(arm, base=(0.0, 0.0, 0.0)) for arm in paper_arms(25, dof, 8)]
    points, asked = (
        np.random.default_rng(3).uniform((-0.35, -0.35, -0.05), (0.35, 0.35, 0.65), (4, 3)),
        target_arrays([rows] * 4, 4),
    )
    ours = evaluate_arrays(stack_arms(arms), Scene(points, np.zeros(4), asked))
    theirs = np.array([scikit_robot_errors(arm, points, asked) for arm in arms])
    distance, angle = theirs[..., 0], theirs[..., 1]
    reached = (distance < asked.tolerance) & (angle < asked.angle_tolerance)
    assert 0.05 < reached.mean() < 0.95, "the comparison would show nothing"
    assert abs((~ours.unreached).mean() - reached.mean()) < 0.03
    near = np.abs(ours.position_error - distance) < 0.01 * distance + 1e-3
    near &= np.abs(ours.angle_error - angle) < 0.01 * angle + np.radians(1.0)
    assert near.mean() >= 0.9


def scikit_robot_errors(arm: Arm, points: Array, asked: TargetArrays) -> list[tuple[float, float]]:
    """For each target the errors [m], [rad] of the best posture of scikit-robot's solver in 100 iterations.

    Steps of 0.1 m (its own default is 100 m) and 0.5 rad, no stop at 1 mm, no scaling to the joints' speed. For an axis
    its mask leaves out the z of the logarithm of the whole rotation, which the tool's spin changes; the error is
    jskeus's instead, the shortest turn from axis to axis.
    """
    from skrobot.coordinates import Coordinates
    from skrobot.model import RobotModel

    class Recorder(RobotModel):
        def inverse_kinematics_loop(
            self, dif_pos: list[Array], dif_rot: list[Array], *args: object, **kwargs: object
        ) -> str:
            if self.rows == 2:
                frame = self.tip.worldrot()
                across = np.cross(frame[:, 2], self.wanted[:, 2])
                sine = np.linalg.norm(across)
                left = across * np.arctan2(sine, frame[:, 2] @ self.wanted[:, 2]) / (sine if sine > 0.0 else 1.0)
                dif_rot = [frame.T @ left]
            self.errors.append((float(np.linalg.norm(dif_pos[0])), float(np.linalg.norm(dif_rot[0]))))
            return super().inverse_kinematics_loop(dif_pos, dif_rot, *args, **kwargs)

        def calc_joint_angle_speed_gain(self, *args: object) -> list[float]:
            return [1.0]

    robot = Recorder()
    robot.load_urdf(to_urdf(arm))
    links = [getattr(robot, f"link_{number}") for number in range(1, len(arm.joints) + 1)]
    best = []
    for target, rows, rotation, trade in zip(
        points, asked.n_angular, asked.rotation, asked.metres_per_radian, strict=True
    ):
        robot.errors, robot.rows, robot.wanted = [], rows, rotation
        robot.reset_joint_angle_limit_weight(links)
        for joint in robot.joint_list:
            joint.joint_angle(0.0)
        robot.inverse_kinematics(
            Coordinates(pos=target, rot=rotation), move_target=robot.tip, link_list=links,
            rotation_mask=[1, 1, 0] if rows == 2 else True, stop=100, thre=[-1.0], rthre=[-1.0],
            revert_if_fail=False, p_limit=0.1, r_limit=0.5,
        )  # fmt: skip
        assert len(robot.errors) == 100
        best.append(min(robot.errors, key=lambda one, trade=trade: one[0] ** 2 + (trade * one[1]) ** 2))
    return best
