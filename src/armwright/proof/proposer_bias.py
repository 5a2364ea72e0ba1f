"""Bias of a proposer's designs, compared with the black box: bases on symmetry planes of the targets."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.runs.history import BBO, History
from armwright.tasks.symmetry import TOLERANCE, distance_to_planes, symmetry_planes


@dataclass(frozen=True)
class ProposerBias:
    """Shares (0 to 1) of designs whose base is on a symmetry plane; None without designs or planes."""

    proposer: float | None
    black_box: float | None


def proposer_bias(history: History, proposer: str) -> ProposerBias:
    """Return the bias of the trials of a proposer, and of the black box's."""
    planes = symmetry_planes(history.problem.task.target_positions)
    return ProposerBias(_on_planes(history, proposer, planes), _on_planes(history, BBO, planes))


def _on_planes(history: History, source: str, planes: Array) -> float | None:
    """Return the share of a source's designs with a base on a plane; planes: (P, 3) normals."""
    origins = [np.array(trial.design.origin) for trial in history if trial.source == source]
    if not origins or not len(planes):
        return None
    points = history.problem.task.target_positions
    return float(np.mean([distance_to_planes(origin, points, planes) <= TOLERANCE for origin in origins]))
