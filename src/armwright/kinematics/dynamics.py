"""Inverse dynamics by recursive Newton-Euler, in numpy and float64, and torques along timed straight lines.

Each fraction s of a line has a posture q(s), and s(t) is the same for all arms. With s' = ds/dt

    torque(t) = gravity(s) + drag(s) s'² + push(s) s'',   push = M q_s,   drag = M q_ss + C(q, q_s) q_s

where gravity, drag and push depend on the samples only, not on the duration of the move (Bobrow et al. 1985).
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import ArmArrays
from armwright.kinematics.forward import Frames, forward_kinematics
from armwright.kinematics.jacobian import jacobian_of, jacobian_rate
from armwright.kinematics.paths import Paths, largest_of
from armwright.robot.arm import GRAVITY
from armwright.tasks.moves import Moves, MoveTiming, time_samples

DAMPING = 0.005  # relative to an arm's size, docs/method.md §17
CHUNK = 2**12  # postures whose arrays stay in the cache of a core


def inverse_dynamics(
    arms: ArmArrays, q: Array, velocity: Array, acceleration: Array, payload: Array, gravity: float = GRAVITY
) -> Array:
    """Compute the joint torques of arms in motion by recursive Newton-Euler (Luh, Walker & Paul 1980).

    Args:
        arms: N arms of up to D joints.
        q: (N, K, D) joint angles [rad] or displacements [m].
        velocity: (N, K, D) joint velocities [rad/s] or [m/s].
        acceleration: (N, K, D) joint accelerations [rad/s²] or [m/s²].
        payload: (K,) point mass at the tip [kg].
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
        local_omega, local_alpha = (_product(rotation.swapaxes(-1, -2), vector) for vector in (omega, alpha))
        tensor = inertia[:, j]  # symmetric
        moment[:, :, j] = _product(rotation, local_alpha @ tensor + _cross(local_omega, local_omega @ tensor))
        before = frames.position[:, :, j]
    after = frames.tip
    total_force = payload[:, None] * (a + _relative(omega, alpha, after - before))  # (N, K, 3)
    total_moment = np.zeros((n, k, 3))  # about the next joint
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


@dataclass(frozen=True)
class Drives:
    """Torques and speeds of N arms along timed moves, at F moments: the samples and some between them."""

    moves: Moves
    timing: MoveTiming
    torques: Array  # (N, F, D) [N m], or forces [N]
    speeds: Array  # (N, F, D) [rad/s], or [m/s]

    def largest(self, along: Array, n_targets: int) -> Array:
        """Return the (N, T) largest of `along` (N, F) over the moves that end at a target; 0 without such moves."""
        return largest_of(self.moves, self.timing.first, np.zeros((len(along), n_targets)), along)


def drives_along(arms: ArmArrays, paths: Paths) -> Drives:
    """Compute torques and speeds of arms along their moves, each in its time."""
    timing = time_samples(paths.moves, paths.samples)
    starts, ends = (paths.samples.points[i] for i in (paths.samples.first[:-1], paths.samples.first[1:] - 1))
    line = (ends - starts)[paths.samples.move]
    torques, speeds = np.empty((2, len(arms), len(timing.sample), arms.dof))
    size = max(1, CHUNK // len(paths.samples))
    for first in range(0, len(arms), size):
        chunk = slice(first, first + size)
        torques[chunk], speeds[chunk] = _chunk_drives(arms[chunk], paths, chunk, line, timing)
    return Drives(paths.moves, timing, torques, speeds)


def _chunk_drives(arms: ArmArrays, paths: Paths, chunk: slice, line: Array, timing: MoveTiming) -> tuple[Array, Array]:
    """Return (N, F, D) torques and speeds of a chunk of arms; line: (S, 3) [m]."""
    q = paths.q[chunk]
    frames = forward_kinematics(arms, q)
    q_s, q_ss = _path_derivatives(arms, q, frames, line)
    push = _newton_euler(arms, frames, np.zeros(q_s.shape), q_s, paths.payload, 0.0)
    drag = _newton_euler(arms, frames, q_s, q_ss, paths.payload, 0.0)
    speed, acceleration = timing.speed[:, None], timing.acceleration[:, None]
    gravity = timing.between(paths.joint_torques[chunk])
    torques = gravity + timing.between(drag) * speed**2 + timing.between(push) * acceleration
    return torques, timing.between(q_s) * speed


def _path_derivatives(arms: ArmArrays, q: Array, frames: Frames, line: Array) -> tuple[Array, Array]:
    """Return q_s and q_ss (N, S, D), the derivatives of the joints by the fraction of the line.

    line: (S, 3) from its start to its end [m].  A joint at a limit that it would be driven beyond stays there.
    """
    jacobian, damping = jacobian_of(arms, frames), _damping(arms)
    q_s = _damped_least_squares(jacobian, line, damping)[0]
    blocked = ((q >= arms.upper[:, None]) & (q_s > 0.0)) | ((q <= arms.lower[:, None]) & (q_s < 0.0))
    free = np.where(blocked, 0.0, 1.0)[..., None, :]
    jacobian = jacobian * free
    q_s, y, inverse = _damped_least_squares(jacobian, line, damping)
    rate = jacobian_rate(arms, frames, q_s) * free
    # q_s = Jᵀ y with A y = line, A = J Jᵀ + damping; so q_ss = J_sᵀ y + Jᵀ y_s with A y_s = -A_s y
    first = _product(rate.swapaxes(-1, -2), y)  # J_sᵀ y
    change = _product(rate, q_s) + _product(jacobian, first)
    return q_s, first - _product(jacobian.swapaxes(-1, -2), _product(inverse, change))


def _damping(arms: ArmArrays) -> Array:
    """Return the (N,) damping on the diagonal of J Jᵀ [m²], by an arm's size: its length, and 1 m for slides."""
    size = np.hypot(arms.length + np.linalg.norm(arms.tool.tip, axis=1), arms.prismatic.any(axis=1))
    return (DAMPING * np.where(size > 0.0, size, 1.0)) ** 2  # an arm without size does not move its tip at all


def _damped_least_squares(jacobian: Array, line: Array, damping: Array) -> tuple[Array, Array, Array]:
    """Return the damped least-squares joint change Jᵀ y (N, S, D), y = A⁻¹ line (N, S, 3) and A⁻¹ (N, S, 3, 3)."""
    square = jacobian @ jacobian.swapaxes(-1, -2)
    inverse = cast("Array", np.linalg.inv(square + damping[:, None, None, None] * np.eye(3)))
    y = _product(inverse, line)
    return _product(jacobian.swapaxes(-1, -2), y), y, inverse


def _relative(omega: Array, alpha: Array, lever: Array) -> Array:
    """Return the acceleration of a point relative to another one of the same body [m/s²]."""
    return _cross(alpha, lever) + _cross(omega, _cross(omega, lever))


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
