"""How far posed arms are from themselves and from obstacles: numpy in, numpy out."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.kinematics.arm_arrays import ArmArrays, Precision
from armwright.kinematics.devices import Device, load_clearance
from armwright.kinematics.ik import in_threads
from armwright.tasks.obstacles import SHAPES, Obstacle

LARGEST_CHUNK = 2**14  # postures at a time, whose links fit into a core's cache; on a GPU, so many times GPU_CHUNKS
SMALLEST_CHUNK = 256  # postures; below it a thread costs more than it brings
GPU_CHUNKS = 64


def clearances(
    arms: ArmArrays, q: NDArray[np.float64], obstacles: Sequence[Obstacle] = (), device: Device = "cpu"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far N arms in T postures are from themselves, and from obstacles: (N, T) each [m].

    That is the smallest distance of two links that are not neighbours, and of a link from an obstacle; below 0 where
    one is in the other, infinite where there is nothing to hit.
    The tool does not count: it is there to touch. q: (N, T, D) joint angles [rad], or ways [m].
    """
    wp, kernels = load_clearance(arms.precision, device)
    n, t, _ = q.shape
    found = np.full((2, n, t), np.inf)
    solids = _on_device(tuple(obstacles), arms.precision, device) if obstacles else None

    def measure(rows: slice) -> None:
        found[:, rows] = _measured(arms[rows], q[rows], solids, wp, kernels, device)

    if device == "cuda":
        size = max(1, GPU_CHUNKS * LARGEST_CHUNK // t)
        for first in range(0, n, size):
            measure(slice(first, first + size))
    else:
        in_threads(measure, n, max(1, min(LARGEST_CHUNK // t, max(-(-n // 8), SMALLEST_CHUNK // t))))
    return found[0], found[1]


def _measured(
    arms: ArmArrays, q: NDArray[np.float64], solids: list[Any] | None, wp: Any, kernels: Any, device: Device
) -> NDArray[np.floating[Any]]:
    """(2, n, T) [m]."""

    def given(values: NDArray[Any], dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device, copy=False)

    real, vector, dim = kernels.real, kernels.Vector3, q.shape[:2]
    starts, ends = (wp.empty(q.shape, dtype=vector, device=device) for _ in range(2))
    offset = arms.offset.copy()
    offset[np.arange(len(arms)), arms.n_joints - 1] -= arms.tool.astype(arms.precision)
    motion = given(arms.motion, wp.int32)
    posed = [given(arms.base, vector), motion, given(offset, vector)]
    posed.append(given(q.astype(arms.precision), real))
    wp.launch(kernels.place, dim, inputs=[*posed, starts, ends], device=device)
    apart, clear = (given(np.full(dim, np.inf, dtype=arms.precision), real) for _ in range(2))
    links = [starts, ends, given(arms.radius, real)]
    wp.launch(kernels.part, dim, inputs=[motion, *links, apart], device=device)
    if solids is not None:
        wp.launch(kernels.clear, dim, inputs=[*links, *solids, clear], device=device)
    return np.stack([apart.numpy(), clear.numpy()])


@cache
def _on_device(obstacles: tuple[Obstacle, ...], precision: Precision, device: Device) -> list[Any]:
    """Shape, centre, rotation into its frame and half sides of each, as the kernel takes them."""
    wp, kernels = load_clearance(precision, device)
    solids = [obstacle.solid for obstacle in obstacles]
    columns: list[tuple[Any, Any, Any]] = [
        ([SHAPES.index(solid.shape) for solid in solids], np.int32, wp.int32),
        ([solid.centre for solid in solids], precision, kernels.Vector3),
        ([solid.rotation.T for solid in solids], precision, kernels.Matrix3),
        ([solid.half for solid in solids], precision, kernels.Vector3),
    ]
    return [wp.array(np.array(values, dtype=kind), dtype=dtype, device=device) for values, kind, dtype in columns]
