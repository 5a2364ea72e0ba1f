"""Quantities on which simulations of driven arms depend: inertia, travel and compliance of the joints at the targets.

Joints count in the motion of their motors, so that revolute and sliding ones have the same units. The arm starts
straight and visits the targets in order.
"""

import numpy as np

from armwright.arrays import Array
from armwright.problem.evaluation import Evaluation

QUANTITIES = (
    "inertia",  # largest eigenvalue of the joint-space inertia matrix in the kept posture, summed over targets [kg m²]
    "worst_inertia",  # its maximum
    "joint_travel",  # Euclidean norm of the turns of the motors from the target before, summed [rad]
    "longest_turn",  # of a motor from the target before [rad]
    "kinetic_energy_at_1_s_a_move",  # at the targets if the turns from the target before took one second, summed [J]
    "sag_at_1_Nm_per_rad",  # of the tip by gravity if every motor yields 1 rad under 1 N m, first order, summed [m]
    "tip_sweep",  # of the tip by the turns from the target before, were its Jacobian the target's, summed [m]
)


def dynamic_quantities(evaluation: Evaluation) -> Array:
    """Return (N, Q) the QUANTITIES of arms."""
    inertia = np.linalg.eigvalsh(evaluation.motor_inertia)[..., -1].astype(np.float64)
    turns = np.diff(evaluation.q, axis=1, prepend=0.0) / evaluation.arms.travel[:, None]  # (N, T, D) [rad]
    energy = 0.5 * np.einsum("nti,ntij,ntj->nt", turns, evaluation.motor_inertia, turns)
    sag, sweep = (
        np.linalg.norm((evaluation.motor_jacobian @ motion[..., None])[..., 0], axis=-1)
        for motion in (evaluation.motor_torques, turns)
    )
    columns = [
        inertia.sum(axis=1),
        inertia.max(axis=1),
        np.linalg.norm(turns, axis=-1).sum(axis=1),
        np.abs(turns).max(axis=(1, 2)),
        energy.sum(axis=1),
        sag.sum(axis=1),
        sweep.sum(axis=1),
    ]
    return np.column_stack(columns)
