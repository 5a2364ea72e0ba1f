"""Straight moves between targets, as a task file has them, and where the tip should be along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

MOVE_STEP = 0.02  # [m] from one sample of a line to the next, at most
MOST_STEPS = 200  # of a move
MOST_SAMPLES = 10_000  # of all moves
LONGEST_TIME = 1e4  # [s] of a move
FEWEST_PARTS = 32  # of a timed line: the torques of a shorter one are looked at between its samples, too


@dataclass(frozen=True)
class Moves:
    """Lines that the tip goes along, each from one target to another.

    pairs: the targets' places in the task's list, from 0.  step: [m].  times: of each move [s]; none where not timed.
    """

    pairs: tuple[tuple[int, int], ...] = ()
    step: float = MOVE_STEP
    times: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.pairs)

    def steps(self, targets: Array) -> list[int]:
        """Into how many equal steps each line is cut; targets: (T, 3) [m]."""
        return [
            count_steps(float(np.linalg.norm(targets[end] - targets[start])), self.step) for start, end in self.pairs
        ]


NO_MOVES = Moves()


@dataclass(frozen=True)
class MoveSamples:
    """The S samples of M lines, one line after the other, each with its start and its end."""

    first: NDArray[np.intp]  # (M + 1,) where each line's samples begin, and last S
    move: NDArray[np.intp]  # (S,) whose sample it is
    share: Array  # (S,) of the line, from 0 to 1
    points: Array  # (S, 3) where the tip should be [m]

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class MoveTiming:
    """F moments of M timed lines, one line after the other: their samples, and as many between as make 32 parts."""

    first: NDArray[np.intp]  # (M + 1,) where each line's moments begin, and last F
    sample: NDArray[np.intp]  # (F,) the last before
    beyond: Array  # (F,) it, as a share of the step to the next
    speed: Array  # (F,) of the share of the line [1/s]
    acceleration: Array  # (F,) [1/s²]

    def between(self, values: Array) -> Array:
        """(N, F, D) on straight lines between those of samples (N, S, D)."""
        share, after = self.beyond[:, None], np.minimum(self.sample + 1, values.shape[1] - 1)
        return (1.0 - share) * values[:, self.sample] + share * values[:, after]


def count_steps(length: float, step: float) -> int:
    """Into how many equal steps a line is cut [m]: a hair above a whole number is that number."""
    return max(1, math.ceil(length / step - 1e-9))


def sample_moves(moves: Moves, targets: Array) -> MoveSamples:
    """Where the tip should be; targets: (T, 3) [m]."""
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
    """When the tip is where, if each line is run from rest to rest by the fifth-order profile of `quintic_rates`."""
    sample: list[NDArray[np.intp]] = []
    beyond: list[Array] = []
    shares: list[Array] = []
    for first, end in zip(lines.first, lines.first[1:], strict=False):
        steps = int(end - first) - 1
        parts = math.ceil(FEWEST_PARTS / steps)
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
    """ds/dt and d²s/dt² where s = 10 t³ - 15 t⁴ + 6 t⁵ comes to these shares, of a move of one second.

    Of all ways from rest to rest it is the one of the least mean square jerk; s grows with t, so t is found by halving.
    """
    low, high = np.zeros(share.shape), np.ones(share.shape)
    for _ in range(60):
        t = 0.5 * (low + high)
        short = t**3 * (10.0 - 15.0 * t + 6.0 * t**2) < share
        low, high = np.where(short, t, low), np.where(short, high, t)
    t = np.where(share == 0.0, 0.0, np.where(share == 1.0, 1.0, 0.5 * (low + high)))
    return 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)


def check_times(times: float | tuple[float, ...], moves: int) -> None:
    """ValueError where moves cannot take these times [s]; one is for every move."""
    if not moves:
        raise ValueError("move_time is of moves, and there are none; give some: moves: in_order")
    if isinstance(times, tuple) and len(times) != moves:
        raise ValueError(f"move_time has {len(times)} values for {moves} moves; give one or all")
    for time in times if isinstance(times, tuple) else (times,):
        if not 0.0 < time <= LONGEST_TIME:
            raise ValueError(f"move_time = {time:g} s is outside 0 < move_time <= {LONGEST_TIME:g} s")


def check_moves(pairs: Sequence[tuple[int, int]], targets: Sequence[tuple[float, float, float]], step: float) -> None:
    """ValueError where a move is none, or too long for its steps; pairs: numbers of targets, counted from 1."""
    in_all = 0
    for number, (start, end) in enumerate(pairs, start=1):
        for target in (start, end):
            if not 1 <= target <= len(targets):
                raise ValueError(
                    f"move {number} = [{start}, {end}]: there is no target {target}; "
                    f"targets are counted from 1 to {len(targets)}"
                )
        if (start, end) in pairs[: number - 1]:
            raise ValueError(f"move {number} = [{start}, {end}] is there twice")
        length = math.dist(targets[start - 1], targets[end - 1])
        if length == 0.0:
            raise ValueError(f"move {number} = [{start}, {end}]: both are one point, which no line joins")
        if count_steps(length, step) > MOST_STEPS:
            raise ValueError(
                f"move {number} = [{start}, {end}] is {length:.4g} m long, more than {MOST_STEPS} steps of {step:g} m; "
                f"give move_step: {_rounded_up(length / MOST_STEPS):g}"
            )
        in_all += count_steps(length, step) + 1
        if in_all > MOST_SAMPLES:
            raise ValueError(
                f"moves have more than {MOST_SAMPLES} samples together; give fewer of them, or a move_step above "
                f"{step:g} m"
            )


def _rounded_up(length: float) -> float:
    """To a millimetre."""
    return math.ceil(1e3 * length) / 1e3
