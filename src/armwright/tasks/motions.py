"""The motions of a cycle: poses of the tool, lines and joint motions between them, and samples along lines.

A step of the task has one motion, or up to three with an approach: the line out of the target before, a joint motion,
and the line into its own target. Motions are from rest to rest. A block is a pose that a joint motion ends at, and the
lines that follow: its first posture decides all others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.tasks.cycle import By, Cycle
from armwright.tasks.poses import LINE_STEP, Poses, along_line, line_steps, shortest_turn, stack_poses
from armwright.tasks.targets import TargetArrays
from armwright.tasks.tip_rules import APART, TipRules, joined_rules

MAX_SAMPLES = 20_000  # of all lines of a cycle
NEAR_END = 1.0 / 16.0  # share of a joint motion at each end, where tool and payload leave what they rest on
JOINT_STEPS = 16  # of a joint motion at least
OPPOSITE = 1e-3  # [rad] from half a turn; the shortest rotation is not unique there


@dataclass(frozen=True)
class Motion:
    """A motion from rest to rest."""

    step: int  # index of its step in the task
    by: By  # line or joint motion
    start: int  # index of its first pose
    end: int  # index of its last pose
    carries: bool  # whether the payload is carried
    arrives: bool  # whether it ends at the target of its step


@dataclass(frozen=True)
class Block:
    """A pose that a joint motion ends at, or an open cycle starts at, and the lines after it."""

    entry: int  # index of the pose
    lines: tuple[int, ...]  # indices of the motions


@dataclass(frozen=True)
class LineSamples:
    """S samples of the tool's pose, block after block; consecutive lines share a sample, as do the ways in and out."""

    poses: Poses  # S poses
    first: NDArray[np.intp]  # (B + 1,) index of each block's first sample, and S
    end: NDArray[np.intp]  # (B,) index of the sample at which each block ends
    before: NDArray[np.intp]  # (S,) index of the sample from which each one is followed; of a block's first, itself
    passes: NDArray[np.intp]  # (S,) how often the step to each sample is driven; 0 of a block's first
    of_motion: tuple[NDArray[np.intp], ...]  # indices of the samples of each motion in its order; none of joint motions


def single_samples(poses: Poses) -> LineSamples:
    """Return poses as samples, each a block of its own."""
    at = np.arange(len(poses) + 1)
    return LineSamples(poses, at, at[:-1], at[:-1], np.zeros(len(poses), dtype=np.intp), ())


@dataclass(frozen=True)
class CyclePlan:
    """Where the tool goes, independent of any arm."""

    cycle: Cycle  # cycle as the task states it
    poses: Poses  # T targets of the task, then points of approach
    motions: tuple[Motion, ...]  # motions in their order, from rest at the target of the first step
    targets: tuple[int, ...]  # index of each step's target
    times: tuple[float | None, ...]  # duration of each step [s]; None for the fastest
    tip_rules: TipRules  # what holds at the poses

    def holds_payload(self, n_targets: int) -> NDArray[np.bool_]:
        """Return (T,) whether the payload is carried to or from each of T targets; True where the cycle never is."""
        held: dict[int, bool] = {}
        for target, step, carried in zip(self.targets, self.cycle.steps, self.cycle.carried(), strict=True):
            held[target] = held.get(target, False) or carried or step.do == "pick"
        return np.array([held.get(target, True) for target in range(n_targets)])

    @property
    def first_motion(self) -> int:
        """Index of the motion that the blocks begin with: any after a joint motion serves in a closed cycle."""
        if not self.cycle.closed:
            return 0
        joint = [index for index, motion in enumerate(self.motions) if motion.by == "joint"]
        return (joint[0] + 1) % len(self.motions) if joint else 0

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in their order, beginning at `first_motion`; joint motions join them."""
        blocks, lines, entry = list[Block](), list[int](), self.motions[self.first_motion].start
        for index in self._order:
            motion = self.motions[index]
            if motion.by == "line":
                lines.append(index)
                continue
            blocks.append(Block(entry, tuple(lines)))
            entry, lines = motion.end, []
        if lines or not self.cycle.closed:
            blocks.append(Block(entry, tuple(lines)))
        return tuple(blocks)

    @cached_property
    def joint_motions(self) -> tuple[int, ...]:
        """Indices of the joint motions, each after the block of the same index."""
        return tuple(index for index in self._order if self.motions[index].by == "joint")

    @cached_property
    def source(self) -> tuple[int, ...]:
        """The motion whose path each one takes: a line that leads back along a line before it takes that one's."""
        source, open_lines = list(range(len(self.motions))), list[int]()
        for block in self.blocks:
            open_lines.clear()
            for index in block.lines:
                line, before = self.motions[index], self.motions[open_lines[-1]] if open_lines else None
                if before is not None and (line.start, line.end) == (before.end, before.start):
                    source[index] = open_lines.pop()
                else:
                    open_lines.append(index)
        return tuple(source)

    @cached_property
    def visits(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """The V targets that steps lead to; the motions of these steps, target by target; and where each one begins."""
        target = np.array([self.targets[motion.step] for motion in self.motions])
        visited, first = np.unique(np.sort(target), return_index=True)
        return visited, np.argsort(target, kind="stable"), first

    @cached_property
    def alike(self) -> tuple[list[int], list[int]]:
        """The blocks with entries, lines and rules of their own, and which of these each block is like."""
        rules = self.coarse_rules[self.sample().first[:-1]]
        keys = [
            (block.entry, *((self.motions[i].start, self.motions[i].end) for i in block.lines), carries, *allowed)
            for block, carries, allowed in zip(self.blocks, rules.carries, rules.allowed, strict=True)
        ]
        own = [keys.index(key) for key in dict.fromkeys(keys)]
        return own, [own.index(keys.index(key)) for key in keys]

    @property
    def _order(self) -> list[int]:
        """Indices of the motions, from the first of the blocks on."""
        n, first = len(self.motions), self.first_motion
        return [(first + i) % n for i in range(n)]

    @property
    def dwells(self) -> tuple[float, ...]:
        """Time at rest after each motion [s]."""
        picks_or_places = [motion.arrives and self.cycle.steps[motion.step].do is not None for motion in self.motions]
        return tuple(self.cycle.dwell if rests else 0.0 for rests in picks_or_places)

    @property
    def is_loop(self) -> bool:
        """True for a closed cycle of lines alone, which has to end in the posture where it began."""
        return self.cycle.closed and not self.joint_motions

    def line(self, motion: Motion, share: Array) -> Poses:
        """Return the poses at shares (S,) of a line, with the tolerance of the path and, at its end, of the pose."""
        poses, allowed = along_line(self.poses, motion.start, motion.end, share), self.cycle.tolerance

        def tolerance(on_path: float, of_pose: Array) -> Array:
            return np.where(share >= 1.0, np.minimum(on_path, of_pose), on_path)

        return replace(
            poses,
            tolerance=tolerance(allowed.largest_distance, poses.tolerance),
            angle_tolerance=tolerance(allowed.largest_angle, poses.angle_tolerance),
        )

    def rules(self, motion: Motion, share: Array) -> TipRules:
        """Return what holds at shares (S,) of a motion: the rules of its targets, on a joint motion near its ends."""
        is_line, ends = motion.by == "line", self.tip_rules.allowed[[motion.start, motion.end]]
        near = is_line | np.stack([share < NEAR_END, share > 1.0 - NEAR_END])  # (2, S) its ends
        allowed = np.where(near[..., None], ends[:, None], APART).max(axis=0)
        carries = np.full(len(share), motion.carries and self.tip_rules.carries.any())
        return TipRules(carries, allowed, self.tip_rules.solids)

    @cached_property
    def coarse_rules(self) -> TipRules:
        """What holds at the samples of lines, of shared ones for any of the motions, then within each joint motion."""
        samples, share = self.sample(), np.arange(1, JOINT_STEPS) / JOINT_STEPS
        n, first = len(samples.poses), samples.first
        apart = np.full((n, self.tip_rules.allowed.shape[1]), APART)
        found = TipRules(np.zeros(n, dtype=np.bool_), apart, self.tip_rules.solids)
        for index, motion in enumerate(self.motions):
            at = samples.of_motion[index]
            if motion.by == "joint":
                block = self.joint_motions.index(index)
                at = np.array([samples.end[block], first[(block + 1) % len(self.blocks)]])
            rules = self.rules(motion, np.linspace(0.0, 1.0, len(at)))
            found.carries[at] |= rules.carries
            found.allowed[at] = np.maximum(found.allowed[at], rules.allowed)
        return joined_rules([found, *(self.rules(self.motions[index], share) for index in self.joint_motions)])

    @cached_property
    def coarse_first(self) -> NDArray[np.intp]:
        """Index of the first sample of each block and of each joint motion in `coarse_rules`, and their number."""
        first = self.sample().first
        return np.append(first, first[-1] + (JOINT_STEPS - 1) * np.arange(1, len(self.joint_motions) + 1))

    def path_rules(self, counts: tuple[int, ...]) -> TipRules:
        """Return what holds along all motions, one after another, at so many equally spaced samples of each.

        The payload counts as carried everywhere.
        """
        if counts not in self._path_rules:
            pairs = zip(self.motions, counts, strict=True)
            rules = joined_rules([self.rules(one, np.linspace(0.0, 1.0, n)) for one, n in pairs])
            self._path_rules[counts] = replace(rules, carries=np.ones_like(rules.carries))
        return self._path_rules[counts]

    @cached_property
    def _path_rules(self) -> dict[tuple[int, ...], TipRules]:
        return {}

    def line_poses(self, counts: tuple[int, ...]) -> Poses:
        """Return the poses of lines that are their own source, one after another, at so many samples of each."""
        if counts not in self._line_poses:
            pairs = zip(self.own_lines, counts, strict=True)
            poses = [self.line(self.motions[index], np.linspace(0.0, 1.0, n)) for index, n in pairs]
            self._line_poses[counts] = stack_poses(poses)
        return self._line_poses[counts]

    @cached_property
    def _line_poses(self) -> dict[tuple[int, ...], Poses]:
        return {}

    @cached_property
    def own_lines(self) -> tuple[int, ...]:
        """Indices of the lines that are their own source."""
        return tuple(i for i, one in enumerate(self.motions) if one.by == "line" and self.source[i] == i)

    def sample(self, refinement: float = 1) -> LineSamples:
        """Return samples of all lines, `refinement` times as many as a path needs at least."""
        if refinement not in self._samples:
            self._samples[refinement] = self._sample(refinement)
        return self._samples[refinement]

    @cached_property
    def _samples(self) -> dict[float, LineSamples]:
        return {}

    def _sample(self, refinement: float) -> LineSamples:
        parts: list[Poses] = []
        first, end, before, passes = [0], list[int](), list[int](), list[int]()
        of_motion = [np.zeros(0, dtype=np.intp)] * len(self.motions)
        for block in self.blocks:
            at = len(before)
            parts.append(self.poses[[block.entry]])
            before, passes = [*before, at], [*passes, 0]
            for index in block.lines:
                motion, source = self.motions[index], self.source[index]
                if source != index:
                    of_motion[index] = of_motion[source][::-1]
                    for sample in of_motion[source][1:]:
                        passes[sample] += 1
                else:
                    steps = math.ceil(refinement * line_steps(self.poses, motion.start, motion.end))
                    parts.append(self.line(motion, np.arange(1, steps + 1) / steps))
                    of_motion[index] = np.array([at, *range(len(before), len(before) + steps)])
                    before, passes = [*before, *of_motion[index][:-1].tolist()], passes + [1] * steps
                at = int(of_motion[index][-1])
            end.append(at)
            first.append(len(before))
        starts, ends, order, driven = (np.array(each, dtype=np.intp) for each in (first, end, before, passes))
        return LineSamples(stack_poses(parts), starts, ends, order, driven, tuple(of_motion))


def plan_cycle(
    cycle: Cycle, targets: Sequence[int], positions: Array, arrays: TargetArrays, tip_rules: TipRules
) -> CyclePlan:
    """Return the motions of a cycle.

    targets: index of each step's target.  positions: (T, 3) of targets [m].  tip_rules: at the T targets.
    """
    poses = Poses(positions, arrays.rotation, arrays.n_angular, arrays.tolerance, arrays.angle_tolerance)
    for number, (target, step) in enumerate(zip(targets, cycle.steps, strict=True), start=1):
        if step.do and cycle.approach and arrays.n_angular[target] == 0:
            raise ValueError(f"step {number}: approach needs a target with an axis or an orientation")
    approached = sorted({t for t, step in zip(targets, cycle.steps, strict=True) if step.do and cycle.approach})
    before = poses[approached]
    if approached:
        shift = (cycle.approach or 0.0) * before.rotation[:, :, 2]
        allowed = cycle.tolerance
        before = replace(
            before,
            position=before.position - shift,
            tolerance=np.full(len(before), allowed.largest_distance),
            angle_tolerance=np.full(len(before), allowed.largest_angle),
        )
        poses = stack_poses([poses, before])
    points = {target: len(positions) + i for i, target in enumerate(approached)}
    tip_rules = tip_rules[np.array([*range(len(positions)), *approached], dtype=np.intp)]
    tip_rules.allowed[len(positions) :] = APART
    plan = CyclePlan(cycle, poses, _motions(cycle, targets, points), tuple(targets), cycle.durations(), tip_rules)
    _check_lines(plan)
    return plan


def _motions(cycle: Cycle, targets: Sequence[int], points: dict[int, int]) -> tuple[Motion, ...]:
    """Return the motions; points: index of the pose of approach by target."""
    n, carried = len(targets), cycle.carried()
    order = [*range(1, n), *([0] if cycle.closed else [])]
    motions: list[Motion] = []
    for step in order:
        carries, do = carried[step], cycle.steps[step].do
        here, there = targets[step - 1], targets[step]
        out, into = (bool(points) and action is not None for action in (cycle.steps[step - 1].do, do))
        if out:
            motions.append(Motion(step, "line", here, points[here], carries, arrives=False))
            here = points[here]
        if into:
            motions.append(Motion(step, "joint", here, points[there], carries, arrives=False))
            motions.append(Motion(step, "line", points[there], there, carries, arrives=True))
        else:
            motions.append(Motion(step, cycle.steps[step].by, here, there, carries, arrives=True))
    return tuple(motions)


def _check_lines(plan: CyclePlan) -> None:
    """Raise ValueError for a line that has no length, or no unique or no constant kind of direction."""
    poses, n_samples = plan.poses, 0
    for motion in plan.motions:
        number, start, end = motion.step + 1, motion.start, motion.end
        shift = float(np.linalg.norm(poses.position[end] - poses.position[start]))
        turn = shortest_turn(poses, start, end)[1]
        if shift == 0.0 and turn == 0.0 and poses.n_angular[end] <= poses.n_angular[start]:
            raise ValueError(f"step {number}: the tool is already there; leave the step out")
        if motion.by == "joint":
            continue
        if poses.n_angular[start] != poses.n_angular[end]:
            raise ValueError(
                f"step {number}: a line needs the same kind of direction at both ends (none, axis or orientation); "
                "try by: joint"
            )
        if turn > math.pi - OPPOSITE:
            raise ValueError(
                f"step {number}: the tool points the opposite way at the end of the line, so that the rotation is "
                "not unique; add a target in between, or try by: joint"
            )
        n_samples += line_steps(poses, start, end)
    if n_samples > MAX_SAMPLES:
        raise ValueError(f"cycle: the lines have {n_samples} samples of {LINE_STEP:g} m; at most {MAX_SAMPLES} count")
