"""Quantities on which simulations of driven arms depend: inertia, travel and compliance of the joints at the targets.

Joints count in the motion of their motors, so that revolute and sliding ones have the same units. The arm starts
straight and visits the targets in order.
"""

import numpy as np

from armwright.arrays import Array
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective


def _largest_inertia(evaluation: Evaluation) -> Array:
    return np.linalg.eigvalsh(evaluation.motor_inertia)[..., -1].astype(np.float64)


def _steps(evaluation: Evaluation) -> Array:
    """Return (N, T, D) how far the motors turn to each target [rad]."""
    return np.diff(evaluation.q, axis=1, prepend=0.0) / evaluation.arms.travel[:, None]


def _energy(evaluation: Evaluation) -> Array:
    steps = _steps(evaluation)
    return 0.5 * np.einsum("nti,ntij,ntj->nt", steps, evaluation.motor_inertia, steps)


def _sag(evaluation: Evaluation) -> Array:
    displacement = evaluation.motor_jacobian @ evaluation.motor_torques[..., None]
    return np.linalg.norm(displacement[..., 0], axis=-1)


def _sweep(evaluation: Evaluation) -> Array:
    displacement = evaluation.motor_jacobian @ _steps(evaluation)[..., None]
    return np.linalg.norm(displacement[..., 0], axis=-1)


DYNAMIC_QUANTITIES = (
    Objective(
        name="inertia",
        unit="kg m²",
        description="the largest eigenvalue of the joint-space inertia matrix in the kept posture",
        each=_largest_inertia,
    ),
    Objective(
        name="worst_inertia",
        unit="kg m²",
        description="the largest eigenvalue of the joint-space inertia matrix in the kept posture",
        each=_largest_inertia,
        over="max",
    ),
    Objective(
        name="joint_travel",
        unit="rad",
        description="the Euclidean norm of the turns of the motors from the target before, or from the straight arm",
        each=lambda e: np.linalg.norm(_steps(e), axis=-1),
    ),
    Objective(
        name="longest_turn",
        unit="rad",
        description="the largest turn of a motor from the target before, or from the straight arm",
        each=lambda e: np.abs(_steps(e)).max(axis=-1),
        over="max",
    ),
    Objective(
        name="kinetic_energy_at_1_s_a_move",
        unit="J",
        description="the kinetic energy at the target if the turns from the target before took one second",
        each=_energy,
    ),
    Objective(
        name="sag_at_1_Nm_per_rad",
        unit="m",
        description="how far gravity moves the tip if every motor yields 1 rad under 1 N m, to the first order",
        each=_sag,
    ),
    Objective(
        name="tip_sweep",
        unit="m",
        description="how far the tip would go by the turns from the target before, were its Jacobian the target's",
        each=_sweep,
    ),
)
