"""The motion of an arm through its cycle in time, sampled for controllers and simulators."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.cycle.instants import quintic
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.cycle.torque_terms import inverse_dynamics_torques
from armwright.tasks.motions import CyclePlan

PERIOD = 0.004  # [s] between rows
SAME_TIME = 1e-9  # [s]
STILL = 1e-6  # [rad/s] or [m/s]; rounding moves a joint that rests at less, and its friction would follow the sign

IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class Trajectory:
    """R rows of the D moving joints of an arm, every 4 ms from rest to rest."""

    time: Array  # (R,) [s]
    step: IndexArray  # (R,) number of the step, counted from 1
    target: IndexArray  # (R,) index of the target on the last row of each dwell or arrival, else -1
    payload: Array  # (R,) mass carried from the row on [kg]
    allowed: Array  # (R, O) depth of tool and payload in each obstacle that does not count [m], as of `TipRules`
    q: Array  # (R, D) joint values [rad] or [m]
    qd: Array  # (R, D) speeds [rad/s] or [m/s]
    qdd: Array  # (R, D) accelerations [rad/s²] or [m/s²]
    tau: Array  # (R, D) torques of the drives, all friction included [N m], or forces [N]


def sample_trajectory(
    arm: ArmArrays, paths: tuple[MotionPath, ...], plan: CyclePlan, durations: Array, dwells: Array, payload: float
) -> Trajectory:
    """Sample the cycle of one arm, stacked as one of one, by its path along each of the M motions of the plan.

    durations: (M,) of the motions [s].  dwells: (M,) time at rest after each motion [s].  payload: its mass [kg].
    """
    begin = np.concatenate([[0.0], np.cumsum(durations + dwells)])
    time = np.arange(int(np.ceil((begin[-1] - SAME_TIME) / PERIOD)) + 1, dtype=np.float64) * PERIOD
    # The row at which a motion begins is the last one of the dwell before it.
    motion = np.maximum(np.searchsorted(begin[:-1], time - SAME_TIME) - 1, 0)
    q, qd, qdd = np.empty((3, len(time), arm.dof))
    allowed = np.empty((len(time), plan.tip_rules.allowed.shape[1]))
    for index, path in enumerate(paths):
        rows = motion == index
        q[rows], qd[rows], qdd[rows] = _states(path, time[rows] - begin[index], durations[index])
        share = quintic(np.clip((time[rows] - begin[index]) / durations[index], 0.0, 1.0))[0]
        allowed[rows] = plan.rules(path.motion, share).allowed
    step, target, carried = _events(plan, motion)
    tau = _drive_torques(arm, q, qd, qdd, carried, payload)
    moves = arm.motion[0] != FIXED
    states = (values[:, moves] for values in (q, qd, qdd, tau))
    return Trajectory(time, step, target, payload * carried, allowed, *states)


def _states(path: MotionPath, time: Array, duration: float) -> tuple[Array, Array, Array]:
    """Return (F, D) joint values, speeds and accelerations at times (F,) from the start of a motion [s]."""
    s, s_t, s_tt = quintic(np.clip(time / duration, 0.0, 1.0))
    rate, change = (s_t / duration)[:, None], (s_tt / duration**2)[:, None]
    q, q_s, q_ss = (path.at(s, order)[0] for order in range(3))
    qd = q_s * rate
    return q, np.where(np.abs(qd) < STILL, 0.0, qd), q_ss * rate**2 + q_s * change


def _events(plan: CyclePlan, motion: IndexArray) -> tuple[IndexArray, IndexArray, Array]:
    """Return (R,) number of the step, index of the target where one ends, and 1 where the payload is carried."""
    motions, steps = plan.motions, plan.cycle.steps
    step = np.array([one.step for one in motions])[motion] + 1
    carried = np.array([float(one.carries) for one in motions])[motion]
    target = np.full(len(motion), -1)
    last_rows = np.append(np.flatnonzero(np.diff(motion)), len(motion) - 1)
    for row in last_rows:
        at = motions[motion[row]]
        if at.arrives:
            do = steps[at.step].do
            target[row] = plan.targets[at.step]
            carried[row] = float(at.carries if do is None else do == "pick")
    if not plan.cycle.closed:
        step[0], target[0] = 1, plan.targets[0]
    return step, target, carried


def _drive_torques(arm: ArmArrays, q: Array, qd: Array, qdd: Array, carried: Array, payload: float) -> Array:
    """Return (R, D) torques of the drives, all friction included [N m], or forces [N].

    The friction of a gear is its share of the lesser of the torques before and after it, which both push or brake.
    """
    torques = inverse_dynamics_torques(arm, q[None], qd[None], qdd[None], carried, payload)[0]
    drives = arm.actuation
    if drives is None:
        return torques
    inertia, coulomb, viscous = (
        np.nan_to_num(values[0]) for values in (drives.rotor_inertia, drives.coulomb, drives.viscous)
    )
    gear: Array = np.nan_to_num(drives.load_friction[0])
    share = np.where(torques * qd > 0.0, gear, gear / (1.0 + gear))
    return torques + inertia * qdd + viscous * qd + (coulomb + share * np.abs(torques)) * np.sign(qd)
