"""Terms of the joint torques along the motions of a cycle, independent of their durations."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.cycle.cycle_path import CycleGroup, CyclePaths
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.devices import Device, load_kernels

NO_WRENCHES = np.empty((0, 0, 0, 0, 6))


@dataclass(frozen=True)
class TorqueTerms:
    """Terms of N arms at the R samples of a motion, with s the share of the motion.

    The torque is gravity + drag s'² + push s'' [N m], or a force [N].
    """

    gravity: Array  # (N, R, D)
    drag: Array  # (N, R, D)
    push: Array  # (N, R, D)
    q_s: Array  # (N, R, D) derivative of the joint values by s [rad] or [m]
    q_ss: Array  # (N, R, D) second derivative
    payload: Array  # (3, N, R, D) what the payload adds to gravity, drag and push, in proportion to its mass
    wrenches: Array
    """(3, N, R, D, 6) terms of the forces on the links and moments about their joints, in the frames of the links [N],
    [N m]; empty if they were not wanted."""


def torque_terms(
    paths: CyclePaths, payload: float, device: Device = "cpu", wrenches: bool = False
) -> list[tuple[TorqueTerms, ...]]:
    """Return, for each group of arms, the terms along each motion.

    payload: its mass when carried [kg].  wrenches: compute those of the joints, too.
    """
    found: list[tuple[TorqueTerms, ...]] = []
    for group in paths.groups:
        (q, q_s, q_ss), carried, spans = _along(group)
        whole = np.empty((3, *q.shape, 6)) if wrenches else NO_WRENCHES
        terms = _terms(group.arms, q, q_s, q_ss, carried, payload, device, whole)  # (6, n, S, D)
        gravity, drag, push = terms[:3]
        found.append(
            tuple(
                TorqueTerms(
                    gravity[:, a:b],
                    drag[:, a:b],
                    push[:, a:b],
                    q_s[:, a:b],
                    q_ss[:, a:b],
                    terms[3:, :, a:b],
                    whole[:, :, a:b],
                )
                for a, b in spans
            )
        )
    return found


def _along(group: CycleGroup) -> tuple[tuple[Array, Array, Array], Array, list[tuple[int, int]]]:
    """Return (n, S, D) q, q_s and q_ss along all motions, (S,) carried shares of the payload, ends of motions."""
    q, q_s, q_ss = (np.concatenate([_values(path, order) for path in group.paths], axis=1) for order in range(3))
    counts = [path.q.shape[1] for path in group.paths]
    carried = np.repeat([float(path.motion.carries) for path in group.paths], counts)
    return (q, q_s, q_ss), carried, list(pairwise(np.cumsum([0, *counts]).tolist()))


def inverse_dynamics_torques(
    arms: ArmArrays, q: Array, qd: Array, qdd: Array, carried: Array, payload: float, device: Device = "cpu"
) -> Array:
    """Return (N, S, D) torques of N arms in S states, without rotors and friction [N m], or forces [N].

    q, qd, qdd: (N, S, D) joint values [rad] or [m], speeds [rad/s] or [m/s] and accelerations [rad/s²] or [m/s²].
    carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    terms = _terms(arms, q, qd, qdd, carried, payload, device)
    return terms[0] + terms[1]  # gravity, and M q_ss + C q_s with the time as share


def inertia_matrices(arms: ArmArrays, q: Array, carried: Array, payload: float, device: Device = "cpu") -> Array:
    """Return (N, S, D, D) joint-space inertia matrices of N arms in S postures, without rotors, in SI units.

    q: (N, S, D) [rad] or [m].  carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    rest = np.zeros_like(q)
    units = (np.broadcast_to(unit, q.shape) for unit in np.eye(arms.dof))
    return np.stack([_terms(arms, q, unit, rest, carried, payload, device)[2] for unit in units], axis=-1)


def _values(path: MotionPath, order: int) -> Array:
    """Return (n, R, D) joint values at the samples, or their derivatives."""
    if order == 0:
        return path.q
    return np.broadcast_to(path.at(path.share, order), path.q.shape)


def _terms(
    arms: ArmArrays, q: Array, q_s: Array, q_ss: Array, carried: Array, payload: float, device: Device,
    wrenches: Array = NO_WRENCHES,
) -> Array:  # fmt: skip
    """Return (6, N, S, D) gravity, drag and push of N arms at S samples, and what the payload adds to each.

    wrenches: (3, N, S, D, 6) to be filled, if any.
    """
    loaded = load_kernels("cycle.dynamics_kernels", device)
    terms = np.empty((6, *q.shape))

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        values: dict[str, Any] = {name: getattr(part, name) for name in ("dof", "base", "motion", "offset")}
        values |= vars(part.rigid_bodies) | {"payload_mass": loaded.warp.float64(payload)}
        values |= {"payload_com": part.payload_center, "payload_inertia": payload * part.payload_gyration}
        bodies, found = loaded.struct("Bodies", values), np.empty((6, *q[chunk].shape))
        states, full = (q[chunk], q_s[chunk], q_ss[chunk]), np.empty_like(wrenches[:, chunk])
        loaded.launch("torque_terms", found.shape[1:3], bodies, *states, carried, outputs=[found, full])
        terms[:, chunk], wrenches[:, chunk] = found, full

    in_chunks(solve, len(arms), max(1, SAMPLES[device] // q.shape[1]), device)
    return terms
