"""A single update of the inverse kinematics, which references also compute."""

from dataclasses import replace

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, Floats
from armwright.kinematics.devices import load_kernels
from armwright.kinematics.ik import ik
from armwright.tasks.targets import TargetArrays


def update_once(
    arms: ArmArrays, points: Array, q: Floats, h_before: Floats, target_arrays: TargetArrays | None = None
) -> tuple[Floats, Floats]:
    """Make one update of the inverse kinematics of each arm at its own point (N, 3) [m], on the CPU.

    q, h_before: (N, D) joint values and limit gradients of the update before, in the precision of the arms.
    """
    # Only the target's position relative to the base matters, so each arm is moved and all share the target 0.
    shifted = replace(arms, base=np.asarray(arms.base - points, dtype=arms.precision))
    lanes = ik.LANES["cpu"]
    wp, kernels = load_kernels("ik.ik_kernels", "cpu", arms.precision, lanes, arms.motions, ik._kind_of(target_arrays))
    columns = ik._target_columns(np.zeros((1, 3)), np.zeros(1), target_arrays)
    columns_, q_last, h_last = (
        wp.array(ik._in_lanes(values, lanes), dtype=kernels.Lane, device="cpu")
        for values in (columns[None], q[:, None], h_before[:, None])
    )
    ik._launch(shifted, columns_[0], 1, q_last, h_last, wp, kernels)
    return ik._from_lanes(q_last.numpy())[:, 0], ik._from_lanes(h_last.numpy())[:, 0]
