"""Motion of arms along straight lines: each sample is solved from the posture of the sample before."""

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
    q: Array  # (N, S, J) joint angles [rad] or displacements [m]
    reached: Array  # (N, S, 3) position of the tip [m]
    error: Array  # (N, S) distance of the tip from the sample [m]
    joint_torques: Array  # (N, S, J) torques against gravity [N m], or forces [N]

    @property
    def jumps(self) -> Array:
        """(N, S) largest change of any joint since the sample before [rad] or [m]; 0 at the start of a move."""
        changes = np.zeros(self.error.shape)
        changes[:, 1:] = np.abs(np.diff(self.q, axis=1)).max(axis=-1)
        changes[:, self.samples.first[:-1]] = 0.0
        return changes

    def with_largest(self, at_targets: Array, along: Array) -> Array:
        """Return (N, T) the larger of a target's value (N, T) and those of the samples (N, S) of moves to it."""
        return largest_of(self.moves, self.samples.first, at_targets, along)


def largest_of(moves: Moves, first: NDArray[np.intp], at_targets: Array, along: Array) -> Array:
    """Return the larger of a target's value and the values along the moves that end there.

    Args:
        moves: M moves.
        first: (M + 1,) index of the first value of each move in `along`, and the number of values.
        at_targets: (N, T) values at the targets.
        along: (N, S) values along the moves.
    """
    worst = at_targets.copy()
    for (_, target), start, stop in zip(moves.pairs, first, first[1:], strict=False):
        worst[:, target] = np.maximum(worst[:, target], along[:, start:stop].max(axis=1))
    return worst


def follow(arms: ArmArrays, q: Array, targets: Array, payload: Array, moves: Moves, device: Device = "cpu") -> Paths:
    """Move arms along lines between targets. A deviation from a line is a result, never an exception.

    Args:
        arms: N arms of up to J joints.
        q: (N, T, J) postures at the targets, from which moves start [rad] or [m].
        targets: (T, 3) targets [m].
        payload: (T,) payload at each target [kg].
        moves: The moves.
        device: The device to solve on.
    """
    samples = sample_moves(moves, targets)
    carried = np.array([payload[list(pair)].max() for pair in moves.pairs])
    n, s = len(arms), len(samples)
    path_q, reached, torques = (np.empty((n, s, size)) for size in (arms.dof, 3, arms.dof))
    last_q = q[:, [start for start, _ in moves.pairs]]  # (N, M, J)
    steps = np.diff(samples.first) - 1
    for k in range(int(steps.max()) + 1):
        active = np.flatnonzero(steps >= k)
        at = samples.first[active] + k
        solved = solve_postures(
            arms,
            samples.points[at],
            UPDATES_OF_STEP if k else 0,
            initial_q=last_q[:, active],
            payload=carried[active],
            precision=arms.precision,
            device=device,
        )
        last_q[:, active] = solved.q
        path_q[:, at], reached[:, at], torques[:, at] = solved.q, solved.reached, solved.torque
    error = np.linalg.norm(reached - samples.points, axis=-1)
    return Paths(moves, samples, carried[samples.move], path_q, reached, error, torques)
