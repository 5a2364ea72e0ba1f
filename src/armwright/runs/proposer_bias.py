"""Bias of a proposer's designs, compared with the black box: round numbers, symmetry, repeats."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.runs.attribution import front_by_source, masks_by_source
from armwright.runs.history import BBO, History
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.symmetry import TOLERANCE, distance_to_planes, symmetry_planes

EXACT = 1e-9  # [m]; a length this near to a round one is round
NEAR = 1e-3  # [m]; designs whose numbers differ by no more are near-repeats

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SourceBias:
    """Shares of the designs of one source, 0 to 1.

    Attributes:
        designs: Number of designs.
        lengths_5_cm: All link lengths are multiples of 0.05 m, within 1e-9 m.
        lengths_1_cm: All link lengths are multiples of 0.01 m, within 1e-9 m.
        base_on_symmetry_plane: The base is within 1e-6 m of a symmetry plane of the targets; None if they have none.
        repeats: An earlier trial of any source has the same parameters.
        near_repeats: An earlier trial has the same joints and all numbers within 1 mm; includes repeats.
        equal_neighbours: Share of pairs of consecutive joints with the same type; None if there are no pairs.
    """

    designs: int
    lengths_5_cm: float
    lengths_1_cm: float
    base_on_symmetry_plane: float | None
    repeats: float
    near_repeats: float
    equal_neighbours: float | None


@dataclass(frozen=True)
class FrontShare:
    """A proposer's share of the front after half of the counted iterations and at the end.

    Attributes:
        half: Share after half of the iterations.
        end: Share at the end.
        grows: True if the share is larger at the end.
    """

    half: float
    end: float
    grows: bool


@dataclass(frozen=True)
class ProposerBias:
    """The bias of a proposer's designs and of the black box's; None without designs.

    Attributes:
        symmetry_planes: Number of symmetry planes of the targets.
        proposer: Bias of the proposer's designs.
        black_box: Bias of the black box's designs.
        front_share: The proposer's share of the front.
    """

    symmetry_planes: int
    proposer: SourceBias | None
    black_box: SourceBias | None
    front_share: FrontShare | None


def proposer_bias(history: History, proposer: str) -> ProposerBias:
    """Return the bias of the trials of a proposer, and of the black box's."""
    planes = symmetry_planes(history.problem.task.target_positions)
    return ProposerBias(
        symmetry_planes=len(planes),
        proposer=source_bias(history, proposer, planes),
        black_box=source_bias(history, BBO, planes),
        front_share=front_share(history, proposer),
    )


def source_bias(history: History, source: str, planes: Array) -> SourceBias | None:
    """Return the bias of a source's designs; None if it has none.

    Args:
        history: The trials.
        source: The source.
        planes: (P, 3) normals of the symmetry planes of the targets.
    """
    mine = masks_by_source(history).get(source)
    if mine is None:
        return None
    points = history.problem.task.target_positions
    designs = [trial.design for trial in history if trial.source == source]
    on_plane = [distance_to_planes(np.array(design.origin), points, planes) <= TOLERANCE for design in designs]
    repeats, near_repeats = repeated(history)
    equal = [joint == after for design in designs for joint, after in pairwise(design.joints)]
    return SourceBias(
        designs=len(designs),
        lengths_5_cm=_share([are_round(design.links, 0.05) for design in designs]),
        lengths_1_cm=_share([are_round(design.links, 0.01) for design in designs]),
        base_on_symmetry_plane=_share(on_plane) if len(planes) else None,
        repeats=_share(repeats[mine]),
        near_repeats=_share(near_repeats[mine]),
        equal_neighbours=_share(equal) if equal else None,
    )


def front_share(history: History, source: str) -> FrontShare | None:
    """Return a source's share of the front; None before the first counted iteration or without trials."""
    fronts = front_by_source(history)
    if source not in fronts or len(history) <= history.n_init:
        return None
    share = fronts[source] / np.maximum(1, np.sum(list(fronts.values()), axis=0))  # (I + 1,)
    half, end = float(share[(len(share) - 1) // 2]), float(share[-1])
    return FrontShare(half, end, grows=end > half)


def are_round(lengths: Sequence[float], step: float) -> bool:
    """Return whether all `lengths` are multiples of `step` [m], within 1e-9 m."""
    values = np.array(lengths)
    return bool(np.all(np.abs(values - step * np.round(values / step)) <= EXACT))


def repeated(history: History) -> tuple[Mask, Mask]:
    """Return two (N,) masks: an earlier trial has the same design; an earlier trial has nearly the same."""
    designs = [trial.design for trial in history]
    space = history.problem.space
    rows = space.matrix(designs)
    real = np.array([isinstance(parameter, FloatParameter) for parameter in space.parameters])
    numbers, choices = rows[:, real], rows[:, ~real]  # [m]; places among the choices
    repeats, near_repeats = np.zeros((2, len(designs)), dtype=bool)
    for i in range(1, len(designs)):
        apart = np.abs(numbers[:i] - numbers[i]).max(axis=1)
        apart[np.any(choices[:i] != choices[i], axis=1)] = np.inf
        repeats[i], near_repeats[i] = apart.min() == 0.0, apart.min() <= NEAR + EXACT
    return repeats, near_repeats


def _share(found: Sequence[bool] | Mask) -> float:
    return float(np.mean(found))
