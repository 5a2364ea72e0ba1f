"""Quantities on which simulations of driven arms depend: inertia, travel and compliance of the joints at the targets.

Joints count in the motion of their motors, so that revolute and sliding ones have the same units. The arm starts
straight and visits the targets in order.
"""

import numpy as np

from armwright.arrays import Array
from armwright.problem.evaluation import Evaluation


def dynamic_quantities(evaluation: Evaluation) -> dict[str, Array]:
    """Return (N,) each of the quantities of arms, by name."""
    inertia = np.linalg.eigvalsh(evaluation.motor_inertia)[..., -1].astype(np.float64)
    turns = np.diff(evaluation.q, axis=1, prepend=0.0) / evaluation.arms.travel[:, None]  # (N, T, D) [rad]
    energy = 0.5 * np.einsum("nti,ntij,ntj->nt", turns, evaluation.motor_inertia, turns)
    sag, sweep = (
        np.linalg.norm((evaluation.motor_jacobian @ motion[..., None])[..., 0], axis=-1)
        for motion in (evaluation.motor_torques, turns)
    )
    return {
        # largest eigenvalue of the joint-space inertia matrix in the kept posture, summed over targets [kg m²]
        "inertia": inertia.sum(axis=1),
        # its maximum
        "worst_inertia": inertia.max(axis=1),
        # Euclidean norm of the turns of the motors from the target before, summed [rad]
        "joint_travel": np.linalg.norm(turns, axis=-1).sum(axis=1),
        # of a motor from the target before [rad]
        "longest_turn": np.abs(turns).max(axis=(1, 2)),
        # at the targets if the turns from the target before took one second, summed [J]
        "kinetic_energy_at_1_s_a_move": energy.sum(axis=1),
        # of the tip by gravity if every motor yields 1 rad under 1 N m, first order, summed [m]
        "sag_at_1_Nm_per_rad": sag.sum(axis=1),
        # of the tip by the turns from the target before, were its Jacobian the target's, summed [m]
        "tip_sweep": sweep.sum(axis=1),
    }
