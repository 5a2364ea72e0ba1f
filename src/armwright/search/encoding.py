"""The columns of a matrix of designs: which hold a real number, which a category, and within what."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.spaces.parameters import GRID_DIGITS, CategoricalParameter, FloatParameter, Parameter


class Columns:
    """Designs as rows (`DesignSpace.matrix`), and the same with every real number on the unit interval.

    real, categorical: the numbers of the columns of either kind.
    choices: how many categories each categorical column has.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        kinds = [isinstance(parameter, CategoricalParameter) for parameter in parameters]
        self.categorical = np.flatnonzero(kinds)
        self.real = np.flatnonzero(~np.array(kinds))
        self.choices = np.array([len(p.choices) for p in parameters if isinstance(p, CategoricalParameter)], dtype=int)
        ranges = [(p.low, p.high) for p in parameters if isinstance(p, FloatParameter)]
        self._low, self._high = np.array(ranges).reshape(-1, 2).T
        self._step = np.array([p.step for p in parameters if isinstance(p, FloatParameter)])
        self._places = np.cumprod([1, *self.choices])[:-1]

    def __len__(self) -> int:
        return len(self.real) + len(self.categorical)

    def random(self, n: int, rng: np.random.Generator) -> Array:
        """(n, P) rows, uniform in every column."""
        rows = np.empty((n, len(self)))
        rows[:, self.real] = self.from_units(rng.random((n, len(self.real))))
        rows[:, self.categorical] = rng.integers(self.choices, size=(n, len(self.choices)))
        return rows

    def units(self, rows: Array) -> Array:
        """(N, R) the real columns of `rows` on [0, 1]; 0 where a range is a single value."""
        width = self._high - self._low
        return (rows[:, self.real] - self._low) / np.where(width > 0.0, width, 1.0)

    def from_units(self, units: Array) -> Array:
        """(N, R) real columns from numbers that may lie outside [0, 1]: they are reflected into it, then clipped."""
        reflected = 1.0 - np.abs(1.0 - np.abs(units))
        return self._on_grid(np.clip(self._low + reflected * (self._high - self._low), self._low, self._high))

    def _on_grid(self, reals: Array) -> Array:
        """(N, R) real columns, those that have a grid at its nearest value."""
        if not self._step.any():
            return reals
        step = np.where(self._step > 0.0, self._step, 1.0)
        grid = np.round(self._low + step * np.round((reals - self._low) / step), GRID_DIGITS)
        return np.where(self._step > 0.0, grid, reals)

    def structures(self, rows: Array) -> NDArray[np.int64]:
        """(N,) one number for each combination of categories, such as an arm's joint sequence."""
        return rows[:, self.categorical].astype(np.int64) @ self._places
