"""The physics of docs/method.md in plain float64 numpy, as a reference for the kernels.

Written from the text, with the matrices as they stand there: slow, plain, and apart from the kernels on
purpose. Everything is batched: N arms at T targets, so q is (N, T, D) for D moving joints. A fixed joint
stays in the chain as a joint that turns by nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.robot.arm import Arm

Array = NDArray[np.float64]

UPDATES = 100
MAX_STEP = 0.1  # [m]
MANIPULABILITY_LIMIT = 0.1  # [m³]
DAMPING = 0.001  # [m²]
DEGREE = np.pi / 180.0  # [rad]
CENTRING_GAIN = 0.01
GRAVITY = 9.81  # [m/s²] along -z


@dataclass(frozen=True)
class Chains:
    """N arms of J joints, D of which move."""

    base: Array  # (N, 1, 3) [m]
    axis: Array  # (N, 1, J, 3) unit vectors in the joint's own frame
    offset: Array  # (N, 1, J, 3) [m]
    com: Array  # (N, 1, J, 3) [m]
    mass: Array  # (N, 1, J) [kg]
    lower: Array  # (N, 1, D) [rad]
    upper: Array  # (N, 1, D) [rad]
    moving: tuple[int, ...]  # (D,)

    def __getitem__(self, rows: slice) -> "Chains":
        arrays = (self.base, self.axis, self.offset, self.com, self.mass, self.lower, self.upper)
        return Chains(*(array[rows] for array in arrays), moving=self.moving)


@dataclass(frozen=True)
class Solution:
    """The kept postures, and the errors of the start and of every update."""

    q: Array  # (N, T, D) [rad]
    reached: Array  # (N, T, 3) [m]
    error: Array  # (N, T) [m]
    torque: Array  # (N, T, D) [N m]


def chains(arms: Sequence[Arm]) -> Chains:
    """Arms with the same joints fixed, as arrays."""
    moving = tuple(j for j, joint in enumerate(arms[0].joints) if joint.kind == "revolute")
    unit = dict(zip("xyz", np.eye(3), strict=True))
    return Chains(
        base=np.array([[arm.base] for arm in arms]),
        axis=np.array([[[unit[joint.axis] for joint in arm.joints]] for arm in arms]),
        offset=np.array([[[link.offset for link in arm.links]] for arm in arms]),
        com=np.array([[[link.com for link in arm.links]] for arm in arms]),
        mass=np.array([[[link.mass for link in arm.links]] for arm in arms]),
        lower=np.array([[[arm.joints[j].lower for j in moving]] for arm in arms]),
        upper=np.array([[[arm.joints[j].upper for j in moving]] for arm in arms]),
        moving=moving,
    )


def frames(arms: Chains, q: Array) -> tuple[Array, Array, Array]:
    """Rotations (N, T, J, 3, 3) of the links to the world, places (N, T, J, 3) of the joints, tip (N, T, 3)."""
    angles = np.zeros((*q.shape[:-1], arms.axis.shape[2]))
    angles[..., list(arms.moving)] = q
    place = np.broadcast_to(arms.base, (*q.shape[:-1], 3))
    rotation = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
    rotations, places = [], []
    for j in range(angles.shape[-1]):
        rotation = rotation @ _rodrigues(arms.axis[:, :, j], angles[..., j])
        rotations.append(rotation)
        places.append(place)
        place = place + np.einsum("...ab,...b->...a", rotation, arms.offset[:, :, j])
    return np.stack(rotations, axis=-3), np.stack(places, axis=-2), place


def tip(arms: Chains, q: Array) -> Array:
    """(N, T, 3) p(q) [m]."""
    return frames(arms, q)[2]


def jacobian(arms: Chains, q: Array) -> Array:
    """(N, T, 3, D) dp/dq [m/rad]: the axis crossed with the lever from the joint to the tip."""
    rotation, place, end = frames(arms, q)
    axis = np.einsum("...jab,...jb->...ja", rotation, np.broadcast_to(arms.axis, rotation.shape[:-1]))
    columns = np.cross(axis, end[..., None, :] - place)
    return np.swapaxes(columns[..., list(arms.moving), :], -1, -2)


def manipulability(arms: Chains, q: Array) -> Array:
    """(N, T) m = sqrt(max(0, det(J Jᵀ))) [m³]."""
    J = jacobian(arms, q)
    return np.sqrt(np.maximum(0.0, np.linalg.det(J @ np.swapaxes(J, -1, -2))))


def limit_gradient(arms: Chains, q: Array) -> Array:
    """(N, T, D) H_i."""
    low, high = arms.lower, arms.upper
    inside = np.clip(q, low + DEGREE, high - DEGREE)
    return np.abs((high - low) ** 2 * (2 * inside - high - low) / (4 * (high - inside) ** 2 * (inside - low) ** 2))


def short(vector: Array, longest: float) -> Array:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.where(length > longest, longest * vector / np.maximum(length, longest), vector)


def damped_step(arms: Chains, q: Array, h_before: Array, J: Array, dx: Array) -> tuple[Array, Array]:
    """(q, H) after a step dx (N, T, R) by the weighted, damped inverse of J (N, T, R, D), and centring."""
    Jt = np.swapaxes(J, -1, -2)
    m = np.sqrt(np.maximum(0.0, np.linalg.det(J @ Jt)))
    k = np.where(m < MANIPULABILITY_LIMIT, DAMPING * (1 - m / MANIPULABILITY_LIMIT) ** 2, 0.0)
    h = limit_gradient(arms, q)
    w = np.where(h >= h_before, 1 / (1 + h), 1.0)
    middle, half_range = (arms.upper + arms.lower) / 2, (arms.upper - arms.lower) / 2
    y = CENTRING_GAIN * w * np.sign(middle - q) * ((middle - q) / half_range) ** 2
    W = w[..., :, None] * np.eye(q.shape[-1])
    J_sharp = W @ Jt @ np.linalg.inv(J @ W @ Jt + k[..., None, None] * np.eye(dx.shape[-1]))
    null = np.eye(q.shape[-1]) - J_sharp @ J
    dq = np.einsum("...da,...a->...d", J_sharp, dx) + np.einsum("...dc,...c->...d", null, y)
    return np.clip(q + dq, arms.lower, arms.upper), h


def update(arms: Chains, targets: Array, q: Array, h_before: Array) -> tuple[Array, Array]:
    """(q, H) after one update; targets (T, 3) or (N, T, 3) [m]."""
    return damped_step(arms, q, h_before, jacobian(arms, q), short(targets - tip(arms, q), MAX_STEP))


def solve(arms: Chains, targets: Array, updates: int = UPDATES, start: Array | None = None) -> Solution:
    """Of the start (q = 0 if not given) and all results the earliest with the smallest error. targets (T, 3) [m]."""
    shape = (len(arms.base), len(targets), len(arms.moving))
    q, h = np.zeros(shape) + (0.0 if start is None else start), np.full(shape, np.inf)
    kept, least = q, np.linalg.norm(targets - tip(arms, q), axis=-1)
    for _ in range(updates):
        q, h = update(arms, targets, q, h)
        error = np.linalg.norm(targets - tip(arms, q), axis=-1)
        better = error < least
        kept = np.where(better[..., None], q, kept)
        least = np.where(better, error, least)
    return Solution(q=kept, reached=tip(arms, kept), error=least, torque=gravity_torque(arms, kept))


def random_states(chains: Chains, seed: int) -> tuple[Array, Array, Array]:
    """q, H before and targets, all (N, 1, ...) and exact in float32.

    H before is 0 to 0.9 or 1.1 to 3 times the present H: the branch H >= H before is never a matter of rounding.
    """
    rng = np.random.default_rng(seed)
    q = np.float64(np.float32(rng.uniform(chains.lower, chains.upper)))
    factor = np.where(rng.random(q.shape) < 0.5, rng.uniform(0.0, 0.9, q.shape), rng.uniform(1.1, 3.0, q.shape))
    h_before = np.float64(np.float32(limit_gradient(chains, q) * factor))
    targets = np.float64(np.float32(chains.base + rng.uniform(-1.0, 1.0, (*q.shape[:2], 3))))
    return q, h_before, targets


def gravity_torque(arms: Chains, q: Array) -> Array:
    """(N, T, D) +dV/dq [N m]: Σ over the links of J_comᵀ (m g ẑ); it holds the posture, gravity exerts minus it."""
    rotation, place, _ = frames(arms, q)
    com = place + np.einsum("...jab,...jb->...ja", rotation, np.broadcast_to(arms.com, place.shape))
    axis = np.einsum("...jab,...jb->...ja", rotation, np.broadcast_to(arms.axis, place.shape))
    n = axis.shape[-2]
    lever = com[..., None, :, :] - place[..., :, None, :]  # (N, T, joint, link, 3)
    rise = np.cross(np.broadcast_to(axis[..., :, None, :], lever.shape), lever)[..., 2]  # (N, T, joint, link)
    carried = np.triu(np.ones((n, n)))  # joint j moves link j and all that follows
    torque = GRAVITY * np.einsum("...jl,jl,...l->...j", rise, carried, np.broadcast_to(arms.mass, rise.shape[:-1]))
    return torque[..., list(arms.moving)]


def _rodrigues(axis: Array, angle: Array) -> Array:
    """I + sin K + (1 - cos) K², K the cross-product matrix of the axis."""
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)
