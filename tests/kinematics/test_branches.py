"""Branches of the inverse kinematics at the first poses of blocks, and the choice among them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle import cycle_path
from armwright.kinematics.cycle.entry_postures import CANDIDATES, entry_postures
from armwright.kinematics.cycle.line_following import follow_lines
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.robot.arm import Arm, Joint, uniform_link
from armwright.robot.mounting import turned
from armwright.rotations import rotation_about
from armwright.spaces.design_space import load_space
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.catalogue import load_task
from armwright.tasks.motions import CyclePlan, LineSamples
from armwright.tasks.task import Task

STARTS = 300
APART = 1.0  # [rad] between postures of different branches


def problem(name: str) -> Problem:
    return Problem(load_task(name), load_space(name))


def reached(arms: ArmArrays, plan: CyclePlan, start: Array) -> tuple[Array, Array]:
    """Solved postures (N, B, S, D) from S starts, and whether they reach their pose freely; start: (N, B, S, D)."""
    n, b, s, dof = start.shape
    each = plan.poses[np.repeat([block.entry for block in plan.blocks], s)]
    samples = plan.sample()
    rules = plan.sampled_rules(samples)[np.repeat(samples.first[:-1], s)]
    found = solve_postures(arms, each.position, initial_q=start.reshape(n, -1, dof), target_arrays=each.arrays)
    is_near = (found.distance(each.position) < each.tolerance) & (found.angle < each.angle_tolerance)
    q = found.q.astype(np.float64)
    return q.reshape(start.shape), (is_near & (clearances(arms, q, rules=rules)[0] >= 0.0)).reshape(n, b, s)


@pytest.mark.parametrize("name", ["casting-inspection", "desk-sorting", "box-palletising"])
def test_branches_of_many_random_starts_are_found(name: str) -> None:
    given = problem(name)
    arms, plan = given.arms(given.space.matrix(given.space.sample(40, 1))), given.scenes[0].plan
    assert plan is not None
    start = np.random.default_rng(1).uniform(size=(len(arms), len(plan.blocks), STARTS, arms.dof))
    lower, upper = (limit.astype(np.float64)[:, None, None] for limit in (arms.lower, arms.upper))
    q, is_near = reached(arms, plan, lower + start * (upper - lower))
    candidates = entry_postures(arms, plan)
    assert np.array_equal(candidates, candidates.astype(np.float32), equal_nan=True)
    assert not ((candidates < lower) | (candidates > upper)).any()
    known = np.nan_to_num(candidates, nan=np.inf)
    branches = hit = 0
    for row in np.ndindex(q.shape[:2]):
        if is_near[row].sum() > 1:
            own = q[row][is_near[row]]
            label = fcluster(linkage(own, "single", "chebyshev"), APART, "distance")
            distance = np.abs(own[:, None] - known[row]).max(axis=-1).min(axis=1, initial=np.inf)
            branches += label.max()
            hit += len(set(label[distance < APART]))
    assert branches > 15
    assert hit >= 0.9 * branches


@pytest.mark.parametrize("yaw", [0.0, 0.7])
@pytest.mark.parametrize("flipped", [(), (1,), (0, 2, 3)])
def test_shoulder_and_elbow_of_an_upright_arm_give_four_branches(yaw: float, flipped: tuple[int, ...]) -> None:
    """q₁ or q₁ + π, each with the elbow on either side; the wrist follows, also about opposite and oblique axes."""
    joints = (Joint("revolute", "z", -3.1, 3.1), *(Joint("revolute", "y", -3.1, 3.1),) * 3)
    links = tuple(uniform_link((0.0, 0.0, length), 0.2, 0.01) for length in (0.1, 0.3, 0.25, 0.1))
    sign = [-1.0 if j in flipped else 1.0 for j in range(4)]
    axes = [tuple(way * x for x in joint.direction) for joint, way in zip(joints, sign, strict=True)]
    opposite = [replace(joint, axis=axis) for joint, axis in zip(joints, axes, strict=True)]  # type: ignore[arg-type]
    turn = rotation_about(np.array([0.0, 0.0, 1.0]), yaw)
    points = [{"position": (turn @ point).tolist(), "axis": [0, 0, -1]} for point in ([0.3, 0.1, 0.1], [0.1, 0.3, 0.1])]
    content = {"cycle": {"closed": False, "steps": [{"to": 1}, {"to": 2}]}}
    task = Task.model_validate({"name": "one", "targets": points, **content})
    arms = stack_arms([turned(Arm((0.0, 0.0, 0.0), tuple(opposite), links), turn)], "float64")
    plan = task.plan(task.target_positions)
    q = entry_postures(arms, plan)[0, 0]
    q = sign * q[~np.isnan(q[:, 0])]
    assert sorted(np.round(q[:, 0], 3)) == [-2.82, -2.82, 0.322, 0.322]
    assert sorted(np.sign(np.sin(q[:, 2]))) == [-1.0, -1.0, 1.0, 1.0]


def test_more_candidates_lose_no_design_that_three_make_feasible(monkeypatch: pytest.MonkeyPatch) -> None:
    given = problem("box-palletising")
    front = known_front(given)
    assert front is not None
    matrix = given.space.matrix(front.designs)
    rng = np.random.default_rng(0)
    lengths = [i for i, parameter in enumerate(given.space.parameters) if isinstance(parameter, FloatParameter)]
    rows = matrix[rng.integers(len(matrix), size=20)]
    rows[:, lengths] += 0.01 * rng.normal(size=(20, len(lengths)))
    feasible: list[NDArray[np.bool_]] = []
    for count in (3, 6, 12, CANDIDATES):
        monkeypatch.setattr(cycle_path, "CANDIDATES", count)
        feasible.append((given.evaluate(rows).violations <= 0.0).all(axis=1))
    assert feasible[0].any()
    assert all(more[feasible[0]].all() for more in feasible)


def test_self_motions_keep_the_tool_where_it_is() -> None:
    given = problem("casting-inspection")
    arms, plan = given.arms(given.space.matrix(given.space.sample(20, 1))), given.scenes[0].plan
    assert plan is not None
    poses = plan.poses[[block.entry for block in plan.blocks]]
    entry = entry_postures(arms, plan)
    samples = LineSamples(poses, np.arange(len(poses) + 1), ())
    start, moved = follow_lines(arms, samples, entry), follow_lines(arms, samples, entry, aside_by=0.03)
    reached = (start.position_error < 1e-6) & (start.angle_error < 1e-6)
    assert reached.sum() > 20
    change = np.abs(moved.q - start.q)[reached].max(axis=-1)
    assert np.median(change) > 0.05
    kept = (moved.position_error < 1e-4) & (moved.angle_error < 1e-3)
    assert kept[reached].mean() > 0.8
