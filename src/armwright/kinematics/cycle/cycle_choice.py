"""Choice of one candidate per block of a cycle, for the cycle as a whole, by dynamic programming."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.contact.clearance import path_clearances
from armwright.kinematics.cycle.line_following import BlockPaths, IndexArray, follow_lines
from armwright.kinematics.devices import Device
from armwright.kinematics.ik.ik import solve_postures
from armwright.tasks.motions import CyclePlan, LineSamples
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.tip_rules import joined_rules

MAX_STEP = 0.05  # [rad] between neighbouring samples
MAX_SLIDE = 0.005  # [m] likewise of sliding joints
JOINT_STEPS = 16  # of a joint motion
HOPELESS = 10.0  # times the tolerance that a path is off, beyond which it is not refined
ROUNDS = 4  # of choosing candidates again where the chosen ones collide
LOOPS = 3  # of a closed cycle without joint motions, until it ends where it began
CLOSED = 1e-3  # [rad] or [m] between the ends of a closed cycle
ON_LIMIT = 1e-6  # [rad] or [m] from the limit of a joint
LARGE_STEP = 0.5  # [rad] or [m] between coarse samples, where a jump is possible
SUSPECT = 100.0  # cost of such a step: above any detour, below what is certain to be infeasible
DEPTH = 1e-3  # [m] of a collision that costs as much as a path that is off by its tolerance
LOAD = 1.0  # cost in seconds of a block in which a motor at rest gives its continuous torque
OVERLOAD = 3.0  # times the continuous torque; more costs no more, so that collisions count first
PEAK_SPEED = 1.875  # of a motion, relative to its mean speed
SPENT = 1e12  # cost of what there is not
BLOCKED = 1e3  # cost in seconds or radians of a chain that is off by its tolerance, far above any detour


@dataclass(frozen=True)
class ChosenPostures:
    """What N arms take at the first pose of each of B blocks."""

    candidate: Array  # (N, B, D) the candidates that were chosen
    entry: Array  # (N, B, D) the postures from which lines are followed: the same, but of a loop, where it closes
    cost: Array  # (N,) of the chain, collisions included
    step_ratios: Array
    """(N, 2) the largest step of coarse samples relative to the allowed one, along lines and along joint motions."""
    hopeless: NDArray[np.bool_]  # (N,) True if the path is so far off that more samples cannot mend it
    branches: IndexArray  # (N, B) number of candidates that follow the lines of their block
    blocked: NDArray[np.bool_]  # (N,) True if a line or a joint motion is off, collides or is too fast


def choose_postures(
    arms: ArmArrays,
    plan: CyclePlan,
    entry: Array,
    obstacles: Sequence[Obstacle],
    device: Device,
    payload: float = 0.0,
) -> ChosenPostures:
    """Choose among the candidates (N, B, K, D) at the first pose of each block; NaN where there are fewer.

    payload: its mass when carried [kg].
    """
    samples, begin = plan.sample(), entry
    lines = follow_lines(arms, samples, begin, device)
    starts, ends = lines.ends(samples)
    for _ in range(LOOPS if plan.is_loop else 0):
        begin = ends
        lines = follow_lines(arms, samples, begin, device)
        starts, ends = lines.ends(samples)
    speed = _speeds(arms)
    blocks = np.nan_to_num(_block_costs(arms, lines, samples, speed), nan=SPENT, posinf=SPENT)
    if plan.is_loop:
        blocks += cost_of(np.abs(ends - starts).max(axis=-1) / CLOSED - 1.0)
    following = starts[:, [(b + 1) % len(plan.blocks) for b in range(len(plan.joint_motions))]]
    change = np.abs(following[:, :, None] - ends[:, : len(plan.joint_motions), :, None])  # (N, E, K, K, D)
    edges = np.nan_to_num((change / speed[:, None, None, None]).max(axis=-1), nan=SPENT, posinf=SPENT)
    branches = (blocks < BLOCKED).sum(axis=2)
    loads = LOAD * _static_loads(arms, plan, np.stack([starts, ends]), payload, device)
    if arms.actuation is not None:
        times = [plan.times[plan.motions[index].step] or np.inf for index in plan.joint_motions]
        edges += cost_of(PEAK_SPEED * edges / np.array(times)[:, None, None] - 1.0)
    block_costs, edge_costs = blocks + loads, edges.copy()
    choice = _avoid_collisions(arms, plan, samples, lines, block_costs, edge_costs, obstacles, device)
    index, block = np.arange(len(arms), dtype=np.intp), np.arange(len(plan.blocks))
    chosen, arm = lines.choose(samples, choice, index), index[:, None]
    steps = np.abs(np.diff(chosen, axis=1))
    steps[:, samples.first[1:-1] - 1] = 0.0  # from one block to the next
    joint_motion = np.arange(len(plan.joint_motions))
    taken = (arm, joint_motion, choice[:, joint_motion], choice[:, (joint_motion + 1) % len(plan.blocks)])
    turn = change[taken]
    costs = np.concatenate([block_costs[arm, block, choice], edge_costs[taken]], axis=1)
    allowed = np.where(arms.prismatic, MAX_SLIDE, MAX_STEP)[:, None]
    ratios = [(part / allowed).max(axis=(1, 2), initial=0.0) for part in (steps, turn / JOINT_STEPS)]
    hopeless = blocks[arm, block, choice].max(axis=1) > HOPELESS * BLOCKED
    return ChosenPostures(
        entry[arm, block, choice],
        begin[arm, block, choice],
        costs.sum(axis=1),
        np.stack(ratios, axis=1),
        hopeless,
        branches,
        blocked=np.any(costs >= BLOCKED, axis=1),
    )


def _static_loads(arms: ArmArrays, plan: CyclePlan, q: Array, payload: float, device: Device) -> Array:
    """Return (N, B, K) fourth powers of the largest share of a continuous torque at rest, the mean of a block's ends.

    q: (2, N, B, K, D) first and last postures.
    """
    _, n, b, k, dof = q.shape
    if arms.actuation is None:
        return np.zeros((n, b, k))
    motions = [(*block.lines, *plan.joint_motions[max(at - 1, 0) : at + 1]) for at, block in enumerate(plan.blocks)]
    carries = [float(any(plan.motions[index].carries for index in each)) for each in motions]
    torque = solve_postures(
        arms,
        np.zeros((2 * b * k, 3)),
        0,
        initial_q=np.nan_to_num(q.swapaxes(0, 1).reshape(n, -1, dof)),
        payload=payload * np.tile(np.repeat(carries, k), 2),
        precision=arms.precision,
        device=device,
    ).torque.reshape(n, 2, b, k, dof)
    drives = arms.actuation
    limit = np.nan_to_num(np.fmin(drives.continuous, drives.peak), nan=np.inf) / drives.safety_factor[:, None]
    share = (np.abs(torque) / limit[:, None, None, None]).max(axis=-1)
    return (np.minimum(share, OVERLOAD) ** 4).mean(axis=1)


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
    on_limit = arms.limit_distance(lines.q) <= ON_LIMIT
    on_limit[:, :, first] = False
    blocked = BLOCKED * on_limit + SUSPECT * (change.max(axis=-1) > LARGE_STEP)
    step = (change / speed[:, None, None]).max(axis=-1)
    worst = np.maximum.reduceat(off, first, axis=2).swapaxes(1, 2)
    cost = np.add.reduceat(step, first, axis=2).swapaxes(1, 2) + cost_of(worst - 1.0)
    return cost + np.maximum.reduceat(blocked, first, axis=2).swapaxes(1, 2)


def cost_of(excess: Array) -> Array:
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
    """Return the (N, B) candidates with the least cost of those whose collisions were measured, the cheapest first."""
    closed = plan.cycle.closed and not plan.is_loop
    choice = choose_candidates(blocks, edges, closed)
    index = np.arange(len(arms))
    share = np.arange(1, JOINT_STEPS) / JOINT_STEPS
    n_blocks, n_edges, candidates = blocks.shape[1], edges.shape[1], blocks.shape[2]
    joint_motions = [plan.rules(plan.motions[i], share) for i in plan.joint_motions[:n_edges]]
    rules = joined_rules([plan.sampled_rules(samples), *joint_motions])
    best, least = choice.copy(), np.full(len(arms), np.inf)
    free_blocks, free_edges = blocks.copy(), edges.copy()
    for _ in range(ROUNDS if candidates > 1 else 0):
        if not len(index):
            break
        part = arms[index]
        chosen = lines.choose(samples, choice, index)  # (n, S, D)
        start = chosen[:, samples.first[1:] - 1][:, :n_edges]
        change = chosen[:, [samples.first[(b + 1) % n_blocks] for b in range(n_edges)]] - start
        between = start[:, :, None] + share[:, None] * change[:, :, None]  # (n, E, F, D)
        q = np.concatenate([chosen, between.reshape(len(index), -1, arms.dof)], axis=1)
        first = [*samples.first, *(samples.first[-1] + len(share) * (edge + 1) for edge in range(n_edges))]
        depth = -path_clearances(part, q, first, obstacles, device, rules, most=0.0)[0][:, 1].min(axis=0)  # (n, B + E)
        in_blocks, in_edges = depth[:, :n_blocks], depth[:, n_blocks:]
        colliding = (in_blocks > 0.0).any(axis=1) | (in_edges > 0.0).any(axis=1)
        edge, block = np.arange(n_edges, dtype=np.intp), np.arange(n_blocks, dtype=np.intp)
        of_blocks = index[:, None], block, choice[index]
        of_edges = index[:, None], edge, choice[index][:, :n_edges], choice[index][:, (edge + 1) % n_blocks]
        blocks[of_blocks] = free_blocks[of_blocks] + cost_of(in_blocks / DEPTH)
        edges[of_edges] = free_edges[of_edges] + cost_of(in_edges / DEPTH)
        cost = blocks[of_blocks].sum(axis=1) + edges[of_edges].sum(axis=1)
        better = index[cost < least[index]]
        best[better], least[index] = choice[better], np.minimum(cost, least[index])
        index = index[colliding]
        before, choice[index] = choice[index], choose_candidates(blocks[index], edges[index], closed)
        index = index[(before != choice[index]).any(axis=1)]  # else nothing is better
    return best


def choose_candidates(blocks: Array, edges: Array, closed: bool) -> IndexArray:
    """Return the (N, B) candidates with the least sum of costs.

    Args:
        blocks: (N, B, K) cost of each block from each of its candidates.
        edges: (N, E, K, K) cost of the joint motion from candidate i of block b to candidate j of the next one; of the
            last block to the first one if the cycle is closed by a joint motion (E = B), else E = B - 1.
        closed: Whether a joint motion leads from the last block to the first.
    """
    n, b, k = blocks.shape
    # total[:, s, j]: cost of the best chain from candidate s of the first block to candidate j of the present one.
    total = np.where(np.eye(k, dtype=bool), blocks[:, 0, :, None], np.inf)
    came_from: list[IndexArray] = []
    for block in range(1, b):
        through = total[:, :, :, None] + edges[:, block - 1, None]  # (N, s, i, j)
        came_from.append(through.argmin(axis=2))
        total = through.min(axis=2) + blocks[:, block, None]
    if closed:
        total = total + edges[:, b - 1].swapaxes(1, 2)  # from candidate j of the last block to s
    start, end = np.divmod(total.reshape(n, k * k).argmin(axis=1), k)
    arm = np.arange(n, dtype=np.intp)
    choice = np.empty((n, b), dtype=np.intp)
    choice[:, -1] = end
    for block in range(b - 1, 0, -1):
        choice[:, block - 1] = came_from[block - 1][arm, start, choice[:, block]]
    return choice
