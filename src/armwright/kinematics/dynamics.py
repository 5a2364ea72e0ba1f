"""Inverse dynamics by recursive Newton-Euler, in numpy and float64."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import ArmArrays
from armwright.kinematics.forward import Frames, forward_kinematics
from armwright.robot.arm import GRAVITY


def inverse_dynamics(
    arms: ArmArrays, q: Array, velocity: Array, acceleration: Array, payload: Array, gravity: float = GRAVITY
) -> Array:
    """Compute the joint torques of arms in motion by recursive Newton-Euler (Luh, Walker & Paul 1980).

    Args:
        arms: N arms of up to D joints.
        q: (N, K, D) joint angles [rad] or displacements [m].
        velocity: (N, K, D) joint velocities [rad/s] or [m/s].
        acceleration: (N, K, D) joint accelerations [rad/s²] or [m/s²].
        payload: (K,) mass of the payload [kg].
        gravity: Acceleration along -z [m/s²].

    Returns:
        (N, K, D) torques [N m] or forces [N]; 0 for fixed joints.
    """
    return _newton_euler(arms, forward_kinematics(arms, q), velocity, acceleration, payload, gravity)


def _newton_euler(
    arms: ArmArrays, frames: Frames, velocity: Array, acceleration: Array, payload: Array, gravity: float
) -> Array:
    n, k, dof = velocity.shape
    bodies = arms.rigid_bodies
    mass, com, inertia = bodies.mass[..., None], bodies.com, bodies.inertia
    prismatic = arms.prismatic[:, None, :, None]  # (N, 1, D, 1)
    rate, rate_change = frames.axis * velocity[..., None], frames.axis * acceleration[..., None]  # (N, K, D, 3)
    angular_rate, angular_change = np.where(prismatic, 0.0, rate), np.where(prismatic, 0.0, rate_change)
    linear_rate, linear_change = np.where(prismatic, rate, 0.0), np.where(prismatic, rate_change, 0.0)
    omega, alpha = np.zeros((2, n, k, 3))  # angular velocity [rad/s] and acceleration [rad/s²] of the link before
    a = np.zeros((n, k, 3))  # acceleration of its joint [m/s²]: gravity acts like a base that accelerates upwards
    a[..., 2] = gravity
    force, moment = np.empty((2, n, k, dof, 3))  # on each link, about its centre of mass
    lever = np.empty((n, k, dof, 3))  # from the joint to that centre, in the world [m]
    before = frames.position[:, :, 0]
    for j in range(dof):
        step = frames.position[:, :, j] - before
        a = a + _relative(omega, alpha, step) + 2.0 * _cross(omega, linear_rate[:, :, j]) + linear_change[:, :, j]
        alpha = alpha + angular_change[:, :, j] + _cross(omega, angular_rate[:, :, j])
        omega = omega + angular_rate[:, :, j]
        rotation = frames.rotation[:, :, j]
        lever[:, :, j] = _product(rotation, com[:, None, j])
        force[:, :, j] = mass[:, None, j] * (a + _relative(omega, alpha, lever[:, :, j]))
        moment[:, :, j] = _rotation_moment(rotation, inertia[:, j], omega, alpha)
        before = frames.position[:, :, j]
    after = frames.tip
    total_force = payload[:, None] * (a + _relative(omega, alpha, after - before))  # (N, K, 3)
    total_moment = np.zeros((n, k, 3))  # about the next joint
    if arms.payload_center.any() or arms.payload_gyration.any():
        rotation = frames.rotation[:, :, -1]
        center = _product(rotation, arms.payload_center[:, None].astype(np.float64))  # from the tip [m]
        total_force = payload[:, None] * (a + _relative(omega, alpha, after - before + center))
        turning = _rotation_moment(rotation, arms.payload_gyration, omega, alpha)
        total_moment = _cross(center, total_force) + payload[:, None] * turning
    torques = np.empty((n, k, dof))
    for j in reversed(range(dof)):
        position = frames.position[:, :, j]
        total_moment = (
            total_moment
            + _cross(after - position, total_force)
            + moment[:, :, j]
            + _cross(lever[:, :, j], force[:, :, j])
        )
        total_force = total_force + force[:, :, j]
        load = np.where(prismatic[:, :, j], total_force, total_moment)
        torques[:, :, j] = (frames.axis[:, :, j] * load).sum(axis=-1)
        after = position
    return torques


def _relative(omega: Array, alpha: Array, lever: Array) -> Array:
    """Return the acceleration of a point relative to another one of the same body [m/s²]."""
    return _cross(alpha, lever) + _cross(omega, _cross(omega, lever))


def _rotation_moment(rotation: Array, tensor: Array, omega: Array, alpha: Array) -> Array:
    """Return the (N, K, 3) moments in the world that give bodies their angular acceleration [N m].

    Args:
        rotation: (N, K, 3, 3) of the bodies.
        tensor: (N, 3, 3) their inertia in their own frames, symmetric [kg m²].
        omega: (N, K, 3) angular velocity [rad/s].
        alpha: (N, K, 3) angular acceleration [rad/s²].
    """
    local_omega, local_alpha = (_product(rotation.swapaxes(-1, -2), vector) for vector in (omega, alpha))
    return _product(rotation, local_alpha @ tensor + _cross(local_omega, local_omega @ tensor))


def _product(matrix: Array, vector: Array) -> Array:
    """Multiply (..., R, C) by (..., C) column by column, in half the time of as many small products."""
    product = matrix[..., 0] * vector[..., :1]
    for column in range(1, vector.shape[-1]):
        product += matrix[..., column] * vector[..., column : column + 1]
    return product


def _cross(a: Array, b: Array) -> Array:
    """Return np.cross in less time."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
