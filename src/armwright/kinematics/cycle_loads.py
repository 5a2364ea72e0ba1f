"""Durations, torques and speeds along a cycle, each motion from rest to rest with a fifth-order profile.

s = 10 τ³ - 15 τ⁴ + 6 τ⁵ at the share τ of a motion's duration T: the profile of least jerk (Flash & Hogan 1985). So
s' = s_τ / T and s'' = s_ττ / T², and the torque is a polynomial in 1 / T at each instant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.kinematics.arm_arrays import ArmArrays
from armwright.kinematics.cycle_path import CyclePaths
from armwright.kinematics.torque_terms import TorqueTerms
from armwright.tasks.motions import CyclePlan

INSTANTS = 33  # of a motion, equally spaced in time


@dataclass(frozen=True)
class CycleLoads:
    """N arms along the M motions of a cycle, at F instants of each, equally spaced in time.

    Attributes:
        durations: (N, M) [s].
        dwells: (M,) time at rest after each motion [s].
        torques: (N, M, F, D) torques of the drives at the joints [N m], or forces [N].
        speeds: (N, M, F, D) joint speeds [rad/s] or [m/s].
        holding: (N, M, D) torques at rest after each motion [N m], or forces [N].
    """

    durations: Array
    dwells: Array
    torques: Array
    speeds: Array
    holding: Array

    @property
    def cycle_time(self) -> Array:
        """(N,) duration of the cycle [s]."""
        return self.durations.sum(axis=1) + self.dwells.sum()

    @property
    def rms_torques(self) -> Array:
        """(N, D) root mean square of the torques over the cycle, dwells included [N m], or forces [N]."""
        weights = np.full(INSTANTS, 1.0 / (INSTANTS - 1))
        weights[[0, -1]] /= 2.0
        moving = np.einsum("nm,f,nmfd->nd", self.durations, weights, self.torques**2)
        resting = np.einsum("m,nmd->nd", self.dwells, self.holding**2)
        return np.sqrt((moving + resting) / self.cycle_time[:, None])


def holding_torques(paths: CyclePaths, terms: Sequence[tuple[TorqueTerms, ...]]) -> Array:
    """Return (N, M, F, D) torques against gravity at the instants of each motion [N m], or forces [N]."""
    torques = np.empty((len(paths.jumps), len(paths.plan.motions), INSTANTS, paths.groups[0].arms.dof))
    for group, of_motions in zip(paths.groups, terms, strict=True):
        for i, part in enumerate(of_motions):
            torques[group.index, i] = _instants(part.gravity.shape[1])[0] @ part.gravity
    return torques


def cycle_loads(paths: CyclePaths, terms: Sequence[tuple[TorqueTerms, ...]]) -> CycleLoads:
    """Return the loads of arms along a cycle.

    Args:
        paths: N arms.
        terms: Their torque terms, from `torque_terms`.

    Raises:
        SettingsError: A step should be as fast as possible, but the arms have no actuators with known speeds.
    """
    plan, n = paths.plan, len(paths.jumps)
    m, dof = len(plan.motions), paths.groups[0].arms.dof
    durations, holding = np.empty((n, m)), np.empty((n, m, dof))
    torques, speeds = np.empty((2, n, m, INSTANTS, dof))
    for group, of_motions in zip(paths.groups, terms, strict=True):
        profiles = [_Profile.of(part, group.arms) for part in of_motions]
        times = _durations(group.arms, plan, of_motions, profiles)
        durations[group.index] = times
        for i, profile in enumerate(profiles):
            torques[group.index, i], speeds[group.index, i] = profile.at(times[:, i])
            holding[group.index, i - 1] = of_motions[i].gravity[:, 0]
        if not plan.cycle.closed:
            holding[group.index, -1] = of_motions[-1].gravity[:, -1]
    return CycleLoads(durations, _dwells(plan), torques, speeds, holding)


@dataclass(frozen=True)
class _Profile:
    """Loads along a motion of duration T at F instants: torque static + viscous / T + dynamic / T², speed rate / T.

    All are (N, F, D). Rotors, gears and their friction count where they are known.
    """

    static: Array
    viscous: Array
    dynamic: Array
    rate: Array

    @classmethod
    def of(cls, terms: TorqueTerms, arms: ArmArrays) -> "_Profile":
        weights, s_t, s_tt = _instants(terms.gravity.shape[1])
        drives = arms.actuation
        nothing = np.zeros(arms.motion.shape)
        known = (nothing,) * 3 if drives is None else (drives.rotor_inertia, drives.coulomb, drives.viscous)
        inertia, coulomb, viscous = (np.nan_to_num(values)[:, None] for values in known)  # (N, 1, D)
        drag, push = terms.drag + inertia * terms.q_ss, terms.push + inertia * terms.q_s
        rate = (weights @ terms.q_s) * s_t[:, None]
        return cls(
            static=weights @ terms.gravity + coulomb * np.sign(rate),
            viscous=viscous * rate,
            dynamic=(weights @ drag) * s_t[:, None] ** 2 + (weights @ push) * s_tt[:, None],
            rate=rate,
        )

    def at(self, duration: Array) -> tuple[Array, Array]:
        """Return (N, F, D) torques and speeds for durations (N,) [s]."""
        time = duration[:, None, None]
        return self.static + self.viscous / time + self.dynamic / time**2, self.rate / time


@cache
def _instants(samples: int) -> tuple[Array, Array, Array]:
    """Return (F, R) weights that interpolate between R samples at the F instants, and s_τ and s_ττ there (F,)."""
    t = np.linspace(0.0, 1.0, INSTANTS)
    s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    at = s * (samples - 1)
    before = np.minimum(at.astype(np.intp), samples - 2)
    weights = np.zeros((INSTANTS, samples))
    rows = np.arange(INSTANTS)
    weights[rows, before] = 1.0 - (at - before)
    weights[rows, before + 1] += at - before
    return weights, 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)


def _durations(arms: ArmArrays, plan: CyclePlan, terms: Sequence[TorqueTerms], profiles: Sequence[_Profile]) -> Array:
    """Return the (N, M) durations: a step's own time shared by its motions, or the least for torques and speeds."""
    if any(time is None for time in plan.times):
        raise SettingsError(
            "cycle_time and other quantities of time need the duration of each step, or actuators with known speeds; "
            "try cycle: {time: 1.5, ...}"
        )
    least = np.stack([np.abs(part.q_s).mean(axis=1).max(axis=1) for part in terms], axis=1)  # (N, M) joint travel
    least = np.maximum(least, 1e-6)
    durations = np.empty(least.shape)
    for step in {motion.step for motion in plan.motions}:
        own = [i for i, motion in enumerate(plan.motions) if motion.step == step]
        durations[:, own] = plan.times[step] * least[:, own] / least[:, own].sum(axis=1, keepdims=True)
    return durations


def _dwells(plan: CyclePlan) -> Array:
    """Return the (M,) time at rest after each motion [s]."""
    return np.array(
        [plan.cycle.dwell if motion.arrives and plan.cycle.steps[motion.step].do else 0.0 for motion in plan.motions]
    )
