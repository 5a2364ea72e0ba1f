"""Defaults of actuators by kind, for values that no source states; docs/spaces.md gives the evidence."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from armwright.robot.motor_body import BodyShape

ActuatorKind = Literal["servo", "coreless servo", "geared drive", "quasi-direct-drive", "harmonic"]

SUPPLY_TOLERANCE = 0.1  # of a voltage beside which the maker states no range
BRACKET_SHARE, MIN_BRACKET_MASS = 0.25, 0.01  # of the mass of an actuator; [kg]


@dataclass(frozen=True)
class KindDefaults:
    """Ratios of one kind of actuator: τ is its reference torque, ω its no-load speed, V its voltage."""

    time_constant: float  # rotor inertia x ω / τ [s]
    coulomb: float  # coulomb friction / τ
    viscous: float  # viscous friction x ω / τ
    corner: float  # corner speed / ω
    backlash: float  # backlash [rad]
    joint_stiffness: float  # joint stiffness / τ [1/rad]
    gain: float  # position gain / τ [1/rad]
    damping: float | None  # damping gain / position gain [s]; None for τ / ω, the back-EMF of a voltage-driven motor
    current: float  # supply current at the peak torque x V / (τ ω)
    load_friction: float  # friction that grows with the load / torque at the output
    before_friction: bool = False  # whether makers state torques before this friction, else at the output
    continuous: float = 0.25  # continuous torque / τ


DEFAULTS: Mapping[ActuatorKind, KindDefaults] = {
    "servo": KindDefaults(0.047, 0.025, 0.09, 0.0, math.radians(0.5), 40.0, 4.6, None, 1.6, 0.2, True),
    "coreless servo": KindDefaults(0.016, 0.025, 0.09, 0.0, math.radians(0.25), 40.0, 4.6, None, 1.6, 0.2, True),
    "geared drive": KindDefaults(0.017, 0.07, 0.25, 0.3, math.radians(0.1), 100.0, 4.0, 0.05, 2.5, 0.24),
    "quasi-direct-drive": KindDefaults(0.007, 0.02, 0.045, 0.3, math.radians(0.2), 100.0, 1.6, 0.05, 1.0, 0.05),
    "harmonic": KindDefaults(0.017, 0.07, 0.25, 0.3, math.radians(0.005), 190.0, 4.0, 0.05, 2.5, 0.24),
}


def default_values(
    kind: ActuatorKind, mass: float, torque: float, speed: float | None, voltage: float | None, gain: float | None
) -> dict[str, float]:
    """Return the defaults of a kind, without those for which speed or voltage is missing.

    mass: of the actuator [kg].  torque: its reference torque [N m].  speed: its no-load speed [rad/s].  voltage: its
    supply voltage [V].  gain: its position gain [N m/rad]; None for the default.
    """
    ratios = DEFAULTS[kind]
    gain = ratios.gain * torque if gain is None else gain
    speed, voltage = (math.nan if value is None else value for value in (speed, voltage))
    values = {
        "bracket_mass": max(BRACKET_SHARE * mass, MIN_BRACKET_MASS),
        "voltage_min": (1.0 - SUPPLY_TOLERANCE) * voltage,
        "voltage_max": (1.0 + SUPPLY_TOLERANCE) * voltage,
        "rated_torque": ratios.continuous * torque,
        "coulomb_friction": ratios.coulomb * torque,
        "load_friction": ratios.load_friction,
        "bearing_offset": 0.0,
        "backlash": ratios.backlash,
        "joint_stiffness": ratios.joint_stiffness * torque,
        "position_gain": gain,
        "damping_gain": torque / speed if ratios.damping is None else ratios.damping * gain,
        "rotor_inertia": ratios.time_constant * torque / speed,
        "viscous_friction": ratios.viscous * torque / speed,
        "corner_speed": ratios.corner * speed,
        "current": ratios.current * torque * speed / voltage,
    }
    return {name: value for name, value in values.items() if not math.isnan(value)}


def default_shape(
    kind: ActuatorKind, width: float, height: float, depth: float
) -> tuple[BodyShape, Literal["width", "height", "depth"]]:
    """Return the default shape of a kind with these edges [m], and which of them is along its shaft.

    Two equal edges are those of a square or round section about the shaft. Otherwise makers of servos state the depth
    along it. Servos and geared drives are boxes, flat drives are cylinders.
    """
    edge = "width" if height == depth != width else "height" if width == depth != height else "depth"
    return "cylinder" if kind in ("quasi-direct-drive", "harmonic") else "box", edge
