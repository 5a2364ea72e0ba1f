"""Current that the drives of arms draw from their supply along a cycle.

A drive draws its mechanical power, if it is positive, and its copper loss, which grows with the square of the torque
(Siciliano et al. 2009, section 5.2). At rest at the peak torque it draws the current of its data sheet, all of it loss:

    i = max(τ v, 0) / V + I (τ / P)²

with the torque τ, friction and rotor inertia included, the speed v, the voltage V, the peak torque P and the current I.
Of a peak torque that is stated at the output, τ is at the output in the second term, for the same share of the peak
torque before the friction of the gear, which the mechanical power includes.
"""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.cycle.cycle_loads import CycleLoads


@dataclass(frozen=True)
class SupplyCurrents:
    """Currents of all drives of N arms together; NaN if a rating is unknown."""

    peak: Array  # (N,) largest along the cycle [A]
    mean: Array  # (N,) mean over the cycle, dwells included [A]


def supply_currents(loads: CycleLoads, drives: Actuation) -> SupplyCurrents:
    """Return the currents that arms draw along a cycle."""
    moving = _drawn(loads.torques, loads.speeds, drives)  # (N, M, F)
    resting = _drawn(loads.holding[:, :, None], np.zeros(1), drives)[..., 0]  # (N, M)
    return SupplyCurrents(np.maximum(moving.max(axis=(1, 2)), resting.max(axis=1)), loads.mean(moving, resting))


def _drawn(torques: Array, speeds: Array, drives: Actuation) -> Array:
    """Return the (N, M, F) currents of all drives [A]; torques, speeds: (N, M, F, D)."""
    peak, voltage, current = (each[:, None, None] for each in (drives.peak, drives.voltage, drives.current))
    gear = (1.0 + np.nan_to_num(drives.load_friction)) / (1.0 + np.nan_to_num(drives.limit_friction))
    power = gear[:, None, None] * np.maximum(torques * speeds, 0.0)
    supplied = np.where(voltage == 0.0, 1.0, voltage)  # of fixed joints, which have no power
    return (power / supplied + current * (torques / peak) ** 2).sum(axis=-1)
