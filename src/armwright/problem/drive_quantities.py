"""Quantities of arms that depend on their actuators, whose ratings are known."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.cycle.drive_limits import torque_speed_utilisation
from armwright.problem.evaluation import Evaluation


def torque_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest share of its peak torque that a motor needs at rest, times the safety factor."""
    drives = evaluation.drives
    peak = (drives.peak * evaluation.arms.travel / drives.safety_factor[:, None])[:, None]
    return evaluation.worst_torques(lambda torques: np.abs(torques / peak).max(axis=-1))


def dynamic_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest torque-speed utilisation on the way to each target."""
    drives = evaluation.drives
    return evaluation.worst_loads(
        lambda torques, speeds: torque_speed_utilisation(torques, speeds, drives).max(axis=-1)
    )


def speed_utilisation(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest share of its no-load speed that a motor needs on the way to each target."""
    speed = evaluation.drives.no_load_speed[:, None]
    return evaluation.worst_loads(lambda _, speeds: np.abs(speeds / speed).max(axis=-1))


def dynamic_torque(evaluation: Evaluation) -> Array:
    """Return (N, T) the largest torque of a motor on the way to each target [N m]."""
    travel = evaluation.arms.travel[:, None]
    return evaluation.worst_loads(lambda torques, _: np.abs(torques * travel).max(axis=-1))


def thermal_utilisation(evaluation: Evaluation) -> Array:
    """Return the (N,) largest share of its continuous torque that a motor needs, times the safety factor."""
    share = evaluation.loads.rms_torques / evaluation.drives.continuous
    return evaluation.drives.safety_factor * share.max(axis=1)


def voltages(evaluation: Evaluation) -> Array:
    """Return the (N,) number of different voltages; fixed joints have 0 V."""
    voltage = np.sort(evaluation.drives.voltage, axis=1)
    first = np.diff(voltage, axis=1, prepend=0.0) > 0.0
    return first.sum(axis=1).astype(np.float64)
