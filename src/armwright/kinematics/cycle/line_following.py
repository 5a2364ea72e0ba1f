"""Arms along the lines of a cycle, from given postures, and how far off they are."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.chunks import SAMPLES, in_chunks
from armwright.kinematics.cycle.costs import joint_speeds
from armwright.kinematics.devices import Device, Loaded, load_kernels
from armwright.tasks.motions import LineSamples, single_samples
from armwright.tasks.poses import Poses

IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class BlockPaths:
    """N arms along the S samples of all blocks, from K candidates."""

    q: Array  # (N, K, S, D) joint values [rad] or [m]
    off: Array  # (N, B, K) largest distance or angle of the tool from its sample, relative to the tolerance
    cost: Array  # (N, B, K) least time along the lines, what they are off by, and what may jump

    def choose(self, samples: LineSamples, choice: IndexArray, arms: IndexArray) -> Array:
        """Return the (n, S, D) joint values of some arms (n,) from one candidate per block; choice: (N, B)."""
        of_sample = np.repeat(choice[arms], np.diff(samples.first), axis=1)  # (n, S)
        return self.q[arms[:, None], of_sample, np.arange(len(samples.poses))]

    def ends(self, samples: LineSamples) -> tuple[Array, Array]:
        """Return the (N, B, K, D) first and last postures of each block."""
        return self.q[:, :, samples.first[:-1]].swapaxes(1, 2), self.q[:, :, samples.end].swapaxes(1, 2)


def follow_lines(
    arms: ArmArrays, samples: LineSamples, entry: Array, device: Device = "cpu", aside_by: float = 0.0
) -> BlockPaths:
    """Follow all lines of N arms from `entry`: (N, B, K, D) candidate postures at the first sample of each block.

    aside_by: share of the joints' ranges by which random self-motions at each sample move them.
    """
    loaded = load_kernels("cycle.path_kernels", device)
    n, b, k, dof = entry.shape
    s = len(samples.poses)
    paths = BlockPaths(np.empty((n, k, s, dof)), np.empty((n, b, k)), np.empty((n, b, k)))

    def solve(chunk: slice) -> None:
        start, found = entry[chunk].reshape(-1, b * k, dof), [values[chunk] for values in vars(paths).values()]
        loaded.launch("follow", start.shape[:2], _path(arms[chunk], samples, loaded), start, aside_by, outputs=found)

    in_chunks(solve, n, max(1, SAMPLES[device] // (s * k)), device)
    return paths


def tool_errors(arms: ArmArrays, poses: Poses, q: Array, device: Device = "cpu") -> Array:
    """Return (N, S, 2) distance of the tip [m] and angle of the tool [rad] from poses; q: (N, S, D)."""
    loaded = load_kernels("cycle.path_kernels", device)
    errors = np.empty((*q.shape[:2], 2))
    samples = single_samples(poses)

    def solve(chunk: slice) -> None:
        path, found = _path(arms[chunk], samples, loaded), errors[chunk]
        loaded.launch("tool_errors", found.shape[:2], path, q[chunk], outputs=[found])

    in_chunks(solve, len(arms), max(1, SAMPLES[device] // len(poses)), device)
    return errors


def _path(arms: ArmArrays, samples: LineSamples, loaded: Loaded) -> Any:
    """Return arms and samples as the kernels take them."""
    names = ("dof", "base", "motion", "axis", "lower", "upper", "offset", "tool_axis", "tool_side")
    values = {name: getattr(arms, name) for name in names}
    values |= {name: getattr(samples, name) for name in ("first", "before", "passes")}
    values |= {name: getattr(samples.poses, name) for name in ("n_angular", "position", "tolerance", "angle_tolerance")}
    values |= {axis: samples.poses.rotation[:, :, i] for i, axis in enumerate("xyz")}
    return loaded.struct("Path", values | {"speed": joint_speeds(arms)})
