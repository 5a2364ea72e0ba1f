"""Straight moves between targets, as a task file has them, and where the tip should be along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOVE_STEP = 0.02  # [m] from one sample of a line to the next, at most
MOST_STEPS = 200  # of a move
MOST_SAMPLES = 10_000  # of all moves


@dataclass(frozen=True)
class Moves:
    """Lines that the tip goes along, each from one target to another.

    pairs: the targets' places in the task's list, from 0.  step: [m].
    """

    pairs: tuple[tuple[int, int], ...] = ()
    step: float = MOVE_STEP

    def __len__(self) -> int:
        return len(self.pairs)

    def steps(self, targets: Array) -> list[int]:
        """Into how many equal steps each line is cut; targets: (T, 3) [m]."""
        return [steps_of(float(np.linalg.norm(targets[end] - targets[start])), self.step) for start, end in self.pairs]


NO_MOVES = Moves()


@dataclass(frozen=True)
class Lines:
    """The S samples of M lines, one line after the other, each with its start and its end."""

    first: NDArray[np.intp]  # (M + 1,) where each line's samples begin, and last S
    move: NDArray[np.intp]  # (S,) whose sample it is
    share: Array  # (S,) of the line, from 0 to 1
    points: Array  # (S, 3) where the tip should be [m]

    def __len__(self) -> int:
        return len(self.points)


def steps_of(length: float, step: float) -> int:
    """Into how many equal steps a line is cut [m]: a hair above a whole number is that number."""
    return max(1, math.ceil(length / step - 1e-9))


def lines_of(moves: Moves, targets: Array) -> Lines:
    """Where the tip should be; targets: (T, 3) [m]."""
    steps = moves.steps(targets)
    share: list[Array] = [np.arange(n + 1) / n for n in steps]
    ends = [(targets[start], targets[end]) for start, end in moves.pairs]
    points = [(1.0 - along)[:, None] * a + along[:, None] * b for (a, b), along in zip(ends, share, strict=True)]
    counts = np.array([n + 1 for n in steps])
    return Lines(
        first=np.concatenate([[0], np.cumsum(counts)]),
        move=np.repeat(np.arange(len(steps)), counts),
        share=np.concatenate(share),
        points=np.concatenate(points),
    )


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
        if steps_of(length, step) > MOST_STEPS:
            raise ValueError(
                f"move {number} = [{start}, {end}] is {length:.4g} m long, more than {MOST_STEPS} steps of {step:g} m; "
                f"give move_step: {_rounded_up(length / MOST_STEPS):g}"
            )
        in_all += steps_of(length, step) + 1
        if in_all > MOST_SAMPLES:
            raise ValueError(
                f"moves have more than {MOST_SAMPLES} samples together; give fewer of them, or a move_step above "
                f"{step:g} m"
            )


def _rounded_up(length: float) -> float:
    """To a millimetre."""
    return math.ceil(1e3 * length) / 1e3
