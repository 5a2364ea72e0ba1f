"""Position IK kernels against Pinocchio, a plain reference, and invariants.

The solver is chaotic in places, in float32 as in float64 (docs/method.md §2). So positions and torques are compared
at postures, the solver by single updates, and whole solves in distribution.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from armwright.exceptions import ArmError, SettingsError
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.ik import ik as solve
from armwright.kinematics.ik.ik import Postures
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.tasks.catalogue import load_task
from tests.support import reference_kinematics as reference
from tests.support.arms import general_arms, paper_arms
from tests.support.exported_arms import peer_of
from tests.support.moving_joints import moving, solve_postures, update_once
from tests.support.reference_kinematics import Array, Chains, random_states

MAKERS = pytest.mark.parametrize("arms_of", [paper_arms, general_arms])
DOFS = pytest.mark.parametrize("dof", range(1, 9))
ArmMaker = Callable[[int, int, int], list[Arm]]


def chains_as_stacked(arms: list[Arm], arrays: ArmArrays) -> Chains:
    """The reference's chains with the limits as the kernels have them: in float32, rounded to the inside."""
    lower, upper = (np.float64(limits)[:, None, moving(arrays)] for limits in (arrays.lower, arrays.upper))
    return replace(reference.chains(arms), lower=lower, upper=upper)


def error_of(postures: Postures, targets: Array) -> Array:
    """(N, T) distance of the tip from the targets [m]."""
    return np.linalg.norm(postures.reached - targets, axis=-1)


def load(arm: Arm) -> float:
    """A torque of the arm's own size [N m]: all its weight at its longest reach."""
    return reference.GRAVITY * sum(link.mass for link in arm.links) * arm.reach


# Positions and torques at postures


@MAKERS
@DOFS
@pytest.mark.fast_cases(3)
def test_tip_and_torque_agree_with_pinocchio(dof: int, arms_of: ArmMaker) -> None:
    """8 x 2 x 20 arms: tip within 1e-5 m; torque within 1e-4 of its norm (or of 1 % of the arm's load if larger).

    The torque holds the posture: +dV/dq, as Pinocchio's computeGeneralizedGravity.
    """
    arms = arms_of(20, dof, 1)
    targets = np.random.default_rng(dof).uniform(-1.0, 1.0, (2, 3))
    postures = solve_postures(stack_arms(arms), targets)
    for arm, q_of, reached_of, torque_of in zip(arms, postures.q, postures.reached, postures.torque, strict=True):
        peer = peer_of(arm)
        for q, reached, torque in zip(np.float64(q_of), reached_of, torque_of, strict=True):
            assert np.abs(peer.tip(q)[:3, 3] - reached).max() < 1e-5
            size = max(np.linalg.norm(peer.gravity(q)), 1e-2 * load(arm))
            assert np.linalg.norm(peer.gravity(q) - torque) < 1e-4 * size


@MAKERS
@DOFS
@pytest.mark.fast_cases(3)
def test_reference_agrees_with_pinocchio(dof: int, arms_of: ArmMaker) -> None:
    """8 x 2 x 20 arms: the reference's tip, position Jacobian and torque, in float64.

    The kernels' Jacobian never leaves them; it is compared with the reference's by single updates.
    """
    arms = arms_of(20, dof, 2)
    chains = reference.chains(arms)
    q = np.random.default_rng(dof).uniform(chains.lower, chains.upper)
    tip, jacobian, torque = (f(chains, q)[:, 0] for f in (reference.tip, reference.jacobian, reference.gravity_torque))
    for i, arm in enumerate(arms):
        peer = peer_of(arm)
        assert np.abs(peer.tip(q[i, 0])[:3, 3] - tip[i]).max() < 1e-9  # the URDF's numbers have ten digits
        assert np.abs(peer.jacobian(q[i, 0])[:3] - jacobian[i]).max() < 1e-9
        assert np.abs(peer.gravity(q[i, 0]) - torque[i]).max() < 1e-8 * load(arm)


# Single updates of the inverse kinematics


@MAKERS
@DOFS
@pytest.mark.fast_cases(3)
def test_single_updates_agree_with_the_reference(dof: int, arms_of: ArmMaker) -> None:
    """dq = J# dx + (I - J# J) y from random (q, H before): within 1e-4 rad, and 1 + H within 5e-5 of itself.

    This also holds for D < 3, where m is 0 and the damping is always full. The bound excludes updates that a float32
    Jacobian does not determine: a joint near its limit (w down to 2.5e-4) is needed for a direction while k = 0, so
    that J W Jᵀ + k I has a root below 0.01 m. With m > 0.01 these are rare (about 1 in 80,000), and none is among
    these arms.
    """
    arms = arms_of(1000, dof, 5)
    arrays = stack_arms(arms)
    chains = chains_as_stacked(arms, arrays)
    q, h_before, targets = random_states(chains, seed=dof)
    q_after, h_after = update_once(arrays, targets[:, 0], q[:, 0].astype(np.float32), h_before[:, 0].astype(np.float32))
    expected_q, expected_h = reference.update(chains, targets, q, h_before)
    determined = least_root(chains, q, h_before)[:, 0] > 0.01
    assert determined.mean() > 0.999
    assert np.abs(q_after - expected_q[:, 0])[determined].max() < 1e-4
    manipulable = reference.manipulability(chains, q)[:, 0] > 0.01
    assert np.abs(q_after - expected_q[:, 0])[manipulable].max(initial=0.0) < 1e-4
    assert np.abs((h_after - expected_h[:, 0]) / (1.0 + expected_h[:, 0])).max() < 5e-5


@MAKERS
@pytest.mark.parametrize("dof", [1, 3, 4, 8])
def test_single_updates_in_float64_agree_with_the_reference(dof: int, arms_of: ArmMaker) -> None:
    """Within 1e-8 rad (1.3e-9 were seen), without exception: where J Jᵀ is singular, a determinant of 1e-18 is a root
    of 1e-9. 1 + H within 1e-12 of itself."""
    arms = arms_of(300, dof, 5)
    chains = reference.chains(arms)
    q, h_before, targets = random_states(chains, seed=dof)
    q_after, h_after = update_once(stack_arms(arms, "float64"), targets[:, 0], q[:, 0], h_before[:, 0])
    expected_q, expected_h = reference.update(chains, targets, q, h_before)
    assert q_after.dtype == h_after.dtype == np.float64
    assert np.abs(q_after - expected_q[:, 0]).max() < 1e-8
    assert np.abs((h_after - expected_h[:, 0]) / (1.0 + expected_h[:, 0])).max() < 1e-12


def least_root(chains: Chains, q: Array, h_before: Array) -> Array:
    """(N, T) root of the least eigenvalue of J W Jᵀ + k I [m]: the smaller, the more an error of J counts."""
    J, h = reference.jacobian(chains, q), reference.limit_gradient(chains, q)
    w = np.where(h >= h_before, 1 / (1 + h), 1.0)
    k = reference.DAMPING * np.maximum(0.0, 1 - reference.manipulability(chains, q) / 0.1) ** 2
    return np.sqrt(np.linalg.eigvalsh((J * w[..., None, :]) @ np.swapaxes(J, -1, -2))[..., 0] + k)


# Whole solves


@MAKERS
def test_whole_solves_in_float64_agree_with_the_reference(arms_of: ArmMaker) -> None:
    """Tips within 1e-6 m: after 20 updates all; after 100 as many as the solver's chaos leaves, which is as many as of
    the reference itself with the base moved by 1e-15 m (68 % of the paper's arms, 92 % of general ones). In float32 it
    is 57 % after 20.
    """
    arms, targets = arms_of(100, 4, 6), load_task("target-1").target_positions
    chains, arrays = reference.chains(arms), stack_arms(arms, "float64")

    def agreeing(ours: Array, theirs: Array) -> float:
        return float((np.abs(ours - theirs).max(axis=-1) < 1e-6).mean())

    few, all_of_them = (reference.solve(chains, targets, updates) for updates in (20, 100))
    early = solve_postures(arrays, targets, 20, precision="float64")
    assert agreeing(early.reached, few.reached) > 0.999
    assert np.abs(early.torque - reference.gravity_torque(chains, early.q)).max() < 1e-12
    moved = replace(chains, base=chains.base + 1e-15 * np.random.default_rng(6).normal(size=chains.base.shape))
    inherent = agreeing(reference.solve(moved, targets).reached, all_of_them.reached)
    solved = solve_postures(arrays, targets, precision="float64")
    assert agreeing(solved.reached, all_of_them.reached) > inherent - 0.06
    assert np.abs(reference.tip(chains, solved.q) - solved.reached).max() < 1e-14
    assert np.all((chains.lower <= solved.q) & (solved.q <= chains.upper))


def test_more_updates_never_increase_the_error() -> None:
    arms, targets = stack_arms(general_arms(300, 4, 10)), np.array([[0.4, 0.1, 0.3], [-0.2, 0.5, 0.1]])
    assert not solve_postures(arms, targets, updates=0).q.any()
    errors = [error_of(solve_postures(arms, targets, updates=n), targets) for n in (0, 1, 2, 5, 20, 100)]
    for fewer, more in pairwise(errors):
        assert np.all(more <= fewer + 1e-6)
    assert errors[-1].mean() < 0.6 * errors[0].mean()


def test_target_in_line_with_the_arm_is_not_approached() -> None:
    """Straight up, J has no row along the arm: the first of the two properties in docs/method.md §2."""
    for arm in paper_arms(40, 4, 11):
        x, y, z = np.float64(np.float32(arm.base))
        targets = np.array([[x, y, z + arm.reach + above] for above in (-0.1, 0.0, 0.1, 5.0)])
        assert not solve_postures(stack_arms([arm]), targets).q.any()


def test_earliest_of_equally_good_postures_is_kept() -> None:
    """A yaw joint under a vertical link: mid-range pulls it away from 0, the tip does not move, 0 is kept."""
    arm = Arm((0.0, 0.0, 0.0), (Joint("revolute", "z", -1.0, 2.0),), (uniform_link((0.0, 0.0, 0.2), 0.1, 0.015),))
    arrays, target = stack_arms([arm]), np.array([[0.1, 0.0, 0.3]])
    assert update_once(arrays, target, np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32))[0][0, 0] > 1e-4
    assert solve_postures(arrays, target).q[0, 0, 0] == 0.0


def test_result_does_not_depend_on_batch_or_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bits alone, in another batch, beside other targets, and in any number of pieces."""
    arms, targets = paper_arms(60, 4, 12), load_task("target-2").target_positions
    whole = solve_postures(stack_arms(arms), targets)
    same_bits(whole, solve_postures(stack_arms(arms[::-1]), targets), np.s_[::-1])
    same_bits(whole, solve_postures(stack_arms(arms[7:8]), targets), np.s_[7:8])
    same_bits(whole, solve_postures(stack_arms(arms), targets[4:5]), np.s_[:, 4:5])
    for chunk, cores in ((1, 1), (1, 3), (10**9, 1), (7, 16)):
        monkeypatch.setattr(solve, "SMALLEST_CHUNK", chunk)
        monkeypatch.setattr(solve, "cores", lambda cores=cores: cores)
        same_bits(whole, solve_postures(stack_arms(arms), targets), np.s_[:])


@pytest.mark.parametrize("lanes", [1, 2])
def test_results_do_not_depend_on_simd_lanes(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the CPU, whatever the vector's length: no operation mixes lanes, or is contracted across functions."""
    targets = load_task("target-2").target_positions
    stacked = [stack_arms(paper_arms(300, 4, 12)), stack_arms(general_arms(300, 6, 12))]
    whole = [solve_postures(arms, targets) for arms in stacked]
    monkeypatch.setitem(solve.LANES, "cpu", lanes)
    for arms, expected in zip(stacked, whole, strict=True):
        same_bits(expected, solve_postures(arms, targets), np.s_[:])


def same_bits(whole: Postures, part: Postures, rows: object) -> None:
    for name in ("q", "reached", "torque"):
        assert np.array_equal(getattr(whole, name)[rows], getattr(part, name))


# Starts


def test_initial_posture_is_kept_if_best() -> None:
    """Of the start and all results the nearest is kept, so from the kept posture nothing gets worse."""
    arms, targets = stack_arms(general_arms(200, 4, 17)), np.array([[0.4, 0.1, 0.3], [-0.2, 0.5, 0.1]])
    straight = solve_postures(arms, targets)
    same_bits(straight, solve_postures(arms, targets, initial_q=0.0), np.s_[:])
    unmoved = solve_postures(arms, targets, updates=0, initial_q=straight.q)
    same_bits(straight, unmoved, np.s_[:])
    again = solve_postures(arms, targets, initial_q=straight.q)
    assert np.all(error_of(again, targets) <= error_of(straight, targets) + 1e-6)
    assert error_of(again, targets).mean() < error_of(straight, targets).mean()


def test_initial_q_broadcasts_and_is_clipped_to_limits() -> None:
    arms, targets = stack_arms(general_arms(50, 3, 18)), np.array([[0.4, 0.1, 0.3], [-0.2, 0.5, 0.1]])
    own = moving(arms)
    low, high = (np.broadcast_to(limits[:, None, own], (50, 2, 3)) for limits in (arms.lower, arms.upper))
    assert np.array_equal(solve_postures(arms, targets, 0, initial_q=-10.0).q, low)
    assert np.array_equal(solve_postures(arms, targets, 0, initial_q=[10.0, -10.0, 0.25]).q[..., 0], high[..., 0])
    angles = np.random.default_rng(18).uniform(-0.2, 0.2, (50, 2, 3))
    for start in (angles, angles[:, :1], angles[:1], angles[0, 0]):
        q = solve_postures(arms, targets, 0, initial_q=start).q
        assert np.array_equal(q, np.broadcast_to(start, q.shape).astype(np.float32))


# What the kernels refuse


def test_refused_arms_name_joint_and_limit() -> None:
    """The message names the joint and the limit."""
    link = uniform_link((0.0, 0.0, 0.2), 0.1, 0.015)
    turning = Joint("revolute", "y", -2.0, 2.0)

    def arm(*joints: Joint) -> Arm:
        return Arm((0.0, 0.0, 0.0), joints, (link,) * len(joints))

    refused = [
        ([arm(*[turning] * 17)], "an arm has 17 joints; the kernels support at most 16"),
        ([arm(turning, Joint("revolute", "x", -1.0, 6.5))], r"joint 2: limits \[-1, 6.5\] rad are outside"),
        ([arm(Joint("revolute", "x", -6.5, 1.0))], r"joint 1: limits \[-6.5, 1\] rad are outside"),
        ([], "at least one arm"),
    ]
    for arms, words in refused:
        with pytest.raises(ArmError, match=words):
            stack_arms(arms)


def test_refused_solver_settings_are_named() -> None:
    arms, targets = stack_arms(paper_arms(2, 4, 20)), np.zeros((3, 3))
    with pytest.raises(SettingsError, match="updates = -1 is outside 0 <= updates"):
        solve_postures(arms, targets, updates=-1)
    with pytest.raises(SettingsError, match=r'precision = "float46" is not one of float32, float64. Did you mean'):
        solve_postures(arms, targets, precision="float46")  # type: ignore[arg-type]
    with pytest.raises(ArmError, match=r"shape \(2, 2, 4\) do not broadcast to \(2, 3, 4\)"):
        solve_postures(arms, targets, initial_q=np.zeros((2, 2, 4)))
    with pytest.raises(ArmError, match="expected finite angles"):
        solve_postures(arms, targets, initial_q=np.nan)
    with pytest.raises(ArmError, match="stacked in float64"):
        solve_postures(stack_arms(paper_arms(2, 4, 20), "float64"), targets)
    same_arms = solve_postures(arms, targets, precision="float64")
    assert same_arms.q.dtype == same_arms.reached.dtype == same_arms.torque.dtype == np.float64


def test_zero_outside_the_limits_is_clipped() -> None:
    link = uniform_link((0.0, 0.0, 0.2), 0.1, 0.015)
    joints = (Joint("revolute", "x", 0.5, 1.0), Joint("revolute", "y", -1.0, -0.25), Joint("prismatic", "z", 0.1, 0.3))
    arrays = stack_arms([Arm((0.0, 0.0, 0.0), joints, (link,) * 3)])
    assert np.array_equal(solve_postures(arrays, np.zeros((1, 3)), 0).q[0, 0], np.float32([0.5, -0.25, 0.1]))
