"""Kernel results in the moving joints only, as the references have them."""

from dataclasses import replace
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.devices import load_kernels
from armwright.kinematics.ik import ik
from armwright.kinematics.ik.ik import Postures
from armwright.tasks.targets import TargetArrays


def moving(arrays: ArmArrays) -> np.ndarray:
    """The places of the joints that move."""
    assert np.array_equal(arrays.motion < FIXED, np.broadcast_to(arrays.motion[0] < FIXED, arrays.motion.shape))
    return np.flatnonzero(arrays.motion[0] < FIXED)


def of_all(values: np.ndarray, arrays: ArmArrays) -> np.ndarray:
    """(..., D) from values of the moving joints alone, 0 for the others."""
    every = np.zeros((*values.shape[:-1], arrays.dof), dtype=values.dtype)
    every[..., moving(arrays)] = values
    return every


def solve_postures(
    arrays: ArmArrays, targets: np.ndarray, *args: Any, initial_q: Any = None, **options: Any
) -> Postures:
    own = moving(arrays)
    if initial_q is not None:
        initial_q = np.asarray(initial_q, dtype=np.float64)
        if initial_q.ndim and initial_q.shape[-1] == len(own):
            initial_q = of_all(initial_q, arrays)
    found = ik.solve_postures(arrays, targets, *args, initial_q=initial_q, **options)
    assert not np.delete(found.q, own, axis=-1).any()
    assert not np.delete(found.torque, own, axis=-1).any()
    q, torque = (np.ascontiguousarray(values[..., own]) for values in (found.q, found.torque))
    return Postures(q, found.reached, torque, found.angle)


def update_once(
    arrays: ArmArrays, targets: Array, q: Array, h_before: Array, target_arrays: TargetArrays | None = None
) -> tuple[Array, Array]:
    """Make one update of the inverse kinematics of each arm at its own target, on the CPU.

    Args:
        arrays: N arms.
        targets: (N, 3) the target of each arm [m].
        q: (N, D) joint angles [rad] or displacements [m], in the precision of the arms.
        h_before: (N, D) limit gradients of the update before, in the same precision.
        target_arrays: The axis or orientation of one target for all arms.

    Returns:
        (N, D) joint angles or displacements, and limit gradients.
    """
    own, lanes = moving(arrays), ik.LANES["cpu"]
    # Only the target's position relative to the base matters, so each arm is moved and all share the target 0.
    shifted = replace(arrays, base=np.asarray(arrays.base - targets, dtype=arrays.precision))
    kind = ik._kind_of(target_arrays)
    loaded = load_kernels("ik.ik_kernels", "cpu", arrays.precision, lanes, arrays.motions, kind)
    columns = ik._target_columns(np.zeros((1, 3)), np.zeros(1), target_arrays)
    columns_, q_last, h_last = (
        loaded.warp.array(ik._in_lanes(values, lanes), dtype=loaded.kernels.Lane, device="cpu")
        for values in (columns[None], of_all(q, arrays)[:, None], of_all(h_before, arrays)[:, None])
    )
    results = [loaded.empty((*q_last.shape[:2], n), loaded.kernels.Lane) for n in ik._result_sizes(arrays.dof)]
    kernel, inputs = ik._steps(shifted, columns_[0], 1, q_last, h_last, results, loaded)[0]
    loaded.warp.launch(kernel, q_last.shape[:2], inputs=inputs, device="cpu")
    return ik._from_lanes(q_last.numpy())[:, 0, own], ik._from_lanes(h_last.numpy())[:, 0, own]
