"""The inverse kinematics of docs/method.md §2 for axes and orientations in plain float64 numpy.

Written from the text, apart from the kernels on purpose: rotation vectors by the world's axes and Rodrigues' formula,
where the kernels go by way of quaternions in the tool's frame. Shapes as in tests/support/reference_kinematics.py.
"""

import numpy as np

from armwright.tasks.targets import AXIS, TargetArrays
from tests.support import reference_kinematics as reference
from tests.support.reference_kinematics import Array, Chains

MAX_TURN = 0.5  # [rad]


def tool(arms: Chains, q: Array, axis: Array, side: Array) -> Array:
    """(N, T, 3, 3) the tool's x, y, z in the world, as columns. axis, side: (N, 3) its z and x at zero."""
    last = reference.frames(arms, q)[0][..., -1, :, :]
    at_zero = np.stack([side, np.cross(axis, side), axis], axis=-1)  # (N, 3, 3)
    return last @ at_zero[:, None]


def angular_jacobian(arms: Chains, q: Array) -> Array:
    """(N, T, 3, D) the angular velocity of the tool in the world by joint speeds: the joints' axes."""
    rotation, _, _ = reference.frames(arms, q)
    axis = np.einsum("...jab,...jb->...ja", rotation, np.broadcast_to(arms.axis, rotation.shape[:-1]))
    return np.swapaxes(axis[..., list(arms.moving), :], -1, -2)


def rotation_vector(matrix: Array) -> Array:
    """(..., 3) the axis of a rotation times its angle [rad]; of half a turn, one of the two."""
    skew = np.stack([matrix[..., 2, 1] - matrix[..., 1, 2], matrix[..., 0, 2] - matrix[..., 2, 0],
                     matrix[..., 1, 0] - matrix[..., 0, 1]], axis=-1) / 2  # fmt: skip
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, (np.trace(matrix, axis1=-2, axis2=-1) - 1) / 2)
    return skew * (angle / np.where(sine > 0.0, sine, 1.0))[..., None]


def turn_left(frame: Array, target_arrays: TargetArrays) -> Array:
    """(N, T, 3) the rotation in the world that is left to do [rad]; 0 of a point."""
    whole = rotation_vector(target_arrays.rotation @ np.swapaxes(frame, -1, -2))
    z, wanted = frame[..., :, 2], np.broadcast_to(target_arrays.rotation[..., :, 2], frame[..., :, 2].shape)
    across = np.cross(z, wanted)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, (z * wanted).sum(axis=-1))
    shortest = across * (angle / np.where(sine > 0.0, sine, 1.0))[..., None]
    rows = target_arrays.n_angular[..., None]
    return np.where(rows == 0, 0.0, np.where(rows == AXIS, shortest, whole))


def update(
    arms: Chains, targets: Array, target_arrays: TargetArrays, axis: Array, side: Array, q: Array, h_before: Array
) -> tuple[Array, Array]:
    """(q, H) after one update, target by target with as many rows as it has."""
    after, gradient = np.empty_like(q), np.empty_like(q)
    frame, e = tool(arms, q, axis, side), reference.short(targets - reference.tip(arms, q), reference.MAX_STEP)
    turn = np.einsum("...ba,...b->...a", frame, turn_left(frame, target_arrays))  # in the tool's own frame
    turn = reference.short(turn, MAX_TURN)
    linear = reference.jacobian(arms, q)
    angular = np.einsum("...ba,...bd->...ad", frame, angular_jacobian(arms, q))
    for t, rows in enumerate(target_arrays.n_angular):
        at = slice(t, t + 1)
        J = np.concatenate([linear[:, at], angular[:, at, :rows]], axis=-2)
        dx = np.concatenate([e[:, at], turn[:, at, :rows]], axis=-1)
        after[:, at], gradient[:, at] = reference.damped_step(arms, q[:, at], h_before[:, at], J, dx)
    return after, gradient


def solve(
    arms: Chains, targets: Array, target_arrays: TargetArrays, axis: Array, side: Array, updates: int, start: Array
) -> tuple[Array, Array, Array]:
    """(q, distance, angle) of the earliest posture with the least distance² + (trade x angle)². targets: (T, 3)."""
    q, h = start, np.full(start.shape, np.inf)
    kept, least = q, np.full(start.shape[:2], np.inf)
    for update_number in range(updates + 1):
        if update_number:
            q, h = update(arms, targets, target_arrays, axis, side, q, h)
        distance, angle = errors(arms, targets, target_arrays, axis, side, q)
        far = distance**2 + (target_arrays.metres_per_radian * angle) ** 2
        kept = np.where((far < least)[..., None], q, kept)
        least = np.minimum(far, least)
    return kept, *errors(arms, targets, target_arrays, axis, side, kept)


def errors(
    arms: Chains, targets: Array, target_arrays: TargetArrays, axis: Array, side: Array, q: Array
) -> tuple[Array, Array]:
    """(N, T) distance [m] and angle [rad] from the targets."""
    angle = np.linalg.norm(turn_left(tool(arms, q, axis, side), target_arrays), axis=-1)
    return np.linalg.norm(targets - reference.tip(arms, q), axis=-1), angle
