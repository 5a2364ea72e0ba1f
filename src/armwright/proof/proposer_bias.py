"""Bias of a proposer's designs, compared with the black box: round lengths, symmetry, repeated joint types."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armwright.arrays import Array
from armwright.runs.history import BBO, History
from armwright.tasks.symmetry import TOLERANCE, distance_to_planes, symmetry_planes

EXACT = 1e-9  # [m]; a length this near to a round one is round


@dataclass(frozen=True)
class SourceBias:
    """Shares of the designs of one source, 0 to 1."""

    lengths_5_cm: float  # all link lengths are multiples of 0.05 m, within 1e-9 m
    lengths_1_cm: float  # all link lengths are multiples of 0.01 m, within 1e-9 m
    base_on_symmetry_plane: float | None  # within 1e-6 m of a symmetry plane of the targets; None if they have none
    equal_neighbours: float | None  # of pairs of consecutive joints: with the same type; None if there are no pairs


@dataclass(frozen=True)
class ProposerBias:
    """The bias of a proposer's designs and of the black box's; None without designs."""

    proposer: SourceBias | None
    black_box: SourceBias | None


def proposer_bias(history: History, proposer: str) -> ProposerBias:
    """Return the bias of the trials of a proposer, and of the black box's."""
    planes = symmetry_planes(history.problem.task.target_positions)
    return ProposerBias(source_bias(history, proposer, planes), source_bias(history, BBO, planes))


def source_bias(history: History, source: str, planes: Array) -> SourceBias | None:
    """Return the bias of a source's designs; None if it has none.

    planes: (P, 3) normals of the symmetry planes of the targets.
    """
    designs = [trial.design for trial in history if trial.source == source]
    if not designs:
        return None
    points = history.problem.task.target_positions
    on_plane = [distance_to_planes(np.array(design.origin), points, planes) <= TOLERANCE for design in designs]
    equal = [joint == after for design in designs for joint, after in pairwise(design.joints)]
    return SourceBias(
        lengths_5_cm=float(np.mean([are_round(design.links, 0.05) for design in designs])),
        lengths_1_cm=float(np.mean([are_round(design.links, 0.01) for design in designs])),
        base_on_symmetry_plane=float(np.mean(on_plane)) if len(planes) else None,
        equal_neighbours=float(np.mean(equal)) if equal else None,
    )


def are_round(lengths: Sequence[float], step: float) -> bool:
    """Return whether all `lengths` are multiples of `step` [m], within 1e-9 m."""
    values = np.array(lengths)
    return bool(np.all(np.abs(values - step * np.round(values / step)) <= EXACT))
