"""Postures of arms at the first pose of each block of a cycle: of every branch of the inverse kinematics.

Postures from several starts are carried over to their mirror images (branch_kernels.py), which a few more updates
refine. Redundant arms whose posture collides are moved aside by self-motions.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.contact.clearance import path_clearances
from armwright.kinematics.cycle.costs import FAR, cost_of
from armwright.kinematics.cycle.cycle_choice import DEPTH
from armwright.kinematics.cycle.line_following import follow_lines
from armwright.kinematics.devices import Device, load_kernels
from armwright.kinematics.ik.ik import solve_postures
from armwright.tasks.motions import CyclePlan, single_samples
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.poses import Poses

STARTS, START_UPDATES = 32, 30  # of the inverse kinematics at each block's first pose
KNOWN = 16  # of the postures found there that are mirrored, those that miss the pose included
IMAGES = 64  # postures with their images
REFINED, IMAGE_UPDATES = 48, 20  # of these, the nearest to the pose
OUTSIDE = 0.7  # [rad] or [m] beyond a limit from which an image may be moved to it
CANDIDATES = 32  # that lines are followed from
DISTINCT, APART = 0.3, 0.7  # [rad] or [m] between postures that are mirrored, and between candidates
COLLIDING, TRIES = 12, 3  # branches whose posture collides, and random self-motions of each
ASIDE = 0.07  # of each joint's range that it is moved by, twice, before the tool is brought back
SHALLOW, FREE = 0.01, 1e3  # [m] of a collision that counts as 1 rad of distance, and what none at all counts as [rad]
ROOMY, TIGHT = 0.05, 0.3  # share of a range to its ends that lines need, and what it counts as [rad]
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
    the only one; if all collide, those that do so least. All are exact in float32.
    """
    own, alike = plan.alike
    poses = plan.poses[[plan.blocks[block].entry for block in own]]
    lower, upper = (limit.astype(np.float64)[:, None, None] for limit in (arms.lower, arms.upper))
    start = arms.random_postures(STARTS).swapaxes(0, 1)[:, None]  # (N, 1, S, D)
    start[:, :, 0] = 0.0
    q, off = _solve(arms, poses, np.repeat(start, len(poses), axis=1), START_UPDATES, device)
    images, _ = _branches(arms, q, _cost(arms, q, off), KNOWN, IMAGES, DISTINCT, device)
    q = np.clip(images, lower, upper)
    q[~(np.abs(q - images).max(axis=-1) <= OUTSIDE)] = np.nan
    q, off = _solve(arms, poses, q, 0, device)
    q[np.isinf(off)] = np.nan
    nearest = np.argsort(off, axis=2, kind="stable")[..., : np.isfinite(off).sum(axis=2).max()]
    q = np.take_along_axis(q, nearest[..., :REFINED, None], axis=2)
    q, off = _solve(arms, poses, q, IMAGE_UPDATES, device)
    unfit = (off > NEARLY) & (off > off.min(axis=2, keepdims=True))
    clearance = _clearance(arms, plan, obstacles, q, unfit, device)
    start = _colliding_branches(arms, poses, q, clearance, device)
    if start.shape[2]:
        moved, moved_off = _aside(arms, poses, start, device)
        moved_clearance = _clearance(arms, plan, obstacles, moved, moved_off > NEARLY, device)
        q, off = np.concatenate([q, moved], axis=2), np.concatenate([off, moved_off], axis=2)
        clearance = np.concatenate([clearance, moved_clearance], axis=2)
    most = clearance.max(axis=2, keepdims=True)
    unfit = clearance < np.where(most < 0.0, most - DEPTH, 0.0)
    cost = np.where(unfit, np.inf, _cost(arms, q, off))
    q, _ = _branches(arms, q, cost, candidates, candidates, APART, device)
    return _rounded(q[:, :, : (~np.isnan(q[..., 0])).sum(axis=2).max()], lower, upper)[:, alike]


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
        motions=arms.general_motions,
    )
    off = np.maximum(solved.distance(each.position) / each.tolerance, solved.angle / each.angle_tolerance)
    off = np.where(np.isnan(start).any(axis=-1), np.inf, off.reshape(n, b, s))
    return solved.q.astype(np.float64).reshape(start.shape), off


def _cost(arms: ArmArrays, q: Array, off: Array) -> Array:
    """Return the (N, B, S) cost of what postures are off by, less their room to the joint limits, in radians."""
    lower, upper = (limit.astype(np.float64)[:, None, None] for limit in (arms.lower, arms.upper))
    room = np.minimum(q - lower, upper - q) / (upper - lower)
    room = np.where((arms.motion == FIXED)[:, None, None], 1.0, room).min(axis=-1)
    return cost_of(off - 1.0) - room - TIGHT * (room > ROOMY)


def _clearance(
    arms: ArmArrays, plan: CyclePlan, obstacles: Sequence[Obstacle], q: Array, unfit: NDArray[np.bool_], device: Device
) -> Array:
    """Return the (N, B, S) clearance of postures at the first poses [m], at most 0; -inf for those that are unfit."""
    rules = plan.coarse_rules[np.repeat(plan.sample().first[plan.alike[0]], q.shape[2])]
    q, mask = np.where(unfit[..., None], 0.0, q).reshape(len(arms), -1, arms.dof), unfit.reshape(len(arms), -1)
    each = np.arange(q.shape[1] + 1, dtype=np.intp)
    least, _ = path_clearances(arms, q, each, obstacles, device, rules, most=0.0, omitted=mask)
    found = least[:, 1].min(axis=0)
    return np.where(unfit, -np.inf, found.reshape(unfit.shape))


def _colliding_branches(arms: ArmArrays, poses: Poses, q: Array, clearance: Array, device: Device) -> Array:
    """Return (N, B, K, D) postures that collide, each `TRIES` times, of redundant arms: far from those that do not."""
    redundant = (arms.motion != FIXED).sum(axis=1)[:, None] > 3 + poses.n_angular
    cost = np.where(redundant[..., None] & np.isfinite(clearance), -clearance / SHALLOW, np.inf)
    _, nearness = _branches(arms, q, cost - FREE * (clearance == 0.0), CANDIDATES, CANDIDATES, APART, device)
    cost[(nearness > 0.0) | (clearance == 0.0)] = np.inf
    lost = np.isfinite(cost)
    first = np.argsort(cost, axis=2, kind="stable")[..., : min(COLLIDING, lost.sum(axis=2).max())]
    return np.repeat(np.take_along_axis(np.where(lost[..., None], q, np.nan), first[..., None], axis=2), TRIES, axis=2)


def _aside(arms: ArmArrays, poses: Poses, start: Array, device: Device) -> tuple[Array, Array]:
    """Return self-motions of postures (N, B, S, D) at B poses, and what they are off by, as `_solve` does."""
    lines = follow_lines(arms, single_samples(poses), start, device, ASIDE)
    return lines.q.swapaxes(1, 2), lines.off


def _rounded(q: Array, lower: Array, upper: Array) -> Array:
    """Return postures (N, B, K, D) rounded to float32, within the limits."""
    near, end = q.astype(np.float32), np.float32(np.inf)
    near = np.where(near < lower, np.nextafter(near, end), np.where(near > upper, np.nextafter(near, -end), near))
    return near.astype(np.float64)


def _branches(
    arms: ArmArrays, q: Array, cost: Array, known: int, count: int, distinct: float, device: Device
) -> tuple[Array, Array]:
    """Return (N, B, count, D) of postures (N, B, S, D) that differ: the best `known` by cost, then their images.

    Also returns (N, B, S) how near each posture is to those best ones.
    """
    loaded = load_kernels("cycle.branch_kernels", device)
    n, b, s, dof = q.shape
    found, nearness = np.full((n, b, count, dof), np.nan), np.full(cost.shape, FAR)

    def find(chunk: slice) -> None:
        values = {name: getattr(arms[chunk], name) for name in ("dof", "motion", "axis", "offset", "lower", "upper")}
        chain, outputs = loaded.struct("Chain", values), [nearness[chunk], found[chunk]]
        loaded.launch(
            "find_branches", outputs[1].shape[:2], chain, q[chunk], cost[chunk], known, distinct, outputs=outputs
        )

    in_chunks(find, n, max(1, SAMPLES[device] // (b * s)), device)
    return found, nearness
