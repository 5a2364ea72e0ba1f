"""One continuous joint path through a cycle.

A block's first pose has K postures from different starts of the inverse kinematics. Each is followed along the block's
lines, coarsely; joint motions join the blocks. Which candidate each block takes is chosen for the cycle as a whole by
dynamic programming, as in the ladder graph of Descartes (ROS-Industrial). The chosen path is then followed with as many
samples as it takes for neighbours to be near.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import FIXED, MAX_JOINTS, ArmArrays
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.clearance import clearances
from armwright.kinematics.cycle_choice import IndexArray, choose_candidates
from armwright.kinematics.devices import Device, load_path
from armwright.kinematics.ik import solve_postures
from armwright.kinematics.motion_path import MotionPath
from armwright.tasks.motions import CyclePlan, LineSamples, Poses, stack_poses
from armwright.tasks.obstacles import Obstacle

STARTS = 16  # of the inverse kinematics at each block's first pose
CANDIDATES = 4  # of the postures found there that lines are followed from
MAX_STEP = 0.05  # [rad] between neighbouring samples
MAX_SLIDE = 0.005  # [m] likewise of sliding joints
JOINT_STEPS = 16  # of a joint motion
MAX_REFINEMENT = 64  # of the samples
REDUCED = 0.75  # a step that twice the samples leave above this share of it is a jump
HOPELESS = 10.0  # times the tolerance that a path is off, beyond which it is not refined
ROUNDS = 4  # at least, of choosing candidates again where the chosen ones collide
LOOPS = 3  # of a closed cycle without joint motions, until it ends where it began
DISTINCT = 1e-3  # [rad] or [m] between candidates; nearer ones are the same
CLOSED = 1e-3  # [rad] or [m] between its ends
ON_LIMIT = 1e-6  # [rad] or [m] from the limit of a joint
LARGE_STEP = 0.5  # [rad] or [m] between coarse samples, where a jump is possible
SUSPECT = 100.0  # cost of such a step: above any detour, below what is certain to be infeasible
DEPTH = 1e-3  # [m] of a collision that costs as much as a path that is off by its tolerance
CHUNK = 2**12  # samples that a thread takes at a time
SPENT = 1e12  # cost of a posture that is a candidate already
BLOCKED = 1e3  # cost in seconds or radians of a chain that is off by its tolerance, far above any detour


@dataclass(frozen=True)
class BlockPaths:
    """N arms along the S samples of all blocks, from K candidates.

    Attributes:
        q: (N, K, S, D) joint values [rad] or [m].
        position_error: (N, K, S) distance of the tip from its sample [m].
        angle_error: (N, K, S) angle of the tool from its sample [rad].
    """

    q: Array
    position_error: Array
    angle_error: Array

    def choose(self, samples: LineSamples, choice: IndexArray, arms: IndexArray) -> Array:
        """Return the (n, S, D) joint values of some arms (n,) from one candidate per block; choice: (N, B)."""
        of_sample = np.repeat(choice[arms], np.diff(samples.first), axis=1)  # (n, S)
        return self.q[arms[:, None], of_sample, np.arange(len(samples.poses))]

    def ends(self, samples: LineSamples) -> tuple[Array, Array]:
        """Return the (N, B, K, D) first and last postures of each block."""
        first, last = samples.first[:-1], samples.first[1:] - 1
        return self.q[:, :, first].swapaxes(1, 2), self.q[:, :, last].swapaxes(1, 2)


@dataclass(frozen=True)
class CycleGroup:
    """Arms whose paths have equally many samples.

    Attributes:
        index: (n,) which of the N arms they are.
        arms: The arms.
        paths: Their path along each of the M motions.
    """

    index: IndexArray
    arms: ArmArrays
    paths: tuple[MotionPath, ...]


@dataclass(frozen=True)
class CyclePaths:
    """N arms along the M motions of a cycle.

    Attributes:
        plan: The cycle.
        groups: The joint paths.
        path_error: (N, M) largest distance of the tip from the line [m]; 0 for joint motions.
        path_angle: (N, M) largest angle of the tool from its direction along the line [rad].
        self_clearance: (N, M) smallest distance of two links that are not neighbours [m].
        obstacle_clearance: (N, M) smallest distance of a link from an obstacle [m].
        limit_distance: (N, M) smallest distance of a joint from its limits [rad] or [m].
        jumps: (N, M) True where the joint path is not continuous, or a joint meets its limit within a line, so that
            speeds are not.
        worst: (N, M, 3) share of the motion at which path error, angle and clearance are worst.
    """

    plan: CyclePlan
    groups: tuple[CycleGroup, ...]
    path_error: Array
    path_angle: Array
    self_clearance: Array
    obstacle_clearance: Array
    limit_distance: Array
    jumps: NDArray[np.bool_]
    worst: Array

    def of_arm(self, row: int) -> tuple[ArmArrays, tuple[MotionPath, ...]]:
        """Return an arm, as one of one, and its path along each motion."""
        for group in self.groups:
            (at,) = np.nonzero(group.index == row)
            if len(at):
                return group.arms[at], tuple(MotionPath(path.motion, path.q[at]) for path in group.paths)
        raise IndexError(f"expected an arm from 0 to {len(self.jumps) - 1}, got {row}")

    def postures(self, n_poses: int) -> Array:
        """Return (N, T, D) joint values at the first T poses of the plan, NaN where the cycle does not stop."""
        n, dof = len(self.jumps), self.groups[0].arms.dof
        q = np.full((n, n_poses, dof), np.nan)
        for group in self.groups:
            for path in reversed(group.paths):
                if path.motion.end < n_poses:
                    q[group.index, path.motion.end] = path.q[:, -1]
            first = group.paths[0]
            if first.motion.start < n_poses:
                q[group.index, first.motion.start] = first.q[:, 0]
        return q


def find_paths(
    arms: ArmArrays,
    plan: CyclePlan,
    obstacles: Sequence[Obstacle] = (),
    candidates: int = CANDIDATES,
    device: Device = "cpu",
) -> CyclePaths:
    """Find the joint paths of N arms through a cycle. A path that is off is a result, never an exception."""
    entry, ratios, hopeless = _choose(arms, plan, obstacles, candidates, device)
    n = len(arms)
    is_line = np.array([motion.by == "line" for motion in plan.motions])
    refinement, before = _refined(np.ones(n, dtype=np.intp), ratios.max(axis=1)), ratios[:, 0]
    jumps = np.zeros((n, len(plan.motions)), dtype=bool)
    groups: list[CycleGroup] = []
    unfinished = np.arange(n)
    while len(unfinished):
        factor = int(refinement[unfinished].min())
        index = unfinished[refinement[unfinished] == factor]
        part = arms[index]
        paths = _follow(part, plan, entry[index], factor, device)
        steps = np.stack([_step_ratio(part, path) for path in paths], axis=1)  # (n, M)
        along = np.where(is_line, steps, 0.0).max(axis=1)
        is_jump = (along > 1.0) & ((along > REDUCED * before[index]) | (factor >= MAX_REFINEMENT))
        done = (steps.max(axis=1) <= 1.0) | is_jump | hopeless[index] | (factor >= MAX_REFINEMENT)
        jumps[index] = is_jump[:, None] & is_line & (steps > 1.0)
        if done.any():
            found = tuple(MotionPath(path.motion, path.q[done]) for path in paths)
            groups.append(CycleGroup(index[done], part[np.flatnonzero(done)], found))
        before[index], refinement[index] = along, _refined(refinement[index], steps.max(axis=1))
        unfinished = np.setdiff1d(unfinished, index[done])
    return _measure(n, plan, groups, jumps, obstacles, device)


def _refined(refinement: IndexArray, ratio: Array) -> IndexArray:
    """Return the refinement that should bring the largest step down to what is allowed, doubled at least."""
    doublings = np.ceil(np.log2(np.clip(ratio, 1.0, 8.0))).astype(np.intp)
    return np.minimum(refinement * 2 ** np.where(ratio > 1.0, np.maximum(doublings, 1), 0), MAX_REFINEMENT)


def _step_ratio(arms: ArmArrays, path: MotionPath) -> Array:
    """Return the (N,) largest step of any joint relative to the allowed one."""
    return (path.largest_steps / np.where(arms.prismatic, MAX_SLIDE, MAX_STEP)).max(axis=1)


def _choose(
    arms: ArmArrays, plan: CyclePlan, obstacles: Sequence[Obstacle], candidates: int, device: Device
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the chosen paths.

    Returns:
        (N, B, D) posture at the first pose of each block, (N, 2) the ratios of the largest steps along lines and along
        joint motions to the allowed one, and (N,) True if the path is so far off that more samples cannot mend it.
    """
    samples = plan.sample()
    entry = entry_postures(arms, plan, obstacles, candidates, device)
    lines = follow_lines(arms, samples, entry, device)
    starts, ends = lines.ends(samples)
    for _ in range(LOOPS if plan.is_loop else 0):
        lines = follow_lines(arms, samples, ends, device)
        starts, ends = lines.ends(samples)
    speed = _speeds(arms)
    blocks = _block_costs(arms, lines, samples, speed)
    same = np.abs(starts[:, :, :, None] - starts[:, :, None]).max(axis=-1) < DISTINCT  # (N, B, K, K)
    blocks[np.tril(same, -1).any(axis=-1)] = np.inf  # equal to an earlier candidate
    if plan.is_loop:
        blocks += _cost_of(np.abs(ends - starts).max(axis=-1) / CLOSED - 1.0)
    following = starts[:, [(b + 1) % len(plan.blocks) for b in range(len(plan.joint_motions))]]
    change = np.abs(following[:, :, None] - ends[:, : len(plan.joint_motions), :, None])  # (N, E, K, K, D)
    edges = (change / speed[:, None, None, None]).max(axis=-1)
    choice = _avoid_collisions(arms, plan, samples, lines, blocks.copy(), edges.copy(), obstacles, device)
    index, block = np.arange(len(arms), dtype=np.intp), np.arange(len(plan.blocks))
    chosen, arm = lines.choose(samples, choice, index), index[:, None]
    steps = np.abs(np.diff(chosen, axis=1))
    steps[:, samples.first[1:-1] - 1] = 0.0  # from one block to the next
    joint_motion = np.arange(len(plan.joint_motions))
    turn = change[arm, joint_motion, choice[:, joint_motion], choice[:, (joint_motion + 1) % len(plan.blocks)]]
    allowed = np.where(arms.prismatic, MAX_SLIDE, MAX_STEP)[:, None]
    ratios = [(part / allowed).max(axis=(1, 2), initial=0.0) for part in (steps, turn / JOINT_STEPS)]
    hopeless = blocks[arm, block, choice].max(axis=1) > HOPELESS * BLOCKED
    return starts[arm, block, choice], np.stack(ratios, axis=1), hopeless


def _speeds(arms: ArmArrays) -> Array:
    """Return the (N, D) speeds of the joints, 1 rad/s or 1 m/s if unknown, for costs."""
    if arms.actuation is None:
        return np.ones(arms.motion.shape)
    speed = arms.actuation.no_load_speed
    return np.where(np.isfinite(speed), speed, 1.0)


def _block_costs(arms: ArmArrays, lines: BlockPaths, samples: LineSamples, speed: Array) -> Array:
    """Return the (N, B, K) cost of each block: least time along its lines, what it is off by, and what may jump."""
    poses, first = samples.poses, samples.first[:-1]
    off = np.maximum(lines.position_error / poses.tolerance, lines.angle_error / poses.angle_tolerance)
    change = np.zeros(lines.q.shape)
    change[:, :, 1:] = np.abs(np.diff(lines.q, axis=2))
    change[:, :, first] = 0.0
    lower, upper = arms.lower[:, None, None], arms.upper[:, None, None]
    on_limit = np.minimum(lines.q - lower, upper - lines.q) <= ON_LIMIT
    on_limit = np.any(on_limit & (arms.motion < FIXED)[:, None, None], axis=-1)
    on_limit[:, :, first] = False
    blocked = BLOCKED * on_limit + SUSPECT * (change.max(axis=-1) > LARGE_STEP)
    step = (change / speed[:, None, None]).max(axis=-1)
    worst = np.maximum.reduceat(off, first, axis=2).swapaxes(1, 2)
    cost = np.add.reduceat(step, first, axis=2).swapaxes(1, 2) + _cost_of(worst - 1.0)
    return cost + np.maximum.reduceat(blocked, first, axis=2).swapaxes(1, 2)


def _cost_of(excess: Array) -> Array:
    """Return the cost of exceeding a tolerance; excess: relative to the tolerance."""
    return np.where(excess > 0.0, BLOCKED * (1.0 + np.minimum(excess, 1e6)), 0.0)


def _avoid_collisions(
    arms: ArmArrays,
    plan: CyclePlan,
    samples: LineSamples,
    lines: BlockPaths,
    blocks: Array,
    edges: Array,
    obstacles: Sequence[Obstacle],
    device: Device,
) -> IndexArray:
    """Return the (N, B) candidates with the least cost, collisions included, which are measured only if chosen."""
    closed = plan.cycle.closed and not plan.is_loop
    choice = choose_candidates(blocks, edges, closed)
    index = np.arange(len(arms))
    share = np.arange(1, JOINT_STEPS) / JOINT_STEPS
    n_blocks, n_edges = blocks.shape[1], edges.shape[1]
    for _ in range(max(ROUNDS, blocks.shape[2])):
        part = arms[index]
        chosen = lines.choose(samples, choice, index)  # (n, S, D)
        start = chosen[:, samples.first[1:] - 1][:, :n_edges]
        change = chosen[:, [samples.first[(b + 1) % n_blocks] for b in range(n_edges)]] - start
        between = start[:, :, None] + share[:, None] * change[:, :, None]  # (n, E, F, D)
        q = np.concatenate([chosen, between.reshape(len(index), -1, arms.dof)], axis=1)
        depth = np.maximum(0.0, -np.minimum(*clearances(part, q, obstacles, device)))
        in_blocks = np.maximum.reduceat(depth[:, : chosen.shape[1]], samples.first[:-1], axis=1)
        in_edges = depth[:, chosen.shape[1] :].reshape(len(index), n_edges, len(share)).max(axis=2, initial=0.0)
        colliding = (in_blocks > 0.0).any(axis=1) | (in_edges > 0.0).any(axis=1)
        if not colliding.any():
            break
        edge = np.arange(n_edges, dtype=np.intp)
        blocks[index[:, None], np.arange(n_blocks), choice[index]] += _cost_of(in_blocks / DEPTH)
        following = choice[index][:, (edge + 1) % n_blocks]
        edges[index[:, None], edge, choice[index][:, :n_edges], following] += _cost_of(in_edges / DEPTH)
        index = index[colliding]
        choice[index] = choose_candidates(blocks[index], edges[index], closed)
    return choice


def _follow(arms: ArmArrays, plan: CyclePlan, entry: Array, refinement: int, device: Device) -> tuple[MotionPath, ...]:
    """Return the path of arms along each motion; entry: (N, B, D) postures at the first pose of each block."""
    samples = plan.sample(refinement)
    q = follow_lines(arms, samples, entry[:, :, None], device).q[:, 0]  # (N, S, D)
    share = np.linspace(0.0, 1.0, refinement * JOINT_STEPS + 1)[:, None]
    paths: list[MotionPath] = []
    for index, motion in enumerate(plan.motions):
        if motion.by == "line":
            first, last = samples.of_motion[index]
            paths.append(MotionPath(motion, q[:, first : last + 1]))
        else:
            block = plan.joint_motions.index(index)
            start = q[:, samples.first[block + 1] - 1, None]
            end = q[:, samples.first[(block + 1) % len(plan.blocks)], None]
            paths.append(MotionPath(motion, (1.0 - share) * start + share * end))
    return tuple(paths)


def _measure(
    n: int,
    plan: CyclePlan,
    groups: Sequence[CycleGroup],
    jumps: NDArray[np.bool_],
    obstacles: Sequence[Obstacle],
    device: Device,
) -> CyclePaths:
    """Return the paths with what they are off by and how near they come."""
    m = len(plan.motions)
    values = np.zeros((5, n, m))
    worst = np.zeros((n, m, 3))
    for group in groups:
        if plan.is_loop:
            gap = np.abs(group.paths[-1].q[:, -1] - group.paths[0].q[:, 0]).max(axis=1)
            jumps[group.index, -1] |= gap > CLOSED
        errors = _line_errors(group, plan, device)
        q = np.concatenate([path.q for path in group.paths], axis=1)
        clearance = np.stack(clearances(group.arms, q, obstacles, device))  # (2, n, R)
        margin = np.minimum(q - group.arms.lower[:, None], group.arms.upper[:, None] - q)
        margin = np.where(group.arms.motion[:, None] == FIXED, np.inf, margin).min(axis=2)
        at = 0
        for i, path in enumerate(group.paths):
            end = at + path.q.shape[1]
            own = clearance[:, :, at:end]
            if errors[i] is not None:
                values[:2, group.index, i] = errors[i].max(axis=1).T
                worst[group.index, i, :2] = errors[i].argmax(axis=1) / (errors[i].shape[1] - 1)
            values[2:4, group.index, i] = own.min(axis=2)
            worst[group.index, i, 2] = own.min(axis=0).argmin(axis=1) / (path.q.shape[1] - 1)
            values[4, group.index, i] = margin[:, at:end].min(axis=1)
            if path.motion.by == "line":  # where a joint meets its limit, the speeds of the others jump
                jumps[group.index, i] |= (margin[:, at + 1 : end - 1] <= ON_LIMIT).any(axis=1)
            at = end
    path_error, path_angle, own, clear, margin = values
    return CyclePaths(plan, tuple(groups), path_error, path_angle, own, clear, margin, jumps, worst)


def _line_errors(group: CycleGroup, plan: CyclePlan, device: Device) -> list[Any]:
    """Return (n, 2 R + 1, 2) distance [m] and angle [rad] off each line, between the samples too; None for others."""
    lines = [path for path in group.paths if path.motion.by == "line"]
    if not lines:
        return [None] * len(group.paths)
    shares = [np.linspace(0.0, 1.0, 2 * path.q.shape[1] - 1) for path in lines]
    poses = stack_poses([plan.line(path.motion, share) for path, share in zip(lines, shares, strict=True)])
    q = np.concatenate([path.at(share) for path, share in zip(lines, shares, strict=True)], axis=1)
    errors = iter(np.split(tool_errors(group.arms, poses, q, device), np.cumsum([len(s) for s in shares])[:-1], axis=1))
    return [next(errors) if path.motion.by == "line" else None for path in group.paths]


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
    repeated = poses[np.repeat(np.arange(b), starts)]
    lower, upper = arms.lower.astype(np.float64), arms.upper.astype(np.float64)
    shares = np.random.default_rng(0).uniform(size=(starts, MAX_JOINTS))[:, : arms.dof]
    start = lower[:, None] + shares * (upper - lower)[:, None]  # (N, S, D)
    start[:, 0] = 0.0
    start = np.where(arms.motion[:, None] == FIXED, 0.0, start)
    solved = solve_postures(
        arms,
        repeated.position,
        initial_q=np.tile(start, (1, b, 1)),
        target_arrays=repeated.arrays,
        precision=arms.precision,
        device=device,
    )
    q = solved.q.astype(np.float64)
    distance = np.linalg.norm(solved.reached - repeated.position, axis=-1)
    off = np.maximum(distance / repeated.tolerance, solved.angle / repeated.angle_tolerance)
    depth = np.maximum(0.0, -np.minimum(*clearances(arms, q, obstacles, device)))
    room = np.minimum(q - lower[:, None], upper[:, None] - q) / (upper - lower)[:, None]
    room = np.where(arms.motion[:, None] == FIXED, 1.0, room).min(axis=-1)
    cost = (_cost_of(off - 1.0) + _cost_of(depth / DEPTH) - room).reshape(n, b, starts)
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


def follow_lines(arms: ArmArrays, samples: LineSamples, entry: Array, device: Device = "cpu") -> BlockPaths:
    """Follow all lines from the candidates of each block.

    Args:
        arms: N arms.
        samples: S samples in B blocks.
        entry: (N, B, K, D) postures at the first sample of each block.
        device: The device to solve on.
    """
    wp, kernels = load_path(device)
    n, b, k, dof = entry.shape
    s = len(samples.poses)
    paths = BlockPaths(np.empty((n, k, s, dof)), np.empty((n, k, s)), np.empty((n, k, s)))

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        path = _on_device(part, samples.poses, samples.first, wp, kernels, device)
        start = _array(entry[chunk].reshape(len(part), b * k, dof), kernels.real, wp, device)
        results = [wp.empty((len(part), *v.shape[1:]), dtype=kernels.real, device=device) for v in vars(paths).values()]
        wp.launch(kernels.follow, (len(part), b * k), inputs=[path, start, *results], device=device)
        for values, result in zip(vars(paths).values(), results, strict=True):
            values[chunk] = result.numpy()

    in_chunks(solve, n, max(1, CHUNK // (s * k)), device)
    return paths


def tool_errors(arms: ArmArrays, poses: Poses, q: Array, device: Device = "cpu") -> Array:
    """Return (N, S, 2) distance of the tip [m] and angle of the tool [rad] from poses; q: (N, S, D)."""
    wp, kernels = load_path(device)
    errors = np.empty((*q.shape[:2], 2))

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        path = _on_device(part, poses, np.array([0, len(poses)]), wp, kernels, device)
        found = wp.empty((len(part), len(poses), 2), dtype=kernels.real, device=device)
        inputs = [path, _array(q[chunk], kernels.real, wp, device), found]
        wp.launch(kernels.tool_errors, (len(part), len(poses)), inputs=inputs, device=device)
        errors[chunk] = found.numpy()

    in_chunks(solve, len(arms), max(1, CHUNK // len(poses)), device)
    return errors


def _on_device(arms: ArmArrays, poses: Poses, first: IndexArray, wp: Any, kernels: Any, device: Device) -> Any:
    """Return arms and poses as the kernels take them; first: (B + 1,) index of each block's first pose."""
    values: dict[str, Any] = {
        name: getattr(arms, name).astype(np.float64)
        for name in ("base", "lower", "upper", "offset", "tool_axis", "tool_side")
    }
    values |= {"motion": arms.motion, "first": first.astype(np.int32)}
    values |= {"n_angular": poses.n_angular.astype(np.int32), "position": poses.position}
    values |= {axis: poses.rotation[:, :, i] for i, axis in enumerate("xyz")}
    path = kernels.Path()
    path.dof = arms.dof
    for name, array in values.items():
        setattr(path, name, _array(array, kernels.Path.vars[name].type.dtype, wp, device))
    return path


def _array(values: NDArray[Any], dtype: Any, wp: Any, device: Device) -> Any:
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device, copy=False)
