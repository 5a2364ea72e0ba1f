"""Reserves of the drives along a cycle: how many times as much their makers allow.

The reserve of a torque is the factor by which all torques could be multiplied, at their speeds, before the torque-speed
line is reached; that of heat, before the continuous torque is reached by their root mean square; that of a speed is
the no-load speed over it; that of a bearing, the limit of its maker over the load across the axis. Safety factors do
not count.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.cycle.cycle_loads import CycleLoads
from armwright.kinematics.cycle.drive_limits import available_torque

LEAST, MOST = 1e-3, 1e3  # reserves beyond these count as these


@dataclass(frozen=True)
class Reserves:
    """Reserves of N arms of up to D joints along M motions."""

    by_cause: Mapping[str, Array]  # (N, M, D) by what is limited; (N, 1, D) over the whole cycle

    def __or__(self, other: "Reserves") -> "Reserves":
        return Reserves({**self.by_cause, **other.by_cause})

    @property
    def least(self) -> Array:
        """(N,) the smallest reserve of each arm."""
        return np.min([values.min(axis=(1, 2)) for values in self.by_cause.values()], axis=0)

    def weakest(self, row: int) -> tuple[str, int | None, int]:
        """Return what limits an arm most: cause, index of the motion (None over the cycle), and index of the joint."""
        cause = min(self.by_cause, key=lambda name: float(self.by_cause[name][row].min()))
        values = self.by_cause[cause][row]
        motion, joint = divmod(int(values.argmin()), values.shape[1])
        return cause, None if len(values) == 1 else motion, joint


def reserves_of(loads: CycleLoads, drives: Actuation) -> Reserves:
    """Return the reserves of drives along a cycle."""
    shape = loads.torques.shape
    torques, speeds = (values.reshape(shape[0], -1, shape[3]) for values in (loads.torques, loads.speeds))
    available = available_torque(torques, speeds, drives)
    of_torque = _ratio(available, torques).reshape(shape).min(axis=2)
    of_speed = _ratio(drives.no_load_speed[:, None], speeds).reshape(shape).min(axis=2)
    of_heat = _ratio(drives.continuous, loads.rms_torques)[:, None]
    return Reserves({"torque": of_torque, "speed": of_speed, "heat": of_heat})


def holding_reserves(torques: Array, drives: Actuation) -> Reserves:
    """Return the reserves of drives that hold T postures; torques: (N, T, D) at the joints [N m] or [N]."""
    return Reserves({"torque": _ratio(drives.peak[:, None], torques)})


def bearing_reserves(loads: Array, limits: Array) -> Reserves:
    """Return the reserves of bearings; loads: (N, M, D, 3) in motions or at targets.  limits: (N, D, 3) or NaN."""
    of_each = np.where(np.isnan(limits)[:, None], MOST, _ratio(limits[:, None], loads))
    return Reserves({"load across the axis": of_each.min(axis=3)})


def _ratio(limit: Array, value: Array) -> Array:
    """Return the limit over the size of a value."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.clip(limit / np.abs(value), LEAST, MOST)
