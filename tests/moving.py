"""The kernels for arms with the same joints fixed, in the moving joints alone: as the references have them."""

from typing import Any

import numpy as np

from armwright.kinematics import solve
from armwright.kinematics.arrays import FIXED, ArmArrays
from armwright.kinematics.solve import Postures


def moving(arrays: ArmArrays) -> np.ndarray:
    """The places of the joints that move."""
    assert np.array_equal(arrays.motion < FIXED, np.broadcast_to(arrays.motion[0] < FIXED, arrays.motion.shape))
    return np.flatnonzero(arrays.motion[0] < FIXED)


def of_all(values: np.ndarray, arrays: ArmArrays) -> np.ndarray:
    """(..., D) from values of the moving joints alone, 0 for the others."""
    every = np.zeros((*values.shape[:-1], arrays.dof), dtype=values.dtype)
    every[..., moving(arrays)] = values
    return every


def solve_postures(arrays: ArmArrays, targets: np.ndarray, *args: Any, start: Any = None, **options: Any) -> Postures:
    own = moving(arrays)
    given = None
    if start is not None:
        start = np.asarray(start, dtype=np.float64)
        given = of_all(
            np.broadcast_to(start, (*start.shape[:-1], len(own))) if start.ndim else start.reshape(1), arrays
        )
    found = solve.solve_postures(arrays, targets, *args, start=given, **options)
    assert not np.delete(found.q, own, axis=-1).any()
    assert not np.delete(found.torque, own, axis=-1).any()
    return Postures(
        np.ascontiguousarray(found.q[..., own]), found.reached, np.ascontiguousarray(found.torque[..., own])
    )


def update_once(
    arrays: ArmArrays, targets: np.ndarray, q: np.ndarray, h_before: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    own = moving(arrays)
    after, h = solve.update_once(arrays, targets, of_all(q, arrays), of_all(h_before, arrays))
    return after[:, own], h[:, own]
