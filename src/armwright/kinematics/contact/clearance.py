"""Clearance of posed arms from themselves and from obstacles: numpy in, numpy out."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.devices import Device, load_kernels
from armwright.tasks.obstacles import SHAPES, Obstacle

MAX_CHUNK: dict[Device, int] = {"cpu": 2**14, "cuda": 2**20}  # postures; on the CPU their links fit into a cache
SMALLEST_CHUNK = 256  # postures; smaller chunks cost a thread more time than they save


def clearances(
    arms: ArmArrays, q: Array, obstacles: Sequence[Obstacle] = (), device: Device = "cpu"
) -> tuple[Array, Array]:
    """Compute the self-clearance and the obstacle clearance of arms in postures.

    These are the smallest distances of two links that are not neighbours, and of a link from an obstacle. The bodies of
    actuators count as well, if the arms have them: from each other, from links that they do not join, and from
    obstacles. A column below the base counts as a part of the arm; its distance from obstacles is ignored. Clearances
    are negative for overlaps, and infinite without obstacles or links to compare. The tool is ignored, since it is made
    to touch.

    Args:
        arms: N arms of up to D joints.
        q: (N, T, D) joint angles [rad] or displacements [m].
        obstacles: The obstacles.
        device: The device to compute on.

    Returns:
        (N, T) self-clearance and (N, T) obstacle clearance [m].
    """
    wp, kernels = load_kernels("contact.clearance_kernels", device, arms.precision)
    n, t, _ = q.shape
    distances = np.full((2, n, t), np.inf)
    solids = _on_device(tuple(obstacles), arms.precision, device) if obstacles else None

    def measure(chunk: slice) -> None:
        distances[:, chunk] = _distances(arms[chunk], q[chunk], solids, wp, kernels, device)

    size = MAX_CHUNK[device] // t
    if device == "cpu":
        size = min(size, max(-(-n // 8), SMALLEST_CHUNK // t))
    in_chunks(measure, n, max(1, size), device)
    return distances[0], distances[1]


def straight_motor_clearance(arms: ArmArrays, device: Device = "cpu") -> Array:
    """Return the (N,) smallest distance of two motor bodies with all joints at 0, or at the limit nearest to it [m].

    Motors that overlap there leave no room for the link between their joints.
    """
    motors = replace(arms, radius=np.zeros_like(arms.radius), columns=None)  # links of radius 0 are ignored
    straight = np.clip(0.0, arms.lower, arms.upper)[:, None].astype(np.float64)
    return clearances(motors, straight, device=device)[0][:, 0]


def _distances(
    arms: ArmArrays, q: Array, solids: list[Any] | None, wp: Any, kernels: Any, device: Device
) -> NDArray[np.floating[Any]]:
    """Return the (2, N, T) clearances of a chunk of arms [m]."""

    def on_device(values: NDArray[Any], dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device, copy=False)

    real, vector, dim = kernels.real, kernels.Vector3, q.shape[:2]
    starts, ends = (wp.empty(q.shape, dtype=vector, device=device) for _ in range(2))
    offset = arms.offset.copy()
    offset[np.arange(len(arms)), arms.n_joints - 1] -= arms.tool.tip.astype(arms.precision)
    base, motion = on_device(arms.base, vector), on_device(arms.motion, wp.int32)
    posed = [base, motion, on_device(offset, vector), on_device(q.astype(arms.precision), real)]
    wp.launch(kernels.link_axes, dim, inputs=[*posed, starts, ends], device=device)
    self_clearance, obstacle_clearance = (on_device(np.full(dim, np.inf, dtype=arms.precision), real) for _ in range(2))
    links = [starts, ends, on_device(arms.radius, real)]
    wp.launch(kernels.self_clearance, dim, inputs=[motion, *links, self_clearance], device=device)
    if solids is not None:
        wp.launch(kernels.obstacle_clearance, dim, inputs=[*links, *solids, obstacle_clearance], device=device)
    placed: list[Any] | None = None
    if arms.motor_bodies is not None:
        _, motors = load_kernels("contact.motor_kernels", device, arms.precision)
        bodies = arms.motor_bodies
        shape, axis = on_device(bodies.shape, wp.int32), on_device(bodies.axis, wp.int32)
        half, centre = on_device(bodies.half, vector), on_device(bodies.centre, vector)
        middle, into = wp.empty(q.shape, vector, device=device), wp.empty(q.shape, kernels.Matrix3, device=device)
        wp.launch(motors.motor_frames, dim, inputs=[*posed, shape, axis, centre, middle, into], device=device)
        placed = [motion, shape, half, middle, into]
        wp.launch(motors.self_clearance, dim, inputs=[*placed, *links, self_clearance], device=device)
        if solids is not None:
            wp.launch(motors.obstacle_clearance, dim, inputs=[*placed, *solids, obstacle_clearance], device=device)
    if arms.columns is not None:
        _, column = load_kernels("contact.column_kernels", device, arms.precision)
        standing = [base, on_device(arms.columns.half, vector)]
        wp.launch(column.link_clearance, dim, inputs=[*standing, motion, *links, self_clearance], device=device)
        if placed is not None:
            wp.launch(column.motor_clearance, dim, inputs=[*standing, *placed, self_clearance], device=device)
    return np.stack([self_clearance.numpy(), obstacle_clearance.numpy()])


@cache
def _on_device(obstacles: tuple[Obstacle, ...], precision: Precision, device: Device) -> list[Any]:
    """Return shape, centre, rotation into its frame and half sides of each obstacle, as the kernel takes them."""
    wp, kernels = load_kernels("contact.clearance_kernels", device, precision)
    solids = [obstacle.solid for obstacle in obstacles]
    columns: list[tuple[Any, Any, Any]] = [
        ([SHAPES.index(solid.shape) for solid in solids], np.int32, wp.int32),
        ([solid.centre for solid in solids], precision, kernels.Vector3),
        ([solid.rotation.T for solid in solids], precision, kernels.Matrix3),
        ([solid.half for solid in solids], precision, kernels.Vector3),
    ]
    return [wp.array(np.array(values, dtype=kind), dtype=dtype, device=device) for values, kind, dtype in columns]
