"""Straight moves between targets, and positions and timing of the tip along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

MOVE_STEP = 0.02  # [m] largest distance between two samples of a line
MAX_STEPS = 200  # per move
MAX_SAMPLES = 10_000  # of all moves
MAX_TIME = 1e4  # [s] of a move
MIN_PARTS = 32  # of a timed line; a line of fewer steps is also evaluated between its samples


@dataclass(frozen=True)
class Moves:
    """Straight lines of the tip, each from one target to another.

    Attributes:
        pairs: Indices of the first and the last target of each move.
        step: Largest distance between two samples [m].
        times: Duration of each move [s]; empty if not timed.
    """

    pairs: tuple[tuple[int, int], ...] = ()
    step: float = MOVE_STEP
    times: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.pairs)

    def steps(self, targets: Array) -> list[int]:
        """Return the number of equal steps of each line; targets: (T, 3) [m]."""
        return [
            count_steps(float(np.linalg.norm(targets[end] - targets[start])), self.step) for start, end in self.pairs
        ]


NO_MOVES = Moves()


@dataclass(frozen=True)
class MoveSamples:
    """The S samples of M lines, one line after the other, each including its ends."""

    first: NDArray[np.intp]  # (M + 1,) index of each line's first sample, and S
    move: NDArray[np.intp]  # (S,) index of the line
    share: Array  # (S,) fraction of the line, from 0 to 1
    points: Array  # (S, 3) position of the tip [m]

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class MoveTiming:
    """F instants of M timed lines, one line after the other: their samples, and more between them for short lines."""

    first: NDArray[np.intp]  # (M + 1,) index of each line's first instant, and F
    sample: NDArray[np.intp]  # (F,) index of the last sample before
    beyond: Array  # (F,) fraction of the step from that sample to the next
    speed: Array  # (F,) rate of the fraction of the line [1/s]
    acceleration: Array  # (F,) its derivative [1/s²]

    def between(self, values: Array) -> Array:
        """Return (N, F, D) values interpolated between those of samples (N, S, D)."""
        share, after = self.beyond[:, None], np.minimum(self.sample + 1, values.shape[1] - 1)
        return (1.0 - share) * values[:, self.sample] + share * values[:, after]


def count_steps(length: float, step: float) -> int:
    """Return the number of equal steps of a line [m]; a rounding error above a whole number is ignored."""
    return max(1, math.ceil(length / step - 1e-9))


def sample_moves(moves: Moves, targets: Array) -> MoveSamples:
    """Return the positions of the tip along moves; targets: (T, 3) [m]."""
    steps = moves.steps(targets)
    share: list[Array] = [np.arange(n + 1) / n for n in steps]
    ends = [(targets[start], targets[end]) for start, end in moves.pairs]
    points = [(1.0 - along)[:, None] * a + along[:, None] * b for (a, b), along in zip(ends, share, strict=True)]
    counts = np.array([n + 1 for n in steps])
    return MoveSamples(
        first=np.concatenate([[0], np.cumsum(counts)]),
        move=np.repeat(np.arange(len(steps)), counts),
        share=np.concatenate(share),
        points=np.concatenate(points),
    )


def time_samples(moves: Moves, lines: MoveSamples) -> MoveTiming:
    """Return the timing of moves from rest to rest with the quintic profile of `quintic_rates`."""
    sample: list[NDArray[np.intp]] = []
    beyond: list[Array] = []
    shares: list[Array] = []
    for first, end in zip(lines.first, lines.first[1:], strict=False):
        steps = int(end - first) - 1
        parts = math.ceil(MIN_PARTS / steps)
        number = np.arange(steps * parts + 1)
        shares.append(number / (steps * parts))
        sample.append(first + number // parts)
        beyond.append(number % parts / parts)
    counts = [len(share) for share in shares]
    rate, change = quintic_rates(np.concatenate(shares))
    time = np.repeat(np.array(moves.times), counts)
    return MoveTiming(
        first=np.concatenate([[0], np.cumsum(counts)]),
        sample=np.concatenate(sample),
        beyond=np.concatenate(beyond),
        speed=rate / time,
        acceleration=change / time**2,
    )


def quintic_rates(share: Array) -> tuple[Array, Array]:
    """Return ds/dt and d²s/dt² of s = 10 t³ - 15 t⁴ + 6 t⁵ at given values of s, for a move of one second.

    This is the profile of minimum jerk from rest to rest (Flash and Hogan 1985). s grows with t, so t is found by
    bisection.
    """
    low, high = np.zeros(share.shape), np.ones(share.shape)
    for _ in range(60):
        t = 0.5 * (low + high)
        short = t**3 * (10.0 - 15.0 * t + 6.0 * t**2) < share
        low, high = np.where(short, t, low), np.where(short, high, t)
    t = np.where(share == 0.0, 0.0, np.where(share == 1.0, 1.0, 0.5 * (low + high)))
    return 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)


def check_times(times: float | tuple[float, ...], moves: int) -> None:
    """Raise ValueError if the times [s] do not fit the moves; a single one is for all moves."""
    if not moves:
        raise ValueError("move_time needs moves; try moves: in_order")
    if isinstance(times, tuple) and len(times) != moves:
        raise ValueError(f"move_time: expected 1 or {moves} values [s], got {len(times)}")
    for time in times if isinstance(times, tuple) else (times,):
        if not 0.0 < time <= MAX_TIME:
            raise ValueError(f"move_time: expected above 0 and at most {MAX_TIME:g} s, got {time:g} s")


def check_moves(pairs: Sequence[tuple[int, int]], targets: Sequence[tuple[float, float, float]], step: float) -> None:
    """Raise ValueError for invalid or overlong moves; pairs: numbers of targets, counted from 1."""
    n_samples = 0
    for number, (start, end) in enumerate(pairs, start=1):
        for target in (start, end):
            if not 1 <= target <= len(targets):
                raise ValueError(
                    f"move {number} = [{start}, {end}]: there is no target {target}; "
                    f"targets are counted from 1 to {len(targets)}"
                )
        if (start, end) in pairs[: number - 1]:
            raise ValueError(f"move {number} = [{start}, {end}] is given twice")
        length = math.dist(targets[start - 1], targets[end - 1])
        if length == 0.0:
            raise ValueError(f"move {number} = [{start}, {end}]: the targets are at the same position")
        if count_steps(length, step) > MAX_STEPS:
            raise ValueError(
                f"move {number} = [{start}, {end}] is {length:.4g} m long, more than {MAX_STEPS} steps of {step:g} m; "
                f"try move_step: {_rounded_up(length / MAX_STEPS):g}"
            )
        n_samples += count_steps(length, step) + 1
        if n_samples > MAX_SAMPLES:
            raise ValueError(
                f"moves: expected at most {MAX_SAMPLES} samples in all; try fewer moves or move_step > {step:g} m"
            )


def _rounded_up(length: float) -> float:
    """Round a length up to a millimetre [m]."""
    return math.ceil(1e3 * length) / 1e3
