"""Ratings of the actuators of stacked arms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.rigid_bodies import PerArm
from armwright.robot.actuators import torque_at_voltage
from armwright.robot.arm import Actuator, Arm

# Of each field of `Actuation` by joint: the field of `Actuator`, the power of the joint's travel that its value is
# multiplied by, and the value of a fixed joint.
RATINGS: Mapping[str, tuple[str, int, float]] = {
    "peak": ("peak_torque", -1, np.inf),
    "continuous": ("continuous_torque", -1, np.inf),
    "corner_speed": ("corner_speed", 1, np.inf),
    "no_load_speed": ("speed", 1, np.inf),
    "rotor_inertia": ("rotor_inertia", -2, 0.0),
    "coulomb": ("coulomb_friction", -1, 0.0),
    "viscous": ("viscous_friction", -2, 0.0),
    "load_friction": ("load_friction", 0, 0.0),
    "limit_friction": ("limit_friction", 0, 0.0),
    "voltage": ("voltage", 0, 0.0),
    "current": ("current", 0, 0.0),
    "backlash": ("backlash", 1, 0.0),
    "joint_stiffness": ("joint_stiffness", -2, np.inf),
    "position_gain": ("position_gain", -2, np.inf),
    "bearing_offset": ("bearing_offset", 0, 0.0),
    "tilting_limit": ("tilting_limit", 0, np.inf),
    "axial_limit": ("axial_limit", 0, np.inf),
    "radial_limit": ("radial_limit", 0, np.inf),
}
FIXED_RATINGS = tuple(value for _, _, value in RATINGS.values())


@dataclass(frozen=True)
class Actuation(PerArm):
    """Actuators of N arms of up to D joints, by the motion of their joints: of a slide in m, N and kg.

    NaN where a value is unknown. A fixed joint, or one that follows another, has infinite torques, speeds and
    stiffness; its other values are 0. Limits of the bearings of the latter are unknown.
    """

    peak: Array  # (N, D) largest torque, at rest and up to the corner speed [N m] or [N]
    continuous: Array  # (N, D) torque that can be held forever [N m] or [N]
    corner_speed: Array  # (N, D) from which on the available torque falls linearly [rad/s] or [m/s]
    no_load_speed: Array  # (N, D) at which it is 0 [rad/s] or [m/s]
    rotor_inertia: Array  # (N, D) of rotor and gear [kg m²] or [kg]
    coulomb: Array  # (N, D) friction at any speed [N m] or [N]
    viscous: Array  # (N, D) friction by speed [N m s/rad] or [N s/m]
    load_friction: Array  # (N, D) friction of a motor that pushes, relative to the torque at its output
    limit_friction: Array  # (N, D) the same where peak and continuous are stated before this friction; 0 elsewhere
    voltage: Array  # (N, D) of the supply [V]
    current: Array  # (N, D) from the supply at the peak torque [A]
    backlash: Array  # (N, D) [rad] or [m]
    joint_stiffness: Array  # (N, D) from the motor to the joint [N m/rad] or [N/m]
    position_gain: Array  # (N, D) of the position control [N m/rad] or [N/m]
    bearing_offset: Array  # (N, D) of the output bearing from the joint, along the axis [m]
    tilting_limit: Array  # (N, D) largest moment across the axis of a motor [N m]
    axial_limit: Array  # (N, D) largest force along it [N]
    radial_limit: Array  # (N, D) largest force across it [N]
    price: Array  # (N,) of all actuators of an arm [USD]; NaN if one has no price
    safety_factor: Array  # (N,) by which required torques are multiplied

    @property
    def falling_range(self) -> Array:
        """(N, D) range of speeds over which the available torque falls [rad/s]; 0 for fixed joints."""
        fixed = np.isinf(self.no_load_speed)
        return np.where(fixed, 0.0, self.no_load_speed - np.where(fixed, 0.0, self.corner_speed))

    @property
    def at_makers_limits(self) -> Self:
        """The actuators with a safety factor of 1."""
        return replace(self, safety_factor=np.ones_like(self.safety_factor))

    def at_voltage(self, share: float) -> Self:
        """Return the actuators at a share of their voltage (`torque_at_voltage`); the voltage stays as stated."""
        torque, less = torque_at_voltage(share, self.no_load_speed, self.falling_range), share * self.no_load_speed
        corner = np.maximum(0.0, less - self.falling_range)
        return replace(self, peak=torque * self.peak, no_load_speed=less, corner_speed=corner)


def actuation_at_joints(ratings: Array, travel: Array, price: Array, safety_factor: Array) -> Actuation:
    """Return the actuation of joints by the ratings of their actuators.

    ratings: (N, D, R) as from `ratings_of`; FIXED_RATINGS for fixed joints.  travel: (N, D) of a joint for each radian
    of its actuator [m/rad]; 1 for revolute joints.  price: (N,) of all actuators of an arm [USD].  safety_factor: (N,)
    by which required torques are multiplied.
    """
    at_joints = {
        name: ratings[..., i] * travel**power if power >= 0 else ratings[..., i] / travel**-power
        for i, (name, (_, power, _)) in enumerate(RATINGS.items())
    }
    return Actuation(**at_joints, price=price, safety_factor=safety_factor)


def ratings_of(actuator: Actuator) -> tuple[float, ...]:
    """Return what `actuation_at_joints` needs of an actuator; NaN for unknown values."""
    values = (getattr(actuator, name) for name, _, _ in RATINGS.values())
    return tuple(np.nan if value is None else value for value in values)


def actuation_of(arms: Sequence[Arm], travel: Array) -> Actuation | None:
    """Return the actuation of N arms, None if an independent joint has no actuator; travel: (N, D) as above."""
    ratings = np.empty((*travel.shape, len(FIXED_RATINGS)))
    ratings[:] = FIXED_RATINGS
    prices = np.zeros(len(arms))
    for i, arm in enumerate(arms):
        for j, joint in enumerate(arm.joints):
            if joint.coupling is not None:
                ratings[i, j, -3:] = np.nan  # what its bearings carry is not known
            if joint.kind == "fixed" or joint.coupling is not None:
                continue
            if joint.actuator is None:
                return None
            ratings[i, j] = ratings_of(joint.actuator)
            prices[i] += np.nan if joint.actuator.price is None else joint.actuator.price
    return actuation_at_joints(ratings, travel, prices, np.array([arm.safety_factor for arm in arms]))
