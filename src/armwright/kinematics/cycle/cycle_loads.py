"""Durations, torques and speeds along a cycle, each motion from rest to rest with a fifth-order profile.

s = 10 τ³ - 15 τ⁴ + 6 τ⁵ at the share τ of a motion's duration T: the profile of least jerk (Flash & Hogan 1985). So
s' = s_τ / T and s'' = s_ττ / T², and the torque is a polynomial in 1 / T at each instant.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.bearings import largest_bearing_loads
from armwright.kinematics.cycle.cycle_path import CycleGroup, CyclePaths
from armwright.kinematics.cycle.drive_limits import MotionLoad, least_time, motion_load
from armwright.kinematics.cycle.torque_terms import TorqueTerms
from armwright.tasks.motions import CyclePlan

ROUNDING = 1.0 + 1e-9  # of a least duration, so that its limits hold in spite of rounding
MIN_TIME, MAX_TIME = 0.15, 1e3  # [s] of a motion that is as fast as possible; drives cannot follow shorter ones
MORE_PAYLOAD = 0.1  # share of the payload by which it may be heavier in a motion as fast as possible
VOLTAGE_SHARE = 0.9  # of the voltage, that suffices for it
BETWEEN = 16  # times as many instants of a sharp path, of which the largest values count


@dataclass(frozen=True)
class CycleLoads:
    """N arms along the M motions of a cycle, at F instants of each, equally spaced in time.

    Of sharp paths (`CycleGroup`), the largest values around each instant are kept.
    """

    durations: Array  # (N, M) [s]
    dwells: Array  # (M,) time at rest after each motion [s]
    torques: Array  # (N, M, F, D) torques of the drives that count against their limits [N m], or forces [N]
    speeds: Array  # (N, M, F, D) joint speeds [rad/s] or [m/s]
    holding: Array  # (N, M, D) torques at rest after each motion [N m], or forces [N]

    @property
    def cycle_time(self) -> Array:
        """(N,) duration of the cycle [s]."""
        return self.durations.sum(axis=1) + self.dwells.sum()

    @property
    def rms_torques(self) -> Array:
        """(N, D) root mean square of the torques over the cycle, dwells included [N m], or forces [N]."""
        return np.sqrt(self.mean(self.torques**2, self.holding**2))

    def mean(self, moving: Array, resting: Array) -> Array:
        """Return the (N, ...) means over the cycle of (N, M, F, ...) values in motion and (N, M, ...) after motions."""
        weights = np.full(moving.shape[2], 1.0 / (moving.shape[2] - 1))
        weights[[0, -1]] /= 2.0
        total = np.einsum("nm,f,nmf...->n...", self.durations, weights, moving)
        total += np.einsum("m,nm...->n...", self.dwells, resting)
        return (total.T / self.cycle_time).T


def holding_torques(paths: CyclePaths, terms: Sequence[tuple[TorqueTerms, ...]]) -> Array:
    """Return (N, M, F, D) torques against gravity at the instants of each motion [N m], or forces [N]."""
    torques = np.empty((len(paths.jumps), len(paths.plan.motions), paths.instants, paths.groups[0].arms.dof))
    for group, of_motions in zip(paths.groups, terms, strict=True):
        density = _density(group)
        for i, part in enumerate(of_motions):
            weights, _, _ = _instants(part.gravity.shape[1], density * (paths.instants - 1) + 1)
            torques[group.index, i] = _thinned(weights @ part.gravity, density)
    return torques


def cycle_loads(paths: CyclePaths, terms: Sequence[tuple[TorqueTerms, ...]], kept: Array | None = None) -> CycleLoads:
    """Return the loads of N arms along a cycle, by their torque terms from `torque_terms`.

    kept: (N, M) durations of the motions [s]; None for those of the cycle and of the drives.

    Raises:
        UnknownQuantityError: A step should be as fast as possible, but the arms have no actuators with known speeds.
    """
    plan, n = paths.plan, len(paths.jumps)
    m, dof = len(plan.motions), paths.groups[0].arms.dof
    durations, holding = np.empty((n, m)), np.empty((n, m, dof))
    torques, speeds = np.empty((2, n, m, paths.instants, dof))
    for group, of_motions in zip(paths.groups, terms, strict=True):
        density = _density(group)
        loads = [_load(part, group.arms, density * (paths.instants - 1) + 1) for part in of_motions]
        times = _durations(group.arms, plan, loads, of_motions) if kept is None else kept[group.index]
        durations[group.index] = times
        for i, load in enumerate(loads):
            torques[group.index, i] = _thinned(load.torque(times[:, i]), density)
            speeds[group.index, i] = _thinned(load.velocity / times[:, i, None, None], density)
            holding[group.index, i - 1] = of_motions[i].gravity[:, 0]
        if not plan.cycle.closed:
            holding[group.index, -1] = of_motions[-1].gravity[:, -1]
    return CycleLoads(durations, np.array(plan.dwells), torques, speeds, holding)


def cycle_bearing_loads(paths: CyclePaths, terms: Sequence[tuple[TorqueTerms, ...]], durations: Array) -> Array:
    """Return the (N, M, D, 3) largest tilting moment [N m], axial and radial force [N] of the joints in each motion.

    terms: with wrenches.  durations: (N, M) of the motions [s].
    """
    largest = np.empty((*durations.shape, paths.groups[0].arms.dof, 3))
    for group, of_motions in zip(paths.groups, terms, strict=True):
        for i, part in enumerate(of_motions):
            weights, rate, change = _instants(part.gravity.shape[1], _density(group) * (paths.instants - 1) + 1)
            flat = weights @ part.wrenches.reshape(*part.wrenches.shape[:3], -1)  # (3, n, F, D 6)
            s, ss = rate[:, None] / durations[group.index, i, None, None], change[:, None]
            total = flat[0] + flat[1] * s**2 + flat[2] * ss / durations[group.index, i, None, None] ** 2
            largest[group.index, i] = largest_bearing_loads(group.arms, total.reshape(*total.shape[:2], -1, 6))
    return largest


def _density(group: CycleGroup) -> int:
    """Return how many times as many instants are evaluated as are kept."""
    return BETWEEN if group.is_sharp else 1


def _thinned(values: Array, density: int) -> Array:
    """Return (n, F, D) of values (n, density (F - 1) + 1, D): the largest in magnitude from instant to instant.

    The first and the last one, at rest, stay as they are.
    """
    if density == 1:
        return values
    nearby = sliding_window_view(values, 2 * density + 1, axis=1)[:, ::density]  # (n, F - 2, D, 2 density + 1)
    largest = np.abs(nearby).argmax(axis=-1)[..., None]
    return np.concatenate([values[:, :1], np.take_along_axis(nearby, largest, axis=-1)[..., 0], values[:, -1:]], axis=1)


def _load(terms: TorqueTerms, arms: ArmArrays, instants: int) -> MotionLoad:
    """Return the load of a motion; the drives' own inertia and friction count where they are known."""
    weights, s_t, s_tt = _instants(terms.gravity.shape[1], instants)
    q_s, q_ss, drag, push = (weights @ values for values in (terms.q_s, terms.q_ss, terms.drag, terms.push))
    rate, change = s_t[:, None], s_tt[:, None]
    gravity, inertial, velocity = weights @ terms.gravity, drag * rate**2 + push * change, q_s * rate
    if arms.actuation is None:
        nothing = np.zeros(gravity.shape)
        return MotionLoad(gravity, nothing, nothing, inertial, velocity, nothing)
    drives = arms.actuation
    names = ("rotor_inertia", "coulomb", "viscous", "limit_friction")
    known = {name: np.nan_to_num(getattr(drives, name)) for name in names}
    return motion_load(gravity, inertial, velocity, q_ss * rate**2 + q_s * change, replace(drives, **known))


def quintic(t: Array) -> tuple[Array, Array, Array]:
    """Return s, s_τ and s_ττ of the profile at shares of the duration."""
    s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return s, 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)


@cache
def _instants(samples: int, instants: int) -> tuple[Array, Array, Array]:
    """Return (F, R) weights that interpolate between R samples at F instants, and s_τ and s_ττ there (F,)."""
    s, rate, change = quintic(np.linspace(0.0, 1.0, instants))
    at = s * (samples - 1)
    before = np.minimum(at.astype(np.intp), samples - 2)
    weights = np.zeros((len(s), samples))
    rows = np.arange(len(s))
    weights[rows, before] = 1.0 - (at - before)
    weights[rows, before + 1] += at - before
    return weights, rate, change


def check_durations(drives: Actuation | None, plan: CyclePlan) -> Actuation | None:
    """Return the drives if their torques and speeds are known, else None.

    Raises:
        UnknownQuantityError: They are not known, and a step should be as fast as possible.
    """
    if drives is not None and not np.isnan(drives.peak + drives.no_load_speed + drives.corner_speed).any():
        return drives
    if any(plan.times[motion.step] is None for motion in plan.motions):
        raise UnknownQuantityError(
            "cycle_time and other quantities of time need the duration of each step, or actuators with known torques "
            "and speeds; try cycle: {time: 1.5, ...}",
            "the task leaves durations open, and a torque or speed of the drives is not known",
        )
    return None


def _heavier(load: MotionLoad, terms: TorqueTerms) -> MotionLoad:
    """Return the load of a motion with a heavier payload."""
    weights, rate, change = _instants(terms.gravity.shape[1], load.gravity.shape[1])
    gravity, drag, push = (MORE_PAYLOAD * (weights @ part) for part in terms.payload)
    inertial = drag * rate[:, None] ** 2 + push * change[:, None]
    return replace(load, gravity=load.gravity + gravity, inertial=load.inertial + inertial)


def _durations(arms: ArmArrays, plan: CyclePlan, loads: Sequence[MotionLoad], terms: Sequence[TorqueTerms]) -> Array:
    """Return the (N, M) durations: the least for torques and speeds, scaled to a step's own time if it states one.

    The least ones keep the safety factor, and the makers' limits with less voltage and with a heavier payload. Without
    known torques and speeds, the motions of a step share its time by the largest travel of a joint.
    """
    drives = check_durations(arms.actuation, plan)
    travel = np.stack([np.abs(load.velocity).max(axis=(1, 2)) for load in loads], axis=1)  # (N, M)
    durations = travel + 1e-9
    if drives is not None:
        bare = drives.at_makers_limits
        weak = bare.at_voltage(VOLTAGE_SHARE)
        least = np.stack(
            [
                least_time((load, drives), (load, weak), *([(_heavier(load, part), bare)] if motion.carries else []))
                for motion, load, part in zip(plan.motions, loads, terms, strict=True)
            ],
            axis=1,
        )
        durations = np.clip(np.where(np.isfinite(least), ROUNDING * least, MAX_TIME), MIN_TIME, MAX_TIME)
    for step in {motion.step for motion in plan.motions}:
        own = [i for i, motion in enumerate(plan.motions) if motion.step == step]
        time = plan.times[step]
        if time is not None:
            durations[:, own] *= time / durations[:, own].sum(axis=1, keepdims=True)
    return durations
