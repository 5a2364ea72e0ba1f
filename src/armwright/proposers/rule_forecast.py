"""Closed-form forecast of position error and torque of structures, without inverse kinematics, and their gains.

The arm is taken as a chain that bends from its first joint across the arm, the pivot, and has its mass halfway to the
target. That is exact for a stretched arm whose first two axes stand at right angles; for arms that fold, the torque is
within about 10 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import PRISMATIC, carrying
from armwright.pareto import front_mask
from armwright.problem.arm_quantities import TORQUE_SCALE
from armwright.problem.problem import Problem
from armwright.proposers.rule_structures import Structure, fitted_structures
from armwright.robot.arm import GRAVITY
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design

LEFT = 0.01  # position error that the inverse kinematics leaves at a target [m]
BULGE = 0.12  # square of the lever of a folded arm's links beside the line to the target, relative to its length
SMALL = 1e-9
ALIKE = 0.3  # difference in log length over which a result speaks for other sizes of its structure
DOUBT = 0.3  # weight of the uncorrected forecast, relative to that of one result of the same size
MOST = 1.0  # largest correction of the torque's logarithm
LEAST = 1e-6


@dataclass(frozen=True)
class Forecast:
    """Forecast of N designs."""

    error: Array  # (N,) position error beyond stated tolerances, summed over the targets [m]
    torque: Array  # (N,) torque, summed over the targets [α-scaled]
    length: Array  # (N,) from pivot to tip [m]


def forecast(problem: Problem, designs: Sequence[Design]) -> Forecast:
    """Forecast position error and torque of designs in the first case of a problem."""
    scene = problem.scenes[0]
    axis, pivot, length, moment, payload_lever = _stretched(problem, designs)
    to_target = scene.targets - pivot[:, None]  # (N, T, 3)
    distance = np.maximum(np.linalg.norm(to_target, axis=-1), SMALL)  # (N, T)
    stretch = np.minimum(distance / np.maximum(length, SMALL)[:, None], 1.0)  # (N, T)
    share = gravity_share(axis[:, None], to_target / distance[..., None])
    moment = moment[:, None] + scene.payload * payload_lever[:, None]  # (N, T) of the stretched, level arm
    lever = np.sqrt((share * stretch) ** 2 + BULGE * (1.0 - stretch**2))
    error = np.maximum(distance - length[:, None], 0.0) + LEFT
    error = np.maximum(error - scene.target_arrays.stated_tolerance, 0.0)
    return Forecast(error.sum(axis=1), TORQUE_SCALE * GRAVITY * (moment * lever).sum(axis=1), length)


def gravity_share(axis: Array, direction: Array) -> Array:
    """Return the share of the gravity moment of a straight level arm that its joints carry, as a norm.

    A joint carries the part along its own axis. The first axis is given; the second, moved by the first joint, stands
    across both the first axis and the arm. Where it comes to stand vertical, it carries nothing. The first axis and the
    arm's direction are unit vectors (..., 3).
    """
    moment = np.cross(direction, (0.0, 0.0, -1.0))
    second = np.cross(axis, direction)
    second /= np.maximum(np.linalg.norm(second, axis=-1, keepdims=True), SMALL)
    return np.hypot((moment * axis).sum(axis=-1), (moment * second).sum(axis=-1))


def _stretched(problem: Problem, designs: Sequence[Design]) -> tuple[Array, Array, Array, Array, Array]:
    """Return first axis and pivot (N, 3), and (N,) length from there, first moment of mass and lever of the payload.

    All but the axis are in metres, kilograms and their products.
    """
    arms = problem.arms(problem.space.matrix(designs))
    rows = np.arange(len(arms))
    ends = arms.base[:, None] + np.cumsum(arms.offset, axis=1)  # (N, D, 3)
    places = np.concatenate([arms.base[:, None], ends], axis=1).astype(np.float64)  # (N, D + 1, 3) joints and tip
    up = places[:, -1] - places[:, 0]
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), SMALL)
    turns = arms.motion < PRISMATIC
    axes = np.where(turns[..., None], arms.axis.astype(np.float64), 0.0)  # (N, D, 3)
    bends = turns & (np.abs(np.einsum("njk,nk->nj", axes, up)) < 0.5)
    first = np.where(bends.any(axis=1), bends.argmax(axis=1), arms.dof)  # (N,) the pivot's joint
    pivot = places[rows, first]
    carried = np.where(np.arange(arms.dof) >= first[:, None], arms.mass, 0.0)  # (N, D)
    lever = np.einsum("njk,nk->nj", places[:, :-1] + arms.com - pivot[:, None], up)
    length = np.linalg.norm(places[:, -1] - pivot, axis=1)
    moment = (carried * lever).sum(axis=1)
    payload_lever = length + np.einsum("nk,nk->n", carrying(arms, problem.task.load_shape).payload_center, up)
    return axes[rows, turns.argmax(axis=1)], pivot, length, moment, payload_lever


def gains(front: Array, values: Array, reference_point: Sequence[float]) -> Array:
    """Return the hypervolume (N,) that each of the `values` (N, 2) would add by itself to a front (F, 2)."""
    corner = np.array(reference_point)
    inside = front[np.all(front < corner, axis=1)]
    inside = inside[np.argsort(inside[:, 0])]
    edges = np.concatenate([[-np.inf], inside[:, 0], corner[:1]])  # of the steps
    heights = np.concatenate([corner[1:], inside[:, 1]])
    width = np.maximum(edges[1:] - np.maximum(edges[:-1], values[:, :1]), 0.0)  # (N, F + 1)
    return (width * np.maximum(heights - values[:, 1:], 0.0)).sum(axis=1)


@dataclass(frozen=True)
class Candidates:
    """N designs to choose from."""

    designs: Sequence[Design]  # the designs, all different
    structures: Sequence[Structure]  # the structure of each
    forecast: Forecast  # position error and torque of each

    @cached_property
    def _rows(self) -> dict[Design, int]:
        return {design: row for row, design in enumerate(self.designs)}

    @cached_property
    def names(self) -> Sequence[str]:
        """The names of the structures, each once."""
        return list(dict.fromkeys(structure.name for structure in self.structures))

    def expected_gains(self, history: History) -> Array:
        """Return the hypervolume (N,) that each design is expected to add; 0 for those that have been tried.

        Results correct the forecasts of their structure: the more alike the size, the more. A structure whose designs
        violate constraints is expected to do so again.
        """
        assert history.reference_point is not None
        space = history.problem.space
        rows = ((self._rows.get(space.with_custom(trial.design)), trial) for trial in history.proposed)
        results = [(row, trial) for row, trial in rows if row is not None]
        values = np.column_stack([self.forecast.error, self.forecast.torque])
        feasible = np.ones(len(values))
        names = np.array([structure.name for structure in self.structures])
        for name in {names[row] for row, _ in results}:
            own = [(row, trial) for row, trial in results if names[row] == name]
            alike = names == name
            evaluated = [(row, trial) for row, trial in own if trial.is_evaluated]
            if evaluated:
                values[alike] = self._corrected(values[alike], np.flatnonzero(alike), evaluated)
            feasible[alike] = (1 + sum(history.feasible[trial.number] for _, trial in own)) / (1 + len(own))
        front = np.array([member.values[:2] for member in history.front]).reshape(-1, 2)
        expected = feasible * gains(front[front_mask(front)], values, history.reference_point[:2])
        expected[[row for row, _ in results]] = 0.0
        return expected

    def _corrected(self, values: Array, rows: NDArray[np.intp], own: Sequence[tuple[int, FinishedTrial]]) -> Array:
        """Return forecasts (N, 2) of a structure, with the error shifted and the torque scaled as its results were."""
        tried = [row for row, _ in own]
        error, torque = np.array([trial.values[:2] for _, trial in own]).T  # (K,)
        length = np.log(np.maximum(self.forecast.length, LEAST))
        weight = np.exp(-np.abs(length[rows, None] - length[tried]) / ALIKE)  # (N, K)
        weight /= weight.sum(axis=1, keepdims=True) + DOUBT
        ratio = np.log(np.maximum(torque, LEAST) / np.maximum(self.forecast.torque[tried], LEAST))
        shifted = values[:, 0] + weight @ (error - self.forecast.error[tried])
        return np.column_stack([np.maximum(shifted, 0.0), values[:, 1] * np.exp(weight @ np.clip(ratio, -MOST, MOST))])


def candidates(problem: Problem) -> Candidates:
    """Return all structures in all sizes for a problem."""
    structure_of = {design: structure for structure, design in fitted_structures(problem)}
    designs = list(structure_of)
    return Candidates(designs, list(structure_of.values()), forecast(problem, designs))
