"""The structures for a problem in all sizes, with the gain to be expected from each."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.problem.problem import Problem
from armwright.proposers.rule_forecast import Forecast, forecast, gains
from armwright.proposers.rule_structures import Structure, fitted_structures
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design

ALIKE = 0.3  # difference in log length over which a result speaks for other sizes of its structure
DOUBT = 0.3  # weight of the uncorrected forecast, relative to that of one result of the same size
MOST = 1.0  # largest correction of the torque's logarithm
SMALL = 1e-6


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
            evaluated = [(row, trial) for row, trial in own if trial.failure is None]
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
        length = np.log(np.maximum(self.forecast.length, SMALL))
        weight = np.exp(-np.abs(length[rows, None] - length[tried]) / ALIKE)  # (N, K)
        weight /= weight.sum(axis=1, keepdims=True) + DOUBT
        ratio = np.log(np.maximum(torque, SMALL) / np.maximum(self.forecast.torque[tried], SMALL))
        shifted = values[:, 0] + weight @ (error - self.forecast.error[tried])
        return np.column_stack([np.maximum(shifted, 0.0), values[:, 1] * np.exp(weight @ np.clip(ratio, -MOST, MOST))])


def candidates(problem: Problem) -> Candidates:
    """Return all structures in all sizes for a problem."""
    structure_of = {design: structure for structure, design in fitted_structures(problem)}
    designs = list(structure_of)
    return Candidates(designs, list(structure_of.values()), forecast(problem, designs))
