"""Postures of arms at the first pose of each block of a cycle."""

from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.cycle_choice import DEPTH, DISTINCT, cost_of
from armwright.kinematics.devices import Device
from armwright.kinematics.ik.ik import solve_postures
from armwright.tasks.motions import CyclePlan, Poses
from armwright.tasks.obstacles import Obstacle

STARTS = 16  # of the inverse kinematics at each block's first pose
CANDIDATES = 4  # of the postures found there that lines are followed from
SPENT = 1e12  # cost of a posture that is a candidate already


def entry_postures(
    arms: ArmArrays,
    plan: CyclePlan,
    obstacles: Sequence[Obstacle] = (),
    candidates: int = CANDIDATES,
    device: Device = "cpu",
) -> Array:
    """Return (N, B, K, D) postures at the first pose of each block: the best of several starts that differ.

    The first start is the straight arm, the others are spread over the joints' ranges. Postures are ranked by what they
    are off by and how deep they collide, then by their distance to the joint limits.
    """
    poses = plan.poses[[block.entry for block in plan.blocks]]
    n, b, starts = len(arms), len(poses), max(STARTS, candidates)
    lower, upper = arms.lower.astype(np.float64), arms.upper.astype(np.float64)
    start = arms.random_postures(starts).swapaxes(0, 1)  # (N, S, D)
    start[:, 0] = 0.0
    q, off = _solve(arms, poses[np.repeat(np.arange(b), starts)], np.tile(start, (1, b, 1)), device)
    samples = plan.sample()
    rules = plan.sampled_rules(samples)[np.repeat(samples.first[:-1], starts)]
    depth = np.maximum(0.0, -np.minimum(*clearances(arms, q, obstacles, device, rules)))
    room = np.minimum(q - lower[:, None], upper[:, None] - q) / (upper - lower)[:, None]
    room = np.where(arms.motion[:, None] == FIXED, 1.0, room).min(axis=-1)
    cost = (cost_of(off - 1.0) + cost_of(depth / DEPTH) - room).reshape(n, b, starts)
    return _spread(q.reshape(n, b, starts, arms.dof), cost, candidates)


def _spread(q: Array, cost: Array, count: int) -> Array:
    """Return (N, B, K, D) of the postures (N, B, S, D): the cheapest, then the ones farthest from those chosen before.

    cost: (N, B, S), far above any distance for postures that are off or collide.
    """
    chosen: list[Array] = []
    nearness = cost
    distance = np.full(cost.shape, np.inf)
    for _ in range(count):
        best = nearness.argmin(axis=-1)[..., None]
        posture = np.take_along_axis(q, best[..., None], axis=2)
        chosen.append(posture)
        distance = np.minimum(distance, np.abs(q - posture).max(axis=-1))
        nearness = np.where(distance < DISTINCT, SPENT, cost - distance)
    return np.concatenate(chosen, axis=2)


def postures_near(arms: ArmArrays, plan: CyclePlan, near: Array, device: Device = "cpu") -> Array:
    """Return (N, B, 1, D) postures at the first pose of each block, solved from postures of similar arms (N, B, D)."""
    poses = plan.poses[[block.entry for block in plan.blocks]]
    return _solve(arms, poses, near, device)[0][:, :, None]


def _solve(arms: ArmArrays, poses: Poses, start: Array, device: Device) -> tuple[Array, Array]:
    """Return (N, P, D) postures at P poses, and (N, P) what they are off by relative to the tolerance."""
    solved = solve_postures(
        arms,
        poses.position,
        initial_q=start,
        target_arrays=poses.arrays,
        precision=arms.precision,
        device=device,
    )
    off = np.maximum(solved.distance(poses.position) / poses.tolerance, solved.angle / poses.angle_tolerance)
    return solved.q.astype(np.float64), off
