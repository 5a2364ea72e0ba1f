"""Choice of one candidate per block of a cycle, for the cycle as a whole, by dynamic programming."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.contact.clearance import path_clearances
from armwright.kinematics.cycle.costs import BLOCKED, cost_of, joint_speeds
from armwright.kinematics.cycle.line_following import BlockPaths, IndexArray, follow_lines
from armwright.kinematics.devices import Device, load_kernels
from armwright.kinematics.ik.ik import solve_postures
from armwright.tasks.motions import JOINT_STEPS, CyclePlan, LineSamples
from armwright.tasks.obstacles import Obstacle

MAX_STEP = 0.05  # [rad] between neighbouring samples
MAX_SLIDE = 0.005  # [m] likewise of sliding joints
HOPELESS = 10.0  # times the tolerance that a path is off, beyond which it is not refined
ROUNDS = 4  # of choosing candidates again where the chosen ones collide
LOOPS = 3  # of a closed cycle without joint motions, until it ends where it began
CLOSED = 1e-3  # [rad] or [m] between the ends of a closed cycle
DEPTH = 1e-3  # [m] of a collision that costs as much as a path that is off by its tolerance
LOAD = 1.0  # cost in seconds of a block in which a motor at rest gives its continuous torque
OVERLOAD = 3.0  # times the continuous torque; more costs no more, so that collisions count first


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
    lines = _follow_once(arms, plan, samples, begin, device)
    for _ in range(LOOPS if plan.is_loop else 0):
        begin = lines.ends(samples)[1]
        lines = follow_lines(arms, samples, begin, device)
    starts, ends = lines.ends(samples)
    blocks = lines.cost
    if plan.is_loop:
        blocks = blocks + cost_of(np.abs(ends - starts).max(axis=-1) / CLOSED - 1.0)
    branches = (blocks < BLOCKED).sum(axis=2)
    loads = LOAD * _static_loads(arms, plan, np.stack([starts, ends]), payload, device)
    block_costs, edge_costs = blocks + loads, _joint_motions(arms, plan, samples, lines.q, device)
    choice = _avoid_collisions(arms, plan, samples, lines, block_costs, edge_costs, obstacles, device)
    arm, block = np.arange(len(arms), dtype=np.intp)[:, None], np.arange(len(plan.blocks))
    chosen, edge = lines.choose(samples, choice, arm[:, 0]), np.arange(len(plan.joint_motions))
    steps = np.abs(chosen - chosen[:, samples.before])
    following = (edge + 1) % len(plan.blocks)
    turn = np.abs(chosen[:, samples.first[following]] - chosen[:, samples.end[edge]])
    taken = edge_costs[arm, edge, choice[:, edge], choice[:, following]]
    costs = np.concatenate([block_costs[arm, block, choice], taken], axis=1)
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


def _follow_once(arms: ArmArrays, plan: CyclePlan, samples: LineSamples, entry: Array, device: Device) -> BlockPaths:
    """Return what `follow_lines` does; blocks that are alike are followed once, if their candidates are the same."""
    own, alike = plan.alike
    pairs = [(block, own[i]) for block, i in enumerate(alike) if own[i] < block]
    pairs = [pair for pair in pairs if np.array_equal(*entry[:, pair].swapaxes(0, 1), equal_nan=True)]
    entry = entry.copy()
    entry[:, [block for block, _ in pairs]] = np.nan
    lines = follow_lines(arms, samples, entry, device)
    for block, other in pairs:
        to, of = (slice(samples.first[b], samples.first[b + 1]) for b in (block, other))
        lines.q[:, :, to], lines.cost[:, block] = lines.q[:, :, of], lines.cost[:, other]
    return lines


def _static_loads(arms: ArmArrays, plan: CyclePlan, q: Array, payload: float, device: Device) -> Array:
    """Return (N, B, K) fourth powers of the largest share of a continuous torque at rest, the mean of a block's ends.

    q: (2, N, B, K, D) first and last postures.
    """
    _, n, b, k, dof = q.shape
    loads, drives = np.zeros((n, b, k)), arms.actuation
    if drives is None:
        return loads
    motions = [(*block.lines, *plan.joint_motions[max(at - 1, 0) : at + 1]) for at, block in enumerate(plan.blocks)]
    carries = [float(any(plan.motions[index].carries for index in each)) for each in motions]
    arm, candidate = np.nonzero(~np.isnan(q[0, ..., 0]).all(axis=1))
    anywhere = plan.poses[[0] * (2 * b)]
    torque = solve_postures(
        arms[arm],
        anywhere.position,
        0,
        initial_q=np.nan_to_num(q[:, arm, :, candidate].reshape(len(arm), -1, dof)),
        payload=payload * np.tile(carries, 2),
        target_arrays=anywhere.arrays,
        precision=arms.precision,
        device=device,
        motions=arms.general_motions,
    ).torque.reshape(-1, 2, b, dof)
    limit = np.nan_to_num(np.fmin(drives.continuous, drives.peak), nan=np.inf) / drives.safety_factor[:, None]
    share = (np.abs(torque) / limit[arm, None, None]).max(axis=-1)
    loads[arm, :, candidate] = (np.minimum(share, OVERLOAD) ** 4).mean(axis=1)
    return loads


def _joint_motions(arms: ArmArrays, plan: CyclePlan, samples: LineSamples, q: Array, device: Device) -> Array:
    """Return (N, E, K, K) costs of the joint motions between candidates, whose lines are at q: (N, K, S, D)."""
    times = np.full(len(plan.joint_motions), np.inf)
    if arms.actuation is not None:
        times[:] = [plan.times[plan.motions[index].step] or np.inf for index in plan.joint_motions]
    costs = np.empty((len(arms), len(times), *q.shape[1:2] * 2))
    inputs = (q, samples.first, samples.end, joint_speeds(arms), times)
    load_kernels("cycle.choice_kernels", device).launch("joint_motions", costs.shape[:3], *inputs, outputs=[costs])
    return costs


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
    index = np.arange(len(arms), dtype=np.intp)
    choice = choose_candidates(blocks, edges, index, device)
    share = np.arange(1, JOINT_STEPS) / JOINT_STEPS
    edge, block = (np.arange(costs.shape[1], dtype=np.intp) for costs in (edges, blocks))
    following = (edge + 1) % len(block)
    best, least = choice.copy(), np.full(len(arms), np.inf)
    free_blocks, free_edges = blocks.copy(), edges.copy()
    for _ in range(ROUNDS if blocks.shape[2] > 1 else 0):
        chosen = lines.choose(samples, choice, index)  # (n, S, D)
        start = chosen[:, samples.end[edge]]
        change = chosen[:, samples.first[following]] - start
        between = start[:, :, None] + share[:, None] * change[:, :, None]  # (n, E, F, D)
        q = np.concatenate([chosen, between.reshape(len(index), -1, arms.dof)], axis=1)
        found, _ = path_clearances(arms[index], q, plan.coarse_first, obstacles, device, plan.coarse_rules, most=0.0)
        depth = -found[:, 1].min(axis=0)  # (n, B + E)
        in_blocks, in_edges = depth[:, : len(block)], depth[:, len(block) :]
        colliding = (in_blocks > 0.0).any(axis=1) | (in_edges > 0.0).any(axis=1)
        arm, taken = index[:, None], choice[index]
        of_blocks, of_edges = (arm, block, taken), (arm, edge, taken[:, edge], taken[:, following])
        blocks[of_blocks] = free_blocks[of_blocks] + cost_of(in_blocks / DEPTH)
        edges[of_edges] = free_edges[of_edges] + cost_of(in_edges / DEPTH)
        cost = blocks[of_blocks].sum(axis=1) + edges[of_edges].sum(axis=1)
        better = index[cost < least[index]]
        best[better], least[index] = choice[better], np.minimum(cost, least[index])
        index, before = index[colliding], taken[colliding]
        if not len(index):
            break
        choice[index] = choose_candidates(blocks, edges, index, device)
        index = index[(before != choice[index]).any(axis=1)]  # else nothing is better
        if not len(index):
            break
    return best


def choose_candidates(blocks: Array, edges: Array, arms: IndexArray, device: Device = "cpu") -> IndexArray:
    """Return the (n, B) candidates with the least sum of costs, those of some arms (n,).

    Args:
        blocks: (N, B, K) cost of each block from each of its candidates.
        edges: (N, E, K, K) cost of the joint motion from candidate i of block b to candidate j of the next one; of the
            last block to the first one if the cycle is closed by a joint motion (E = B), else E = B - 1.
        arms: the indices of the arms.
        device: where they are chosen.
    """
    _, b, k = blocks.shape
    choice, n = np.zeros((len(arms), b), dtype=np.int32), len(arms)
    scratch = np.empty((n, 2, k)), np.empty((n, b, k), dtype=np.int32)
    loaded = load_kernels("cycle.choice_kernels", device)
    loaded.launch("choose", (n,), blocks, edges, arms, *scratch, outputs=[choice])
    return choice.astype(np.intp)
