"""What it takes to move arms: recursive Newton-Euler, in numpy and float64, and arms along timed straight lines.

Along a line a posture q(s) belongs to each share s of it, and s(t) is the same for all arms. So with s' = ds/dt

    torque(t) = gravity(s) + drag(s) s'² + push(s) s'',   push = M q_s,   drag = M q_ss + C(q, q_s) q_s

where gravity, drag and push are of the samples, whatever the time that a move takes (Bobrow et al. 1985).
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arm_arrays import FIXED, PRISMATIC, ArmArrays
from armwright.kinematics.forward import Frames, forward_kinematics
from armwright.kinematics.jacobian import jacobian_of, jacobian_rate
from armwright.kinematics.paths import Paths, largest_of
from armwright.robot.arm import GRAVITY
from armwright.tasks.moves import Moves, MoveTiming, time_samples

DAMPING = 0.005  # of an arm's size, docs/method.md §17
AT_ONCE = 2**12  # postures, whose arrays stay in a core's cache


def inverse_dynamics(
    arms: ArmArrays, q: Array, velocity: Array, acceleration: Array, payload: Array, gravity: float = GRAVITY
) -> Array:
    """(N, K, D) torques [N m], of sliding joints forces [N], that move N arms so in K postures; 0 of fixed joints.

    q, velocity, acceleration: (N, K, D) [rad] or [m], each second.  payload: (K,) a point mass at the tip [kg].
    gravity: along -z [m/s²].
    """
    return _newton_euler(arms, forward_kinematics(arms, q), velocity, acceleration, payload, gravity)


def _newton_euler(
    arms: ArmArrays, frames: Frames, velocity: Array, acceleration: Array, payload: Array, gravity: float
) -> Array:
    n, k, dof = velocity.shape
    bodies = arms.bodies
    mass, com, inertia = bodies.total_mass[..., None], bodies.total_com, bodies.inertia
    slides = ((arms.motion >= PRISMATIC) & (arms.motion < FIXED))[:, None, :, None]  # (N, 1, D, 1)
    along, rising = frames.axis * velocity[..., None], frames.axis * acceleration[..., None]  # (N, K, D, 3)
    turning, turning_faster = np.where(slides, 0.0, along), np.where(slides, 0.0, rising)
    sliding, sliding_faster = np.where(slides, along, 0.0), np.where(slides, rising, 0.0)
    spin, spin_rate = np.zeros((2, n, k, 3))  # of the link before [rad/s], [rad/s²]
    rate = np.zeros((n, k, 3))  # of its joint's place [m/s²]: in free fall the ground is pushed up
    rate[..., 2] = gravity
    force, moment = np.empty((2, n, k, dof, 3))  # on each link, about its centre of mass
    arm = np.empty((n, k, dof, 3))  # from the joint to that centre, in the world [m]
    before = frames.place[:, :, 0]
    for j in range(dof):
        away = frames.place[:, :, j] - before
        rate = rate + _swung(spin, spin_rate, away) + 2.0 * _cross(spin, sliding[:, :, j]) + sliding_faster[:, :, j]
        spin_rate = spin_rate + turning_faster[:, :, j] + _cross(spin, turning[:, :, j])
        spin = spin + turning[:, :, j]
        rotation = frames.rotation[:, :, j]
        arm[:, :, j] = _turned(rotation, com[:, None, j])
        force[:, :, j] = mass[:, None, j] * (rate + _swung(spin, spin_rate, arm[:, :, j]))
        own, own_rate = _turned(rotation.swapaxes(-1, -2), spin), _turned(rotation.swapaxes(-1, -2), spin_rate)
        tensor = inertia[:, j]  # symmetric
        moment[:, :, j] = _turned(rotation, own_rate @ tensor + _cross(own, own @ tensor))
        before = frames.place[:, :, j]
    ahead = frames.tip
    pull = payload[:, None] * (rate + _swung(spin, spin_rate, ahead - before))  # (N, K, 3)
    twist = np.zeros((n, k, 3))  # about the place ahead
    torques = np.empty((n, k, dof))
    for j in reversed(range(dof)):
        place = frames.place[:, :, j]
        twist = twist + _cross(ahead - place, pull) + moment[:, :, j] + _cross(arm[:, :, j], force[:, :, j])
        pull = pull + force[:, :, j]
        torques[:, :, j] = (frames.axis[:, :, j] * np.where(slides[:, :, j], pull, twist)).sum(axis=-1)
        ahead = place
    return torques


@dataclass(frozen=True)
class Drives:
    """What the joints of N arms do along timed moves, at F moments, those of the samples and some between."""

    moves: Moves
    timing: MoveTiming
    torques: Array  # (N, F, D) [N m], or forces [N]
    speeds: Array  # (N, F, D) [rad/s], or [m/s]

    def largest(self, along: Array, n_targets: int) -> Array:
        """(N, T) of `along` (N, F), over the moves that end at a target; 0 where none does."""
        return largest_of(self.moves, self.timing.first, np.zeros((len(along), n_targets)), along)


def driven(arms: ArmArrays, paths: Paths) -> Drives:
    """The arms along their moves, each in its time."""
    timing = time_samples(paths.moves, paths.samples)
    starts, ends = (paths.samples.points[places] for places in (paths.samples.first[:-1], paths.samples.first[1:] - 1))
    line = (ends - starts)[paths.samples.move]
    torques, speeds = np.empty((2, len(arms), len(timing.sample), arms.dof))
    size = max(1, AT_ONCE // len(paths.samples))
    for first in range(0, len(arms), size):
        some = slice(first, first + size)
        torques[some], speeds[some] = _driven(arms[some], paths, some, line, timing)
    return Drives(paths.moves, timing, torques, speeds)


def _driven(arms: ArmArrays, paths: Paths, rows: slice, line: Array, timing: MoveTiming) -> tuple[Array, Array]:
    """(N, F, D) torques and speeds of the arms in these rows of the paths; line: (S, 3) [m]."""
    q = paths.q[rows]
    frames = forward_kinematics(arms, q)
    way, bend = _course(arms, q, frames, line)
    push = _newton_euler(arms, frames, np.zeros(way.shape), way, paths.payload, 0.0)
    drag = _newton_euler(arms, frames, way, bend, paths.payload, 0.0)
    speed, faster = timing.speed[:, None], timing.acceleration[:, None]
    torques = (
        timing.between(paths.joint_torques[rows]) + timing.between(drag) * speed**2 + timing.between(push) * faster
    )
    return torques, timing.between(way) * speed


def _course(arms: ArmArrays, q: Array, frames: Frames, line: Array) -> tuple[Array, Array]:
    """(N, S, D) how joints change with the share of the line, and how that changes with it.

    line: (S, 3) from its start to its end [m].  A joint at a limit that it would be driven beyond stays there.
    """
    jacobian, damping = jacobian_of(arms, frames), _damping(arms)
    way = _least(jacobian, line, damping)[0]
    stuck = ((q >= arms.upper[:, None]) & (way > 0.0)) | ((q <= arms.lower[:, None]) & (way < 0.0))
    free = np.where(stuck, 0.0, 1.0)[..., None, :]
    jacobian = jacobian * free
    way, weight, inverse = _least(jacobian, line, damping)
    rate = jacobian_rate(arms, frames, way) * free
    # q_s = Jᵀ y with A y = line, A = J Jᵀ + damping; so q_ss = J_sᵀ y + Jᵀ y_s with A y_s = -A_s y
    pulled = _turned(rate.swapaxes(-1, -2), weight)  # J_sᵀ y
    change = _turned(rate, way) + _turned(jacobian, pulled)
    return way, pulled - _turned(jacobian.swapaxes(-1, -2), _turned(inverse, change))


def _damping(arms: ArmArrays) -> Array:
    """(N,) what is added to the diagonal of J Jᵀ [m²], by an arm's size: it turns links, and slides by metres."""
    long = arms.length + np.linalg.norm(arms.tool, axis=1)
    slides = ((arms.motion >= PRISMATIC) & (arms.motion < FIXED)).any(axis=1)
    size = np.hypot(long, slides)
    return (DAMPING * np.where(size > 0.0, size, 1.0)) ** 2  # one without size does not move its tip at all


def _least(jacobian: Array, line: Array, damping: Array) -> tuple[Array, Array, Array]:
    """Of the smallest change of joints that moves the tip so: itself (N, S, D), y (N, S, 3), A⁻¹ (N, S, 3, 3)."""
    square = jacobian @ jacobian.swapaxes(-1, -2)
    inverse = cast("Array", np.linalg.inv(square + damping[:, None, None, None] * np.eye(3)))
    weight = _turned(inverse, line)
    return _turned(jacobian.swapaxes(-1, -2), weight), weight, inverse


def _swung(spin: Array, spin_rate: Array, away: Array) -> Array:
    """The acceleration of a point against another of the same body [m/s²]."""
    return _cross(spin_rate, away) + _cross(spin, _cross(spin, away))


def _turned(matrix: Array, vector: Array) -> Array:
    """(..., R, C) times (..., C): column by column, in half the time of as many small products."""
    found = matrix[..., 0] * vector[..., :1]
    for column in range(1, vector.shape[-1]):
        found += matrix[..., column] * vector[..., column : column + 1]
    return found


def _cross(a: Array, b: Array) -> Array:
    """As np.cross, in less time."""
    found = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return found
