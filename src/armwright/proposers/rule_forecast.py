"""Closed-form forecast of position error and torque, without inverse kinematics.

The arm is taken as a chain that bends from its first joint across the arm, the pivot, and has its mass halfway to the
target. That is exact for a stretched arm whose first two axes stand at right angles; for arms that fold, the torque is
within about 10 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import PRISMATIC, carrying
from armwright.problem.objectives import TORQUE_SCALE
from armwright.problem.problem import Problem
from armwright.robot.arm import GRAVITY
from armwright.spaces.parameters import Design

LEFT = 0.01  # position error that the inverse kinematics leaves at a target [m]
BULGE = 0.12  # square of the lever of a folded arm's links beside the line to the target, relative to its length
SMALL = 1e-9
AXES = np.vstack([np.eye(3), np.zeros((4, 3))])  # by motion; zero for joints that do not turn


@dataclass(frozen=True)
class Forecast:
    """Forecast of N designs."""

    error: Array  # (N,) position error beyond stated tolerances, summed over the targets [m]
    torque: Array  # (N,) torque, summed over the targets [α-scaled]
    length: Array  # (N,) from pivot to tip [m]


def forecast(problem: Problem, designs: Sequence[Design]) -> Forecast:
    """Forecast position error and torque of designs in the first case of a problem."""
    scene = problem.scenes[0]
    axis, pivot, length, moment, payload_lever = _stretched(problem, designs)
    to_target = scene.targets - pivot[:, None]  # (N, T, 3)
    distance = np.maximum(np.linalg.norm(to_target, axis=-1), SMALL)  # (N, T)
    stretch = np.minimum(distance / np.maximum(length, SMALL)[:, None], 1.0)  # (N, T)
    share = gravity_share(axis[:, None], to_target / distance[..., None])
    moment = moment[:, None] + scene.payload * payload_lever[:, None]  # (N, T) of the stretched, level arm
    lever = np.sqrt((share * stretch) ** 2 + BULGE * (1.0 - stretch**2))
    error = np.maximum(distance - length[:, None], 0.0) + LEFT
    error = np.maximum(error - scene.target_arrays.stated_tolerance, 0.0)
    return Forecast(error.sum(axis=1), TORQUE_SCALE * GRAVITY * (moment * lever).sum(axis=1), length)


def gravity_share(axis: Array, direction: Array) -> Array:
    """Return the share of the gravity moment of a straight level arm that its joints carry, as a norm.

    A joint carries the part along its own axis. The first axis is given; the second, moved by the first joint, stands
    across both the first axis and the arm. Where it comes to stand vertical, it carries nothing.

    Args:
        axis: (..., 3) unit vector of the first axis.
        direction: (..., 3) unit vector of the arm.
    """
    moment = np.cross(direction, (0.0, 0.0, -1.0))
    second = np.cross(axis, direction)
    second /= np.maximum(np.linalg.norm(second, axis=-1, keepdims=True), SMALL)
    return np.hypot((moment * axis).sum(axis=-1), (moment * second).sum(axis=-1))


def _stretched(problem: Problem, designs: Sequence[Design]) -> tuple[Array, Array, Array, Array, Array]:
    """Return first axis and pivot (N, 3), and (N,) length from there, first moment of mass and lever of the payload.

    All but the axis are in metres, kilograms and their products.
    """
    arms = problem.arms(problem.space.matrix(designs))
    rows = np.arange(len(arms))
    ends = arms.base[:, None] + np.cumsum(arms.offset, axis=1)  # (N, D, 3)
    places = np.concatenate([arms.base[:, None], ends], axis=1).astype(np.float64)  # (N, D + 1, 3) joints and tip
    up = places[:, -1] - places[:, 0]
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), SMALL)
    axes = AXES[arms.motion]  # (N, D, 3)
    turns = arms.motion < PRISMATIC
    bends = turns & (np.abs(np.einsum("njk,nk->nj", axes, up)) < 0.5)
    first = np.where(bends.any(axis=1), bends.argmax(axis=1), arms.dof)  # (N,) the pivot's joint
    pivot = places[rows, first]
    carried = np.where(np.arange(arms.dof) >= first[:, None], arms.mass, 0.0)  # (N, D)
    lever = np.einsum("njk,nk->nj", places[:, :-1] + arms.com - pivot[:, None], up)
    length = np.linalg.norm(places[:, -1] - pivot, axis=1)
    moment = (carried * lever).sum(axis=1)
    payload_lever = length + np.einsum("nk,nk->n", carrying(arms, problem.task.load_shape).payload_center, up)
    return axes[rows, turns.argmax(axis=1)], pivot, length, moment, payload_lever


def gains(front: Array, values: Array, reference_point: Sequence[float]) -> Array:
    """Return the hypervolume (N,) that each of N points would add to a front by itself.

    Args:
        front: (F, 2) non-dominated objectives.
        values: (N, 2) objectives.
        reference_point: bounds the hypervolume.
    """
    corner = np.array(reference_point)
    inside = front[np.all(front < corner, axis=1)]
    inside = inside[np.argsort(inside[:, 0])]
    edges = np.concatenate([[-np.inf], inside[:, 0], corner[:1]])  # of the steps
    heights = np.concatenate([corner[1:], inside[:, 1]])
    width = np.maximum(edges[1:] - np.maximum(edges[:-1], values[:, :1]), 0.0)  # (N, F + 1)
    return (width * np.maximum(heights - values[:, 1:], 0.0)).sum(axis=1)
