"""The continuous joint path through a cycle, against Pinocchio, scipy and properties."""

from functools import cache
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest

from armwright.kinematics.arms.arm_arrays import FIXED, stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.cycle_choice import CLOSED, MAX_SLIDE, MAX_STEP, choose_candidates
from armwright.kinematics.cycle.cycle_path import CyclePaths, find_paths
from armwright.kinematics.cycle.entry_postures import entry_postures
from armwright.kinematics.cycle.line_following import follow_lines
from armwright.kinematics.cycle.motion_path import MANY_SAMPLES, MotionPath
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.tasks.motions import Motion
from armwright.tasks.obstacles import Cylinder
from armwright.tasks.task import Task
from tests.support.cycles import KINDS, Case, line_errors, own_joints, random_case, tolerated

CASES = [(dof, kind) for dof in (3, 4, 5, 6, 7) for kind in KINDS]
OVERSHOOT = 1e-3  # [rad] or [m] of the spline beyond a limit that samples lie on


@cache
def case(dof: int, kind: str, n: int = 3) -> Case:
    return random_case(dof, kind, seed=dof + 1, n=n, closed=bool(dof % 2))


def planar(*lengths: float, limit: float = 3.1) -> Arm:
    """Links in the plane z = 0, joints about z."""
    joints = (Joint("revolute", "z", -limit, limit),) * len(lengths)
    return Arm((0.0, 0.0, 0.0), joints, tuple(uniform_link((length, 0.0, 0.0), 0.2, 0.01) for length in lengths))


def through(arm: Arm, *targets: Any, obstacles: Any = (), candidates: int = 4, **cycle: Any) -> CyclePaths:
    """Paths of one arm along lines from target to target."""
    steps = [{"to": number, "by": "line"} for number in range(1, len(targets) + 1)]
    content = {"cycle": {"closed": False, "steps": steps, **cycle}, "obstacles": obstacles}
    task = Task.model_validate({"name": "lines", "targets": targets, **content})
    plan = task.plan(task.target_positions)
    return find_paths(stack_arms([arm], "float64"), plan, task.obstacles, candidates)


def test_cases_have_arms_that_follow_their_cycle_and_arms_that_do_not() -> None:
    good = np.array([tolerated(case(*key).paths) for key in CASES])
    assert 8 <= good.sum() <= good.size - 8
    kinds = {joint.kind for key in CASES for arm in case(*key).arms for joint in arm.joints}
    assert kinds == {"revolute", "prismatic", "fixed"}
    assert any(case(*key).paths.jumps.any() for key in CASES)


@pytest.mark.parametrize(("dof", "kind"), CASES)
def test_joint_path_is_continuous_from_motion_to_motion(dof: int, kind: str) -> None:
    paths = case(dof, kind).paths
    for row in range(3):
        _, motions = paths.of_arm(row)
        for before, after in pairwise(motions):
            assert np.abs(before.q[:, -1] - after.q[:, 0]).max() < 1e-9
        is_open = paths.plan.is_loop and (paths.is_off[row] or paths.jumps[row, -1])
        closed = paths.plan.cycle.closed and not is_open
        if closed:
            limit = CLOSED if paths.plan.is_loop else 1e-9
            assert np.abs(motions[-1].q[:, -1] - motions[0].q[:, 0]).max() <= limit


@pytest.mark.parametrize(("dof", "kind"), CASES)
def test_neighbouring_samples_are_near_and_within_limits(dof: int, kind: str) -> None:
    found = case(dof, kind)
    good = tolerated(found.paths)
    for row in range(3):
        arms, motions = found.paths.of_arm(row)
        allowed = np.where(arms.prismatic, MAX_SLIDE, MAX_STEP) * (1.0 + 1e-9)
        moves = arms.motion[0] < FIXED
        margins = []
        for motion, jumps in zip(motions, found.paths.jumps[row], strict=True):
            assert jumps or not good[row] or (motion.largest_steps <= allowed).all()
            assert not motion.q[:, :, ~moves].any()
            margins.append(np.minimum(motion.q - arms.lower[:, None], arms.upper[:, None] - motion.q)[..., moves].min())
            between = motion.at(np.linspace(0.0, 1.0, 301))
            outside = np.maximum(arms.lower[:, None] - between, between - arms.upper[:, None])[..., moves].max()
            assert outside <= OVERSHOOT or not good[row]
        assert min(margins) >= -1e-12
        assert found.paths.limit_distance[row] == pytest.approx(margins, abs=1e-12)


@pytest.mark.parametrize(("dof", "kind"), CASES)
def test_errors_along_lines_equal_those_of_pinocchio(dof: int, kind: str) -> None:
    """At the samples and half way between them, which are what counts; and anywhere for arms within tolerance."""
    found = case(dof, kind)
    anywhere = np.random.default_rng(0).uniform(size=20)
    good = tolerated(found.paths)
    for row, (arm, peer) in enumerate(zip(found.arms, found.peers, strict=True)):
        for index, path in enumerate(found.paths.of_arm(row)[1]):
            start, end = path.motion.start, path.motion.end
            errors = [found.paths.path_error[row, index], found.paths.path_angle[row, index]]
            if path.motion.by == "joint":
                assert errors == [0.0, 0.0]
                continue
            share = np.linspace(0.0, 1.0, 2 * path.q.shape[1] - 1)
            each = line_errors(peer, found.task, start, end, share, own_joints(arm, path.at(share)[0]))
            assert each.max(axis=0) == pytest.approx(errors, abs=1e-8)
            worst = np.interp(found.paths.worst[row, index, :2], share, np.arange(len(share))).round().astype(int)
            assert each[worst, [0, 1]] == pytest.approx(errors, abs=1e-8)
            if good[row]:
                other = line_errors(peer, found.task, start, end, anywhere, own_joints(arm, path.at(anywhere)[0]))
                assert (other.max(axis=0) <= 1.5 * np.array(errors) + 1e-6).all()


def test_long_joint_motions_are_sampled_finely_and_never_jump() -> None:
    steps = [{"to": number} for number in (1, 2, 3)]
    paths = through(planar(0.3, 0.25), [0.4, 0.1, 0.0], [-0.4, -0.1, 0.0], [0.4, -0.1, 0.0], steps=steps, closed=True)
    motions = paths.of_arm(0)[1]
    assert max(np.abs(path.q[0, -1] - path.q[0, 0]).max() for path in motions) > 16 * MAX_STEP
    assert not paths.jumps.any()
    for path in motions:
        share = path.share[:, None]
        assert path.q[0] == pytest.approx((1 - share) * path.q[0, 0] + share * path.q[0, -1], abs=1e-12)
        assert path.largest_steps.max() <= MAX_STEP + 1e-9


def test_more_samples_converge_to_one_path() -> None:
    """The postures of redundant arms depend on the samples too, by less with each doubling."""
    for dof, kind in ((5, "position"), (6, "position"), (6, "axis"), (7, "position")):
        found = case(dof, kind)
        arms = found.arrays[np.flatnonzero(tolerated(found.paths))]
        assert len(arms)
        entry = entry_postures(arms, found.plan)[:, :, :1]
        ends = []
        for refinement in (4, 8, 16, 32):
            samples = found.plan.sample(refinement)
            q = follow_lines(arms, samples, entry).q[:, 0]
            ends.append(q[:, samples.first[1:] - 1])
        change = [np.abs(b - a).max() for a, b in pairwise(ends)]
        assert change[2] <= 0.7 * change[0] + 1e-6
        assert change[2] < 0.02


@pytest.mark.parametrize("lengths", [(0.3, 0.3), (0.3, 0.2)])
@pytest.mark.parametrize("off", [0.0, 1e-6])
def test_line_through_the_base_is_never_feasible(lengths: tuple[float, ...], off: float) -> None:
    """Equal links have to turn around at once there; others cannot reach the base at all."""
    paths = through(planar(*lengths), [0.45, off, 0.0], [-0.45, off, 0.0])
    assert not tolerated(paths).any()


def test_line_close_by_the_base_is_followed_with_many_samples() -> None:
    paths = through(planar(0.3, 0.3, limit=3.14), [0.45, 0.01, 0.0], [-0.45, 0.01, 0.0])
    assert tolerated(paths).all()
    (path,) = paths.of_arm(0)[1]
    assert path.q.shape[1] > 100
    assert np.ptp(path.q[0, :, 0]) > 2.5


def test_loop_of_lines_ends_where_it_began() -> None:
    corners = [[0.3, 0.1, 0.0], [0.4, 0.1, 0.0], [0.4, 0.2, 0.0]]
    lines = [{"to": number, "by": "line"} for number in (1, 2, 3)]
    for arm in (planar(0.3, 0.25), planar(0.2, 0.2, 0.15)):
        paths = through(arm, *corners, steps=lines, closed=True)
        motions = paths.of_arm(0)[1]
        gap = np.abs(motions[-1].q[:, -1] - motions[0].q[:, 0]).max()
        assert paths.jumps[0, -1] == (gap > CLOSED)
        assert len(arm.joints) > 2 or gap < 1e-6


def test_clearances_of_a_motion_are_the_smallest_of_its_samples() -> None:
    post = Cylinder(kind="cylinder", center=(0.35, 0.25, 0.0), radius=0.02, height=0.2)
    arm, targets = planar(0.3, 0.25), ([0.45, -0.1, 0.0], [0.1, 0.4, 0.0], [0.45, -0.1, 0.0])
    paths = through(arm, *targets, obstacles=[post.model_dump()])
    assert np.isinf(through(arm, *targets).obstacle_clearance).all()
    for index, path in enumerate(paths.of_arm(0)[1]):
        nearest = clearances(stack_arms([arm], "float64"), path.q, [post])[1].min()
        assert paths.obstacle_clearance[0, index] == pytest.approx(nearest, abs=1e-3)


@pytest.mark.parametrize("samples", [20, MANY_SAMPLES, MANY_SAMPLES + 1])
def test_path_between_samples_is_a_cubic_spline(samples: int) -> None:
    share = np.linspace(0.0, 1.0, samples)
    q = np.stack([share**3 - share, 2.0 * share**2, np.sin(3.0 * share)], axis=1)
    path = MotionPath(Motion(0, "line", 0, 1, carries=True, arrives=True), np.stack([q, 2.0 * q, -q]))
    at = np.random.default_rng(0).uniform(size=30)
    assert path.at(at)[0, :, 0] == pytest.approx(at**3 - at, abs=1e-12)
    assert path.at(at, 1)[1, :, 0] == pytest.approx(6.0 * at**2 - 2.0, abs=1e-9)
    assert path.at(at, 2)[2, :, 1] == pytest.approx(-4.0 * np.ones(30), abs=1e-6)
    assert path.at(at)[0, :, 2] == pytest.approx(np.sin(3.0 * at), abs=1e-4)
    assert path.at(path.share)[0] == pytest.approx(q, abs=1e-12)
    for row in range(3):
        alone = MotionPath(path.motion, path.q[[row]])
        assert all(np.array_equal(alone.at(at, order)[0], path.at(at, order)[row]) for order in range(3))


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("blocks", [1, 2, 3, 4])
def test_choice_of_candidates_equals_brute_force(blocks: int, closed: bool) -> None:
    rng, k, n = np.random.default_rng(1), 3, 20
    own, edges = rng.uniform(size=(n, blocks, k)), rng.uniform(size=(n, blocks if closed else blocks - 1, k, k))

    def cost(arm: int, chosen: Any) -> float:
        joined = sum(edges[arm, b, chosen[b], chosen[(b + 1) % blocks]] for b in range(edges.shape[1]))
        return float(joined + sum(own[arm, b, chosen[b]] for b in range(blocks)))

    found = choose_candidates(own, edges, np.arange(n))
    for arm in range(n):
        best = min(cost(arm, chosen) for chosen in product(range(k), repeat=blocks))
        assert cost(arm, found[arm]) == pytest.approx(best, abs=1e-12)


def test_candidate_that_collides_gives_way_to_one_that_does_not() -> None:
    """Two mirrored postures at each target; the elbow of one of them is in the post."""
    arm = planar(0.3, 0.3)
    targets = [[0.4, -0.02, 0.0], [0.4, 0.02, 0.0]]
    free = through(arm, *targets, candidates=8)
    elbow = free.of_arm(0)[1][0].q[0].mean(axis=0)
    centre = [0.3 * np.cos(elbow[0]), 0.3 * np.sin(elbow[0]), 0.0]
    post = {"kind": "sphere", "center": centre, "radius": 0.03}
    paths = through(arm, *targets, obstacles=[post], candidates=8)
    assert tolerated(paths).all()
    assert paths.obstacle_clearance.min() > 0.1
    assert np.sign(paths.of_arm(0)[1][0].q[0, 0, 1]) == -np.sign(elbow[1])
