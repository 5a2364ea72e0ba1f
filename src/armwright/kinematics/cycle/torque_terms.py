"""Terms of the joint torques along the motions of a cycle, independent of their durations."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.rigid_bodies import PerArm
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.cycle.cycle_path import CyclePaths
from armwright.kinematics.devices import Device, load_kernels


@dataclass(frozen=True)
class TorqueTerms(PerArm):
    """Terms of N arms at the R samples of all motions, one motion after another, with s the share of a motion.

    The torque is gravity + drag s'² + push s'' [N m], or a force [N].
    """

    torques: Array  # (N, R, 6, D) gravity, drag, push, and what the payload adds to each, in proportion to its mass
    states: Array  # (N, R, 2, D) first and second derivative of the joint values by s [rad] or [m]
    wrenches: Array
    """(N, R, 3, D, 6) terms of the forces on the links and moments about their joints, in the frames of the links [N],
    [N m]; R = 0 if they were not wanted."""


def torque_terms(
    paths: CyclePaths, payload: float, device: Device = "cpu", wrenches: bool = False
) -> list[TorqueTerms]:
    """Return the terms of each group of arms with loads.

    payload: its mass when carried [kg].  wrenches: compute those of the joints, too.
    """
    found: list[TorqueTerms] = []
    for group in paths.loaded:
        q = np.concatenate([path.q for path in group.paths], axis=1)
        of_motions = [[np.broadcast_to(path.at(path.share, n), path.q.shape) for n in (1, 2)] for path in group.paths]
        states = np.concatenate([np.stack(each, axis=2) for each in of_motions], axis=1)
        carried = np.repeat([float(path.motion.carries) for path in group.paths], group.counts)
        whole = np.empty((len(q), q.shape[1] if wrenches else 0, 3, q.shape[2], 6))
        torques = _terms(group.arms, q, states[:, :, 0], states[:, :, 1], carried, payload, device, whole)
        found.append(TorqueTerms(torques, states, whole))
    return found


def inverse_dynamics_torques(
    arms: ArmArrays, q: Array, qd: Array, qdd: Array, carried: Array, payload: float, device: Device = "cpu"
) -> Array:
    """Return (N, S, D) torques of N arms in S states, without rotors and friction [N m], or forces [N].

    q, qd, qdd: (N, S, D) joint values [rad] or [m], speeds [rad/s] or [m/s] and accelerations [rad/s²] or [m/s²].
    carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    terms = _terms(arms, q, qd, qdd, carried, payload, device)
    return terms[:, :, 0] + terms[:, :, 1]  # gravity, and M q_ss + C q_s with the time as share


def inertia_matrices(arms: ArmArrays, q: Array, carried: Array, payload: float, device: Device = "cpu") -> Array:
    """Return (N, S, D, D) joint-space inertia matrices of N arms in S postures, without rotors, in SI units.

    q: (N, S, D) [rad] or [m].  carried: (S,) share of the payload that is carried.  payload: its mass [kg].
    """
    rest = np.zeros_like(q)
    units = (np.broadcast_to(unit, q.shape) for unit in np.eye(arms.dof))
    return np.stack([_terms(arms, q, unit, rest, carried, payload, device)[:, :, 2] for unit in units], axis=-1)


def _terms(
    arms: ArmArrays, q: Array, q_s: Array, q_ss: Array, carried: Array, payload: float, device: Device,
    wrenches: Array | None = None,
) -> Array:  # fmt: skip
    """Return (N, S, 6, D) gravity, drag and push of N arms at S samples, and what the payload adds to each.

    wrenches: (N, S, 3, D, 6) to be filled, if any.
    """
    loaded = load_kernels("cycle.dynamics_kernels", device)
    terms = np.empty((*q.shape[:2], 6, q.shape[2]))
    full = np.empty((len(q), 0, 3, q.shape[2], 6)) if wrenches is None else wrenches

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        values: dict[str, Any] = {name: getattr(part, name) for name in ("dof", "base", "motion", "axis", "offset")}
        values |= vars(part.rigid_bodies) | {"payload_mass": loaded.warp.float64(payload)}
        values |= {"payload_com": part.payload_center, "payload_inertia": payload * part.payload_gyration}
        bodies, states, outputs = loaded.struct("Bodies", values), (q, q_s, q_ss), (terms[chunk], full[chunk])
        loaded.launch(
            "torque_terms", q[chunk].shape[:2], bodies, *(each[chunk] for each in states), carried, outputs=outputs
        )

    in_chunks(solve, len(arms), max(1, SAMPLES[device] // q.shape[1]), device)
    return terms
