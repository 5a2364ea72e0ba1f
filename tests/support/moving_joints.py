"""Kernel results in the moving joints only, as the references have them."""

from typing import Any

import numpy as np

from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.ik import ik as solve
from armwright.kinematics.ik.ik import Postures
from tests.support import single_update


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
    found = solve.solve_postures(arrays, targets, *args, initial_q=initial_q, **options)
    assert not np.delete(found.q, own, axis=-1).any()
    assert not np.delete(found.torque, own, axis=-1).any()
    q, torque = (np.ascontiguousarray(values[..., own]) for values in (found.q, found.torque))
    return Postures(q, found.reached, torque, found.angle)


def update_once(
    arrays: ArmArrays, targets: np.ndarray, q: np.ndarray, h_before: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    own = moving(arrays)
    after, h = single_update.update_once(arrays, targets, of_all(q, arrays), of_all(h_before, arrays))
    return after[:, own], h[:, own]
