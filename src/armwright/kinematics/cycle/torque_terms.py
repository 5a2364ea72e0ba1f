"""Terms of the joint torques along the motions of a cycle, independent of their durations."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.rigid_bodies import PerArm
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.cycle.cycle_path import CyclePaths
from armwright.kinematics.cycle.line_following import IndexArray
from armwright.kinematics.devices import Device, load_kernels


@dataclass(frozen=True)
class TorqueTerms(PerArm):
    """Terms of N arms at P samples (`instants.Picks`) of motions that take no other one's path, with s their share.

    The torque is gravity + drag s'² + push s'' [N m], or a force [N]. Elsewhere, the terms are arbitrary.
    """

    torques: Array  # (N, P, 6, D) gravity, drag, push of the arm, and what the payload adds to each
    states: Array  # (N, P, 2, D) first and second derivative of the joint values by s [rad] or [m]
    wrenches: Array
    """(N, P, 6, D, 6) likewise terms of the forces on the links and moments about their joints, in the frames of the
    links [N], [N m]; P = 0 if they were not wanted."""


def torque_terms(
    paths: CyclePaths, payload: float, device: Device = "cpu", wrenches: bool = False
) -> list[TorqueTerms]:
    """Return the terms of each group of arms with loads.

    payload: its mass when carried [kg].  wrenches: compute those of the joints, too.
    """
    found: list[TorqueTerms] = []
    for group in paths.loaded:
        picked = group.picks(paths)
        n, dof = len(group.index), group.arms.dof
        q, (q_s, q_ss) = np.empty((n, len(picked.sample), dof)), np.empty((2, n, len(picked.sample), dof))
        begin = np.cumsum([0, *group.counts])
        for index in sorted(set(paths.plan.source)):
            at, path = picked.motion_of == index, group.paths[index]
            rows = picked.sample[at] - begin[index]
            share = path.share[rows]
            q[:, at], q_s[:, at], q_ss[:, at] = path.q[:, rows], path.at(share, 1), path.at(share, 2)
        whole = np.empty((n, len(picked.sample) if wrenches else 0, 6, dof, 6))
        torques = _terms(group.arms, q, q_s, q_ss, payload, device, (picked.motion_of, group.source), whole)
        found.append(TorqueTerms(torques, np.stack([q_s, q_ss], axis=2), whole))
    return found


def inverse_dynamics_torques(
    arms: ArmArrays, q: Array, qd: Array, qdd: Array, carried: Array, payload: float, device: Device = "cpu"
) -> Array:
    """Return (N, S, D) torques of N arms in S states, without rotors and friction [N m], or forces [N].

    q, qd, qdd: (N, S, D) joint values [rad] or [m], speeds [rad/s] or [m/s] and accelerations [rad/s²] or [m/s²].
    carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    terms = _terms(arms, q, qd, qdd, payload, device)
    own, added = terms[:, :, :2].sum(axis=2), terms[:, :, 3:5].sum(axis=2)
    return own + carried[:, None] * added  # gravity, and M q_ss + C q_s with the time as share


def inertia_matrices(arms: ArmArrays, q: Array, carried: Array, payload: float, device: Device = "cpu") -> Array:
    """Return (N, S, D, D) joint-space inertia matrices of N arms in S postures, without rotors, in SI units.

    q: (N, S, D) [rad] or [m].  carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    rest = np.zeros_like(q)
    units = (np.broadcast_to(unit, q.shape) for unit in np.eye(arms.dof))
    columns = (_terms(arms, q, unit, rest, payload, device) for unit in units)
    return np.stack([each[:, :, 2] + carried[:, None] * each[:, :, 5] for each in columns], axis=-1)


def _terms(
    arms: ArmArrays, q: Array, q_s: Array, q_ss: Array, payload: float, device: Device,
    motions: tuple[IndexArray, IndexArray] | None = None, wrenches: Array | None = None,
) -> Array:  # fmt: skip
    """Return (N, S, 6, D) gravity, drag and push of N arms at S samples, and what the payload adds to each.

    motions: (S,) motion of each sample, and (N, M) motion whose path each one takes; None to compute all samples.
    wrenches: (N, S, 6, D, 6) to be filled, if any.
    """
    loaded = load_kernels("cycle.dynamics_kernels", device)
    terms = np.empty((*q.shape[:2], 6, q.shape[2]))
    full = np.empty((len(q), 0, 6, q.shape[2], 6)) if wrenches is None else wrenches
    zeros: IndexArray = np.zeros((len(q), q.shape[1]), dtype=np.intp)
    motion_of, source = motions or (zeros[0], zeros[:, :1])

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        values: dict[str, Any] = {name: getattr(part, name) for name in ("dof", "base", "motion", "axis", "offset")}
        values |= vars(part.rigid_bodies) | {"payload_mass": loaded.warp.float64(payload)}
        values |= {"payload_com": part.payload_center, "payload_inertia": payload * part.payload_gyration}
        bodies, states, outputs = loaded.struct("Bodies", values), (q, q_s, q_ss), (terms[chunk], full[chunk])
        given = (bodies, *(each[chunk] for each in states), motion_of, source[chunk])
        loaded.launch("torque_terms", q[chunk].shape[:2], *given, outputs=outputs)

    in_chunks(solve, len(arms), max(1, SAMPLES[device] // q.shape[1]), device)
    return terms
