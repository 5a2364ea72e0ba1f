"""Inverse dynamics in the form that oracles have it."""

import numpy as np

from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.cycle.torque_terms import inverse_dynamics_torques
from tests.support.reference_kinematics import Array


def inverse_dynamics(
    arms: ArmArrays, q: Array, velocity: Array, acceleration: Array, payload: Array, gravity: bool = True
) -> Array:
    """(N, K, D) torques of N arms in K states, with or without gravity; payload: (K,) masses [kg]."""
    torques = inverse_dynamics_torques(arms, q, velocity, acceleration, payload, 1.0)
    rest = np.zeros_like(q)
    return torques if gravity else torques - inverse_dynamics_torques(arms, q, rest, rest, payload, 1.0)
