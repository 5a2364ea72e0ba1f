"""Arms along straight lines: each sample of a line is solved from the posture of the sample before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import ArmArrays
from armwright.kinematics.devices import Device
from armwright.kinematics.ik import solve_postures
from armwright.tasks.moves import Moves, MoveSamples, sample_moves

UPDATES_OF_STEP = 10  # of the inverse kinematics from one sample to the next, docs/method.md §14


@dataclass(frozen=True)
class Paths:
    """N arms of up to J joints at the S samples of M moves."""

    moves: Moves
    samples: MoveSamples
    payload: Array  # (S,) that the tip carries [kg]: the heavier of the payloads at the move's two targets
    q: Array  # (N, S, J) joint angles [rad], or ways [m]
    reached: Array  # (N, S, 3) position of the tip [m]
    error: Array  # (N, S) distance of the tip from where it should be on the line [m]
    joint_torques: Array  # (N, S, J) that hold the posture against gravity [N m], or forces [N]

    @property
    def jumps(self) -> Array:
        """(N, S) the largest change of any joint since the sample before [rad] or [m]; 0 at a move's start."""
        changes = np.zeros(self.error.shape)
        changes[:, 1:] = np.abs(np.diff(self.q, axis=1)).max(axis=-1)
        changes[:, self.samples.first[:-1]] = 0.0
        return changes

    def with_largest(self, at_targets: Array, along: Array) -> Array:
        """(N, T) the larger of what is at a target and of what is along the moves that end there.

        at_targets: (N, T).  along: (N, S) of the samples.
        """
        return largest_of(self.moves, self.samples.first, at_targets, along)


def largest_of(moves: Moves, first: NDArray[np.intp], at_targets: Array, along: Array) -> Array:
    """(N, T) the larger of what is at a target and of what is along the moves that end there.

    first: (M + 1,) where each move begins in `along` (N, ...), and last its end.  at_targets: (N, T).
    """
    worst = at_targets.copy()
    for (_, end), begin, beyond in zip(moves.pairs, first, first[1:], strict=False):
        worst[:, end] = np.maximum(worst[:, end], along[:, begin:beyond].max(axis=1))
    return worst


def follow(arms: ArmArrays, q: Array, targets: Array, payload: Array, moves: Moves, device: Device = "cpu") -> Paths:
    """N arms along moves; how far they stray from the lines is a result, never an exception.

    q: (N, T, J) the kept postures at the targets, from which moves begin [rad] or [m].
    targets: (T, 3) [m].  payload: (T,) [kg].
    """
    lines = sample_moves(moves, targets)
    carried = np.array([payload[list(pair)].max() for pair in moves.pairs])
    n, s = len(arms), len(lines)
    found, reached, torques = (np.empty((n, s, columns)) for columns in (arms.dof, 3, arms.dof))
    start = q[:, [begin for begin, _ in moves.pairs]]  # (N, M, J)
    steps = np.diff(lines.first) - 1
    for k in range(int(steps.max()) + 1):
        going = np.flatnonzero(steps >= k)
        at = lines.first[going] + k
        solved = solve_postures(
            arms,
            lines.points[at],
            UPDATES_OF_STEP if k else 0,
            start=start[:, going],
            payload=carried[going],
            precision=arms.precision,
            device=device,
        )
        start[:, going] = solved.q
        found[:, at], reached[:, at], torques[:, at] = solved.q, solved.reached, solved.torque
    error = np.linalg.norm(reached - lines.points, axis=-1)
    return Paths(moves, lines, carried[lines.move], found, reached, error, torques)
