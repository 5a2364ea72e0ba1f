"""Objectives: functions of an evaluation, all minimised."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armwright.evaluation import Array, Evaluation

TORQUE_SCALE = 40.0  # α of the paper


@dataclass(frozen=True)
class Objective:
    """A number per arm that should be small.

    symbol: its name in formulas and prompts.
    words: what its share of one target is, for a reader who knows nothing of this program.
    each: its share per target, (N, T); the objective is the sum over the targets.
    """

    name: str
    label: str
    unit: str
    symbol: str
    words: str
    each: Callable[[Evaluation], Array]

    def __call__(self, evaluation: Evaluation) -> Array:
        """One value per arm, (N,)."""
        return self.each(evaluation).sum(axis=1)


def _position_error(evaluation: Evaluation) -> Array:
    return evaluation.position_error


def _torque(evaluation: Evaluation) -> Array:
    return TORQUE_SCALE * np.linalg.norm(evaluation.joint_torques, axis=-1)


POSITION_ERROR = Objective(
    name="position_error",
    label="Position error",
    unit="m",
    symbol="E_pos",
    words="the distance between the tip and the target in the kept posture",
    each=_position_error,
)
TORQUE = Objective(
    name="torque",
    label="Torque",
    unit=f"N m x {TORQUE_SCALE:g}",
    symbol="E_torque",
    words=f"{TORQUE_SCALE:g} times the Euclidean norm of the joint torques [N m] that hold the kept posture up against "
    "gravity",
    each=_torque,
)
PAPER_OBJECTIVES: tuple[Objective, ...] = (POSITION_ERROR, TORQUE)
