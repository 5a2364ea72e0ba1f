"""Objectives: functions of an evaluation, all minimised."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armwright.evaluation import Array, Evaluation

TORQUE_SCALE = 40.0  # α of the paper


@dataclass(frozen=True)
class Objective:
    """A number per arm that should be small.

    each: its share per target, (N, T); the objective is the sum over the targets.
    """

    name: str
    label: str
    unit: str
    each: Callable[[Evaluation], Array]

    def __call__(self, evaluation: Evaluation) -> Array:
        """One value per arm, (N,)."""
        return self.each(evaluation).sum(axis=1)


def _position_error(evaluation: Evaluation) -> Array:
    return evaluation.position_error


def _torque(evaluation: Evaluation) -> Array:
    return TORQUE_SCALE * np.linalg.norm(evaluation.joint_torques, axis=-1)


POSITION_ERROR = Objective("position_error", "Position error", "m", _position_error)
TORQUE = Objective("torque", "Torque", f"N m x {TORQUE_SCALE:g}", _torque)
PAPER_OBJECTIVES = (POSITION_ERROR, TORQUE)
