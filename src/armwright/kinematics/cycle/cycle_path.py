"""One continuous joint path through a cycle.

A block's first pose has K postures from different starts of the inverse kinematics (entry_postures.py). Each is
followed along the block's lines, coarsely; joint motions join the blocks. Which candidate each block takes is chosen
for the cycle as a whole (cycle_choice.py), as in the ladder graph of Descartes (ROS-Industrial). The chosen path is
then followed with as many samples as it takes for neighbours to be near.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.contact.clearance import path_clearances
from armwright.kinematics.cycle.costs import ON_LIMIT
from armwright.kinematics.cycle.cycle_choice import CLOSED, MAX_SLIDE, MAX_STEP, choose_postures
from armwright.kinematics.cycle.entry_postures import CANDIDATES, entry_postures
from armwright.kinematics.cycle.instants import EQUAL, FEW, Instants, Picks, picks
from armwright.kinematics.cycle.line_following import IndexArray, follow_lines, tool_errors
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.devices import Device
from armwright.tasks.motions import JOINT_STEPS, NEAR_END, CyclePlan
from armwright.tasks.obstacles import Obstacle

MAX_REFINEMENT = 64  # of the samples
SHARP = 4.0  # times the mean step of a line that makes its largest one a peak
REDUCED = 0.75  # a step that twice the samples leave above this share of it is a jump
NEAR = 0.03  # [m] clearance at samples of a joint motion, below which bodies may touch between them
ZOOMS, BETWEEN = 3, np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # rounds of a search there; its places in quarter steps
ROUGH = 0.25  # refinement of a rough path
BETWEEN_INSTANTS = 16  # times as many instants of a sharp path, of which the largest values count


@dataclass(frozen=True)
class CycleGroup:
    """Arms whose paths have equally many samples, and are all sharp or not."""

    index: IndexArray  # (n,) which of the N arms they are
    arms: ArmArrays  # the arms
    paths: tuple[MotionPath, ...]  # their path along each of the M motions
    source: IndexArray  # (n, M) the motion whose path each one takes, itself or an earlier one; see `_sources`
    is_sharp: bool  # whether joints move several times as fast in a short part of a line as on average

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of samples along each motion."""
        return tuple(path.q.shape[1] for path in self.paths)

    @property
    def density(self) -> int:
        """How many times as many instants are evaluated as are kept."""
        return BETWEEN_INSTANTS if self.is_sharp else 1

    def picks(self, paths: "CyclePaths") -> Picks:
        """Return the samples that the loads at the instants need."""
        return picks(self.counts, paths.plan.source, paths.instants.times(self.density))

    def __getitem__(self, rows: NDArray[np.bool_]) -> "CycleGroup":
        """Return some of the arms."""
        if rows.all():
            return self
        paths = tuple(MotionPath(path.motion, path.q[rows]) for path in self.paths)
        return CycleGroup(self.index[rows], self.arms[np.flatnonzero(rows)], paths, self.source[rows], self.is_sharp)


@dataclass(frozen=True)
class CyclePaths:
    """N arms along the M motions of a cycle.

    What means nothing of an arm is not computed, but NaN: clearances if its path is far off, loads if it jumps, too.
    """

    plan: CyclePlan  # the cycle
    entry: Array
    """(N, B, D) the candidate at the first pose of each block, from which the same paths are found again."""
    groups: tuple[CycleGroup, ...]  # the joint paths
    path_error: Array  # (N, M) largest distance of the tip from the line [m]; 0 for joint motions
    path_angle: Array  # (N, M) largest angle of the tool from its direction along the line [rad]
    self_clearance: Array  # (N, M) smallest distance of two links or motor bodies that are not neighbours [m]
    obstacle_clearance: Array  # (N, M) smallest distance of a link or motor body from an obstacle [m]
    limit_distance: Array  # (N, M) smallest distance of a joint from its limits [rad] or [m]
    jumps: NDArray[np.bool_]
    """(N, M) True where the joint path is not continuous, or a joint meets its limit within a line, so that speeds are
    not."""
    worst: Array  # (N, M, 3) share of the motion at which path error, angle and clearance are worst
    is_off: NDArray[np.bool_]  # (N,) True if the path is far off, so that neither clearances nor jumps are known
    branches: IndexArray | None = None  # (N, B) as in `ChosenPostures`; None for rough paths
    candidates: Array | None = None  # (N, B, K, D) postures at the first pose of each block that were to choose from
    blocked: NDArray[np.bool_] | None = None  # (N,) as in `ChosenPostures`; None for rough paths
    instants: Instants = EQUAL  # of each motion, at which its loads are evaluated

    @property
    def is_stopped(self) -> NDArray[np.bool_]:
        """(N,) True for arms without loads."""
        return self.is_off | self.jumps.any(axis=1)

    @cached_property
    def loaded(self) -> tuple[CycleGroup, ...]:
        """The groups of the arms with loads."""
        parts = (group[~self.is_stopped[group.index]] for group in self.groups)
        return tuple(part for part in parts if len(part.index))

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
    candidates: int | None = None,
    device: Device = "cpu",
    postures: Array | None = None,
    payload: float = 0.0,
) -> CyclePaths:
    """Find the joint paths of N arms through a cycle. A path that is off is a result, never an exception.

    candidates: K, the number of postures at the first pose of each block to choose from; None for 32.  postures:
    (N, B, K, D) those to choose from instead.  payload: its mass when carried [kg].
    """
    if postures is None:
        postures = entry_postures(arms, plan, obstacles, candidates or CANDIDATES, device)
    chosen = choose_postures(arms, plan, postures, obstacles, device, payload)
    n, entry, ratios = len(arms), chosen.entry, chosen.step_ratios
    is_line = np.array([motion.by == "line" for motion in plan.motions])
    refinement, before = _refined(np.ones(n, dtype=np.intp), ratios.max(axis=1)), ratios[:, 0]
    refinement[chosen.hopeless] = 1  # samples cannot mend these paths
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
        done = (steps.max(axis=1) <= 1.0) | is_jump | chosen.hopeless[index] | (factor >= MAX_REFINEMENT)
        jumps[index] = is_jump[:, None] & is_line & (steps > 1.0)
        sharp = _is_sharp(part, paths) & ~is_jump & ~chosen.hopeless[index]
        whole = CycleGroup(index, part, paths, _sources(plan, paths), is_sharp=False)
        off = chosen.hopeless[index]
        for rows, kind in ((done & ~sharp & ~off, False), (done & off, False), (done & sharp, True)):
            if rows.any():
                groups.append(replace(whole[rows], is_sharp=kind))
        before[index], refinement[index] = along, _refined(refinement[index], steps.max(axis=1))
        unfinished = np.setdiff1d(unfinished, index[done])
    found = _measure(arms, plan, chosen.candidate, groups, jumps, chosen.hopeless, obstacles, device)
    return replace(found, branches=chosen.branches, candidates=postures, blocked=chosen.blocked)


def rough_paths(
    arms: ArmArrays, plan: CyclePlan, near: Array, obstacles: Sequence[Obstacle] = (), device: Device = "cpu"
) -> CyclePaths:
    """Estimate the joint paths of N arms through a cycle by a few samples.

    Nothing is chosen or refined. Of jumps only those are found that come from a joint at its limit.

    near: (N, B, D) postures near those at the first pose of each block.
    """
    entry = np.clip(near, arms.lower[:, None], arms.upper[:, None])
    paths = _follow(arms, plan, entry, ROUGH, device)
    group = CycleGroup(np.arange(len(arms)), arms, paths, _sources(plan, paths), is_sharp=False)
    jumps, off = np.zeros((len(arms), len(paths)), dtype=bool), np.zeros(len(arms), dtype=bool)
    return replace(_measure(arms, plan, entry, [group], jumps, off, obstacles, device, between=1), instants=FEW)


def _refined(refinement: IndexArray, ratio: Array) -> IndexArray:
    """Return the refinement that should bring the largest step down to what is allowed, doubled at least."""
    doublings = np.ceil(np.log2(np.clip(ratio, 1.0, 8.0))).astype(np.intp)
    return np.minimum(refinement * 2 ** np.where(ratio > 1.0, np.maximum(doublings, 1), 0), MAX_REFINEMENT)


def _step_ratio(arms: ArmArrays, path: MotionPath) -> Array:
    """Return the (N,) largest step of any joint relative to the allowed one."""
    return (path.largest_steps / np.where(arms.prismatic, MAX_SLIDE, MAX_STEP)).max(axis=1)


def _is_sharp(arms: ArmArrays, paths: Sequence[MotionPath]) -> NDArray[np.bool_]:
    """Return (N,) whether a step along a line is several times as large as the mean of the line."""
    sharp = np.zeros(len(arms), dtype=bool)
    allowed = np.where(arms.prismatic, MAX_SLIDE, MAX_STEP)[:, None]
    for path in paths:
        if path.motion.by == "line":
            steps = (np.abs(np.diff(path.q, axis=1)) / allowed).max(axis=2)
            sharp |= steps.max(axis=1) > SHARP * steps.mean(axis=1)
    return sharp


def _follow(
    arms: ArmArrays, plan: CyclePlan, entry: Array, refinement: float, device: Device
) -> tuple[MotionPath, ...]:
    """Return the path of arms along each motion; entry: (N, B, D) postures at the first pose of each block."""
    samples = plan.sample(refinement)
    q = follow_lines(arms, samples, entry[:, :, None], device).q[:, 0]  # (N, S, D)
    share = np.linspace(0.0, 1.0, math.ceil(refinement * JOINT_STEPS) + 1)[:, None]
    paths: list[MotionPath] = []
    for index, motion in enumerate(plan.motions):
        if motion.by == "line":
            paths.append(MotionPath(motion, q[:, samples.of_motion[index]]))
        else:
            block = plan.joint_motions.index(index)
            start = q[:, samples.end[block], None]
            end = q[:, samples.first[(block + 1) % len(plan.blocks)], None]
            paths.append(MotionPath(motion, (1.0 - share) * start + share * end))
    return tuple(paths)


def _sources(plan: CyclePlan, paths: Sequence[MotionPath]) -> IndexArray:
    """Return (N, M) the motion whose path each one takes.

    A line that leads back takes the path of the one before, backwards. One that was driven before from the same posture
    takes that path again.
    """
    source = np.tile(np.array(plan.source), (len(paths[0].q), 1))
    driven: dict[tuple[int, int], list[int]] = {}
    for index, motion in enumerate(plan.motions):
        if motion.by == "line" and plan.source[index] == index:
            before = driven.setdefault((motion.start, motion.end), [])
            for other in reversed(before):
                same = (paths[index].q[:, 0] == paths[other].q[:, 0]).all(axis=1)
                source[same, index] = source[same, other]
            before.append(index)
    return np.take_along_axis(source, np.array(plan.source)[None], axis=1)


def _measure(
    arms: ArmArrays, plan: CyclePlan, entry: Array, groups: Sequence[CycleGroup], jumps: NDArray[np.bool_],
    is_off: NDArray[np.bool_], obstacles: Sequence[Obstacle], device: Device, between: int = 2,
) -> CyclePaths:  # fmt: skip
    """Return the paths with what they are off by and how near they come; between: as in `_line_errors`.

    is_off: (N,) as in `CyclePaths`, all alike in a group.
    """
    n, m = jumps.shape
    is_line, is_back = (np.array(each) for each in (
        [motion.by == "line" for motion in plan.motions], [i != source for i, source in enumerate(plan.source)]
    ))  # fmt: skip
    carries = np.array([motion.carries for motion in plan.motions])
    values, worst = np.zeros((5, n, m)), np.zeros((3, n, m))
    ends, step = np.empty((n, m, 2, arms.dof)), np.empty((n, m))
    for group in groups:
        index, counts, known = group.index, np.array(group.counts), not is_off[group.index[0]]
        if plan.is_loop and known:
            gap = np.abs(group.paths[-1].q[:, -1] - group.paths[0].q[:, 0]).max(axis=1)
            jumps[index, -1] |= gap > CLOSED
        first = np.concatenate([[0], np.cumsum(counts)])
        q = np.concatenate([path.q for path in group.paths], axis=1)
        if known:
            omitted, rules = group.source != np.arange(m, dtype=np.intp), plan.path_rules(group.counts)
            least, at = path_clearances(group.arms, q, first, obstacles, device, rules, omitted=omitted)
            least = np.take_along_axis(least, group.source[None, None], 3)
            at = np.take_along_axis(at, group.source[None], 2)
            values[2:4, index] = np.where(carries, least[:, 1], least[:, 0])
            worst[2, index] = (np.where(carries, at[1], at[0]) - first[group.source]) / (counts[group.source] - 1)
        else:
            values[2:4, index] = np.nan
        for i, errors in _line_errors(group, plan, device, between).items():
            values[:2, index, i] = errors.max(axis=1).T
            worst[:2, index, i] = errors.argmax(axis=1).T / (errors.shape[1] - 1)
        margin = group.arms.limit_distance(q)
        values[4, index] = np.minimum.reduceat(margin, first[:-1], axis=1)
        margin[:, np.concatenate([first[:-1], first[1:] - 1])] = np.inf
        if known:  # where a joint meets its limit within a line, the speeds of the others jump
            jumps[index] |= is_line & (np.minimum.reduceat(margin, first[:-1], axis=1) <= ON_LIMIT)
        ends[index], step[index] = np.stack([q[:, first[:-1]], q[:, first[1:] - 1]], axis=2), 1.0 / (counts - 1)
    values[:2], worst[:2] = values[:2, :, plan.source], worst[:2, :, plan.source]
    worst = np.where(is_back, 1.0 - worst, worst)
    if between > 1:
        _look_between(arms, plan, ends, step, values[2:4], worst[2], obstacles, device)
    path_error, path_angle, own, clear, margin = values
    worst = np.moveaxis(worst, 0, 2)
    return CyclePaths(plan, entry, tuple(groups), path_error, path_angle, own, clear, margin, jumps, worst, is_off)


def _look_between(
    arms: ArmArrays, plan: CyclePlan, ends: Array, step: Array, clearance: Array, worst: Array,
    obstacles: Sequence[Obstacle], device: Device,
) -> None:  # fmt: skip
    """Lower clearances (2, N, M), and move the shares (N, M) where they are worst, to those between samples.

    Corners pass each other between the samples of a joint motion, so one that comes near is searched around its worst
    sample, of arms that do not touch anything at samples.

    ends: (N, M, 2, D) first and last posture of joint motions.  step: (N, M) from one sample to the next, as a share.
    """
    least = clearance.min(axis=0)
    is_joint = [motion.by == "joint" for motion in plan.motions]
    place = np.nonzero(is_joint & (least < NEAR) & (least.min(axis=1, keepdims=True) > 0.0))  # P of N, of M
    if not len(place[0]):
        return
    part, (start, end), size = arms[place[0]], ends[place].swapaxes(0, 1)[:, :, None], step[place][:, None]
    carries = np.array([motion.carries for motion in plan.motions])[place[1]]
    rules = plan.rules(plan.motions[int(place[1][0])], np.full(len(BETWEEN), 0.5))
    rules = replace(rules, carries=np.ones_like(rules.carries))
    for _ in range(ZOOMS):
        size = size / 4.0
        share = np.clip(worst[place][:, None] + size * BETWEEN, NEAR_END, 1.0 - NEAR_END)  # (P, S)
        q = start + share[..., None] * (end - start)
        least, at = path_clearances(part, q, (0, len(BETWEEN)), obstacles, device, rules)
        found = np.where(carries, least[:, 1, :, 0], least[:, 0, :, 0])
        nearest: IndexArray = np.where(carries, at[1, :, 0], at[0, :, 0])
        best = np.take_along_axis(share, nearest[:, None], axis=1)[:, 0]
        worst[place] = np.where(found.min(axis=0) < clearance[:, *place].min(axis=0), best, worst[place])
        clearance[:, *place] = np.minimum(clearance[:, *place], found)


def _line_errors(group: CycleGroup, plan: CyclePlan, device: Device, between: int) -> dict[int, Array]:
    """Return (n, between R + 1, 2) distance [m] and angle [rad] off each own line of R + 1 samples, by its index."""
    lines = [group.paths[index] for index in plan.own_lines]
    if not lines:
        return {}
    counts = tuple(between * (path.q.shape[1] - 1) + 1 for path in lines)
    q = np.concatenate([path.at(np.linspace(0.0, 1.0, n)) for path, n in zip(lines, counts, strict=True)], axis=1)
    errors = tool_errors(group.arms, plan.line_poses(counts), q, device)
    return dict(zip(plan.own_lines, np.split(errors, np.cumsum(counts)[:-1], axis=1), strict=True))
