"""Arms along the lines of a cycle, from given postures, and how far off they are."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.devices import Device, load_kernels
from armwright.tasks.motions import LineSamples, Poses

IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class BlockPaths:
    """N arms along the S samples of all blocks, from K candidates."""

    q: Array  # (N, K, S, D) joint values [rad] or [m]
    position_error: Array  # (N, K, S) distance of the tip from its sample [m]
    angle_error: Array  # (N, K, S) angle of the tool from its sample [rad]

    def choose(self, samples: LineSamples, choice: IndexArray, arms: IndexArray) -> Array:
        """Return the (n, S, D) joint values of some arms (n,) from one candidate per block; choice: (N, B)."""
        of_sample = np.repeat(choice[arms], np.diff(samples.first), axis=1)  # (n, S)
        return self.q[arms[:, None], of_sample, np.arange(len(samples.poses))]

    def ends(self, samples: LineSamples) -> tuple[Array, Array]:
        """Return the (N, B, K, D) first and last postures of each block."""
        first, last = samples.first[:-1], samples.first[1:] - 1
        return self.q[:, :, first].swapaxes(1, 2), self.q[:, :, last].swapaxes(1, 2)


def follow_lines(arms: ArmArrays, samples: LineSamples, entry: Array, device: Device = "cpu") -> BlockPaths:
    """Follow all lines from the candidates of each block.

    Args:
        arms: N arms.
        samples: S samples in B blocks.
        entry: (N, B, K, D) postures at the first sample of each block.
        device: The device to solve on.
    """
    wp, kernels = load_kernels("cycle.path_kernels", device)
    n, b, k, dof = entry.shape
    s = len(samples.poses)
    paths = BlockPaths(np.empty((n, k, s, dof)), np.empty((n, k, s)), np.empty((n, k, s)))

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        path = _on_device(part, samples.poses, samples.first, wp, kernels, device)
        start = _array(entry[chunk].reshape(len(part), b * k, dof), kernels.real, wp, device)
        results = [wp.empty((len(part), *v.shape[1:]), dtype=kernels.real, device=device) for v in vars(paths).values()]
        wp.launch(kernels.follow, (len(part), b * k), inputs=[path, start, *results], device=device)
        for values, result in zip(vars(paths).values(), results, strict=True):
            values[chunk] = result.numpy()

    in_chunks(solve, n, max(1, SAMPLES[device] // (s * k)), device)
    return paths


def tool_errors(arms: ArmArrays, poses: Poses, q: Array, device: Device = "cpu") -> Array:
    """Return (N, S, 2) distance of the tip [m] and angle of the tool [rad] from poses; q: (N, S, D)."""
    wp, kernels = load_kernels("cycle.path_kernels", device)
    errors = np.empty((*q.shape[:2], 2))

    def solve(chunk: slice) -> None:
        part = arms[chunk]
        path = _on_device(part, poses, np.array([0, len(poses)]), wp, kernels, device)
        found = wp.empty((len(part), len(poses), 2), dtype=kernels.real, device=device)
        inputs = [path, _array(q[chunk], kernels.real, wp, device), found]
        wp.launch(kernels.tool_errors, (len(part), len(poses)), inputs=inputs, device=device)
        errors[chunk] = found.numpy()

    in_chunks(solve, len(arms), max(1, SAMPLES[device] // len(poses)), device)
    return errors


def _on_device(arms: ArmArrays, poses: Poses, first: IndexArray, wp: Any, kernels: Any, device: Device) -> Any:
    """Return arms and poses as the kernels take them; first: (B + 1,) index of each block's first pose."""
    values: dict[str, Any] = {
        name: getattr(arms, name).astype(np.float64)
        for name in ("base", "lower", "upper", "offset", "tool_axis", "tool_side")
    }
    values |= {"motion": arms.motion, "first": first.astype(np.int32)}
    values |= {"n_angular": poses.n_angular.astype(np.int32), "position": poses.position}
    values |= {axis: poses.rotation[:, :, i] for i, axis in enumerate("xyz")}
    path = kernels.Path()
    path.dof = arms.dof
    for name, array in values.items():
        setattr(path, name, _array(array, kernels.Path.vars[name].type.dtype, wp, device))
    return path


def _array(values: NDArray[Any], dtype: Any, wp: Any, device: Device) -> Any:
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device, copy=False)
