"""Postures of arms at the first pose of each block of a cycle: of every branch of the inverse kinematics.

Postures from several starts are carried over to their mirror images (branch_kernels.py), which a few more updates
refine.
"""

from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.cycle_choice import cost_of
from armwright.kinematics.devices import Device, load_kernels
from armwright.kinematics.ik.ik import UPDATES, solve_postures
from armwright.tasks.motions import CyclePlan, Poses
from armwright.tasks.obstacles import Obstacle

STARTS, START_UPDATES = 32, 30  # of the inverse kinematics at each block's first pose
KNOWN = 16  # of the postures found there that are mirrored, those that miss the pose included
IMAGES = 64  # postures with their images
REFINED, IMAGE_UPDATES = 48, 20  # of these, the nearest to the pose
OUTSIDE = 0.7  # [rad] or [m] beyond a limit from which an image may be moved to it
CANDIDATES = 24  # that lines are followed from
DISTINCT, APART = 0.3, 0.7  # [rad] or [m] between postures that are mirrored, and between candidates
NEARLY = 1.5  # times the tolerance that a candidate may be off: lines begin with a refinement


def entry_postures(
    arms: ArmArrays,
    plan: CyclePlan,
    obstacles: Sequence[Obstacle] = (),
    candidates: int = CANDIDATES,
    device: Device = "cpu",
) -> Array:
    """Return (N, B, K, D) postures at the first pose of each block that differ, NaN where there are fewer than K.

    The first start is the straight arm, the others are spread over the joints' ranges. The first posture has the most
    room to the joint limits, each other one is the farthest from those before. If none reaches the pose, the nearest is
    the only one; if all collide, the one that does so least.
    """
    poses = plan.poses[[block.entry for block in plan.blocks]]
    lower, upper = (limit.astype(np.float64)[:, None, None] for limit in (arms.lower, arms.upper))
    start = arms.random_postures(STARTS).swapaxes(0, 1)[:, None]  # (N, 1, S, D)
    start[:, :, 0] = 0.0
    q, off = _solve(arms, poses, np.repeat(start, len(poses), axis=1), START_UPDATES, device)
    images = _branches(arms, q, cost_of(off - 1.0), KNOWN, IMAGES, DISTINCT, device)
    q = np.clip(images, lower, upper)
    q[~(np.abs(q - images).max(axis=-1) <= OUTSIDE)] = np.nan
    q, off = _solve(arms, poses, q, 0, device)
    q[np.isinf(off)] = np.nan
    nearest = np.argsort(off, axis=2, kind="stable")[..., : np.isfinite(off).sum(axis=2).max()]
    q = np.take_along_axis(q, nearest[..., :REFINED, None], axis=2)
    q, off = _solve(arms, poses, q, IMAGE_UPDATES, device)
    unfit = (off > NEARLY) & (off > off.min(axis=2, keepdims=True))
    fit_first = np.argsort(unfit, axis=2, kind="stable")[..., : (~unfit).sum(axis=2).max()]
    q = np.take_along_axis(q, fit_first[..., None], axis=2)
    off, unfit = np.take_along_axis(off, fit_first, axis=2), np.take_along_axis(unfit, fit_first, axis=2)
    samples = plan.sample()
    rules = plan.sampled_rules(samples)[np.repeat(samples.first[:-1], q.shape[2])]
    clearance = np.minimum(*clearances(arms, q.reshape(len(arms), -1, arms.dof), obstacles, device, rules, most=0.0))
    clearance = clearance.reshape(off.shape)
    clearance[unfit] = -np.inf
    unfit |= clearance < np.minimum(0.0, clearance.max(axis=2, keepdims=True))
    room = np.minimum(q - lower, upper - q) / (upper - lower)
    room = np.where((arms.motion == FIXED)[:, None, None], 1.0, room).min(axis=-1)
    q = _branches(arms, q, np.where(unfit, np.inf, cost_of(off - 1.0) - room), candidates, candidates, APART, device)
    return q[:, :, : (~np.isnan(q[..., 0])).sum(axis=2).max()]


def postures_near(arms: ArmArrays, plan: CyclePlan, near: Array, device: Device = "cpu") -> Array:
    """Return (N, B, 1, D) postures at the first pose of each block, solved from postures of similar arms (N, B, D)."""
    poses = plan.poses[[block.entry for block in plan.blocks]]
    return _solve(arms, poses, near[:, :, None], UPDATES, device)[0]


def _solve(arms: ArmArrays, poses: Poses, start: Array, updates: int, device: Device) -> tuple[Array, Array]:
    """Return (N, B, S, D) postures at B poses, and (N, B, S) what they are off by relative to the tolerance.

    Those that start from NaN are infinitely far off.
    """
    n, b, s, dof = start.shape
    each = poses[np.arange(b * s) // s]
    solved = solve_postures(
        arms,
        each.position,
        updates,
        initial_q=np.nan_to_num(start).reshape(n, b * s, dof),
        target_arrays=each.arrays,
        precision=arms.precision,
        device=device,
    )
    off = np.maximum(solved.distance(each.position) / each.tolerance, solved.angle / each.angle_tolerance)
    off = np.where(np.isnan(start).any(axis=-1), np.inf, off.reshape(n, b, s))
    return solved.q.astype(np.float64).reshape(start.shape), off


def _branches(arms: ArmArrays, q: Array, cost: Array, known: int, count: int, distinct: float, device: Device) -> Array:
    """Return (N, B, count, D) of postures (N, B, S, D) that differ: the best `known` by cost, then their images."""
    loaded = load_kernels("cycle.branch_kernels", device)
    n, b, s, dof = q.shape
    found = np.full((n, b, count, dof), np.nan)

    def find(chunk: slice) -> None:
        values = {name: getattr(arms[chunk], name) for name in ("dof", "motion", "axis", "offset", "lower", "upper")}
        chain, part, nearness = loaded.struct("Chain", values), found[chunk], np.full((*cost[chunk].shape,), np.inf)
        loaded.launch(
            "find_branches", part.shape[:2], chain, q[chunk], cost[chunk], known, distinct, nearness, outputs=[part]
        )

    in_chunks(find, n, max(1, SAMPLES[device] // (b * s)), device)
    return found
