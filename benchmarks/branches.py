"""How complete the candidates are where blocks of a cycle begin: the share of the branches that many starts find.

A branch is a set of postures that reach the pose within its tolerance, without a collision, and are linked by steps of
at most 1 rad of any joint: of a redundant arm a family of self-motions. Starts are random within the joint limits, and
of families that no candidate is from others lie between them and all their neighbours, as random ones may be too few to
link a family. A branch is found if a candidate is within 1 rad of one of its postures.

Designs are random, or near the best known front: lengths off by 2 % of their range. With EAIK installed, the UR5 at
random poses is compared with the complete set of its branches.

    python benchmarks/branches.py [--designs 500] [--jobs NAME ...]
"""

import argparse
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1]))

import armwright as aw
from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.entry_postures import NEARLY, entry_postures
from armwright.kinematics.ik.ik import UPDATES, solve_postures
from armwright.problem.problem import Problem
from armwright.proof.front_gap import known_front
from armwright.spaces.tolerance import length_columns
from armwright.tasks.catalogue import load_task
from armwright.tasks.motions import CyclePlan
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.task import Task
from tests.support.robots import robot

JOBS = ("desk-sorting", "box-palletising", "lathe-tending", "screwing", "casting-inspection", "dispensing")
STARTS, APART, NEIGHBOURS = 1000, 1.0, 4  # starts; [rad] between branches; branches that links are sought to
BETWEEN = np.linspace(0.0, 1.0, 9)[1:-1, None]  # shares of the way to a neighbour
NEAR = 0.02  # of the range of a length
AT_ONCE = 20  # designs
ALIKE = 0.02  # [rad] between a solution of EAIK and the candidate that is the same


@dataclass(frozen=True)
class Goal:
    """The first pose of a block of a cycle."""

    plan: CyclePlan
    obstacles: Sequence[Obstacle]
    block: int

    def free(self, arms: ArmArrays, start: Array, updates: int = UPDATES, slack: float = 1.0) -> tuple[Array, Array]:
        """Return postures (N, S, D) solved from starts, and (N, S) whether they reach the pose without a collision."""
        samples, s = self.plan.sample(), start.shape[1]
        each = self.plan.poses[[self.plan.blocks[self.block].entry] * s]
        found = solve_postures(
            arms, each.position, updates, initial_q=start, target_arrays=each.arrays, precision=arms.precision
        )
        q = found.q.astype(np.float64)
        off = np.maximum(found.distance(each.position) / each.tolerance, found.angle / each.angle_tolerance)
        rules = self.plan.coarse_rules[np.full(s, samples.first[self.block])]
        return q, (off <= slack) & (np.minimum(*clearances(arms, q, self.obstacles, rules=rules, most=0.0)) >= 0.0)

    def lost(self, arm: ArmArrays, q: Array, own: Array) -> tuple[int, list[Array]]:
        """Return the number of branches of an arm, and the postures of each that no candidate is from.

        q: (S, D) free postures.  own: (K, D) candidates that are.
        """
        q, n_own = np.vstack([own, q]), len(own)
        label = branch_of(q)
        for first in [int(np.argmax(label == one)) for one in set(label) - set(label[:n_own])]:
            here, others = q[label == label[first]], set(label) - {label[first]}
            if label[first] in label[:n_own] or not others:
                continue  # linked by now
            ways = sorted((nearest_pair(here, q[label == other]) for other in others), key=lambda pair: pair[0])
            start = np.concatenate([a + BETWEEN * (b - a) for _, a, b in ways[:NEIGHBOURS]])
            between, good = self.free(arm, start[None])
            q = np.vstack([q, between[0][good[0]]])
            label = branch_of(q)
        return len(set(label)), [q[label == one] for one in set(label) - set(label[:n_own])]


def nearest_pair(q: Array, other: Array) -> tuple[float, Array, Array]:
    """Return the distance of two sets of postures, and the posture of each where they are nearest."""
    gap = np.abs(q[:, None] - other).max(axis=2)
    i, j = np.unravel_index(gap.argmin(), gap.shape)
    return float(gap.min()), q[i], other[j]


def branch_of(q: Array) -> NDArray[np.int32]:
    """Return the (S,) number of each posture's branch; q: (S, D)."""
    return fcluster(linkage(q, "single", "chebyshev"), APART, "distance") if len(q) > 1 else np.ones(len(q), np.int32)


def measured(problem: Problem, matrix: Array, starts: int = STARTS) -> Iterator[tuple[int, int, int, list[Array]]]:
    """Yield row of a design, block, number of branches, and those lost, of each block that the design reaches."""
    scene = problem.scenes[0]
    plan = scene.plan
    assert plan is not None
    for begin in range(0, len(matrix), AT_ONCE):
        arms = problem.arms(matrix[begin : begin + AT_ONCE])
        candidates = entry_postures(arms, plan, scene.obstacles)
        share = np.random.default_rng(1).uniform(size=(starts, arms.dof))
        start = arms.lower[:, None] + share * (arms.upper - arms.lower)[:, None]
        for block in range(len(plan.blocks)):
            goal, own = Goal(plan, scene.obstacles, block), candidates[:, block]
            q, good = goal.free(arms, start)
            fit = goal.free(arms, np.nan_to_num(own), 0, NEARLY)[1] & ~np.isnan(own[..., 0])
            for row in np.flatnonzero(good.any(axis=1)):
                yield begin + row, block, *goal.lost(arms[[row]], q[row][good[row]], own[row][fit[row]])


def near_front(problem: Problem, n: int) -> Array:
    """Return (n, P) designs near the best known front."""
    front, space = known_front(problem), problem.space
    assert front is not None
    rng, columns = np.random.default_rng(2), length_columns(space)
    matrix = space.matrix(front.designs)[np.arange(n) % len(front.designs)]
    low, high = np.array([(p.low, p.high) for p in (space.parameters[i] for i in columns)]).T
    matrix[:, columns] = np.clip(
        matrix[:, columns] + NEAR * (high - low) * rng.normal(size=(n, len(columns))), low, high
    )
    return space.normalised(matrix)


def ur5(poses: int = 500) -> None:
    """Print the share of EAIK's free solutions for the UR5 at random poses that candidates are near, but for turns."""
    from eaik.IK_URDF import UrdfRobot

    file = robot("ur5_robot")
    arm = aw.read_urdf(file, tip="ee_link")
    peer: Any = UrdfRobot(str(file))
    arms = stack_arms([arm.arm], "float64")
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (poses, arms.dof))
    model = pin.buildModelFromUrdf(str(file))
    data, frame = model.createData(), model.getFrameId("ee_link")

    def tip_pose(values: Array) -> Array:
        pin.framesForwardKinematics(model, data, values)
        return np.array(data.oMf[frame].homogeneous)

    tips = np.array([tip_pose(values) for values in q])
    from_tip = np.linalg.inv(tip_pose(np.zeros(6))) @ peer.fwdKin(np.zeros(6))
    angles = Rotation.from_matrix(tips[:, :3, :3]).as_euler("xyz")
    targets = [{"position": t[:3, 3].tolist(), "orientation": a.tolist()} for t, a in zip(tips, angles, strict=True)]
    steps = [{"to": number} for number in range(1, poses + 1)]
    task = Task.model_validate({"name": "poses", "targets": targets, "cycle": {"closed": False, "steps": steps}})
    candidates, gaps = entry_postures(arms, task.plan(task.target_positions))[0], list[Array]()
    for own, answer in zip(candidates, peer.IK_batched(tips @ from_tip, num_worker_threads=1), strict=True):
        peers = arm.values_in_arm(np.reshape(answer.Q, (-1, 6))[~np.array(answer.is_LS, dtype=bool)])
        peers = peers[clearances(arms, peers[None])[0][0] >= 0.0]
        turn = np.angle(np.exp(1j * (peers[:, None] - own[~np.isnan(own[:, 0])])))
        gaps.append(np.abs(turn).max(axis=2).min(axis=1))
    gap = np.concatenate(gaps)
    print(f"{'UR5':20}{'random poses':16}{(gap < APART).mean():8.2%} of {len(gap):6} solutions of EAIK", end="")
    print(f", {(gap < ALIKE).mean():.2%} within {ALIKE} rad", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=500, help="random ones of each job, and as many near its front")
    parser.add_argument("--jobs", nargs="+", default=JOBS, choices=JOBS, metavar="NAME")
    given = parser.parse_args()
    for name in given.jobs:
        job = Problem(load_task(name), aw.load_space(name))
        random = job.space.matrix(job.space.sample(given.designs, seed=1))
        for kind, designs in (("random", random), ("near the front", near_front(job, given.designs))):
            reached = list(measured(job, designs))
            total, lost = (sum(counts) for counts in zip(*((n, len(lost)) for _, _, n, lost in reached), strict=True))
            n_arms = len({row for row, *_ in reached})
            share = 1.0 - lost / max(total, 1)
            print(f"{name:20}{kind:16}{share:8.2%} of {total:6} branches of {n_arms} designs", flush=True)
    if importlib.util.find_spec("eaik"):
        ur5()
