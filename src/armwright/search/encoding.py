"""Columns of a design matrix, as the searches vary them: real ones on the unit cube, categories, and structures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.spaces.parameters import GRID_DIGITS, CategoricalParameter, FloatParameter, Parameter


class DesignEncoding:
    """Design matrices (`DesignSpace.matrix`), and their real columns on the unit cube.

    The structure of a design is its joint sequence: the parameters n_joints and joint_1, joint_2, … up to that number.

    Attributes:
        real: (R,) indices of the real columns.
        categorical: (C,) indices of the categorical columns.
        choices: (C,) number of categories of each categorical column.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        kinds = [isinstance(parameter, CategoricalParameter) for parameter in parameters]
        self.categorical = np.flatnonzero(kinds)
        self.real = np.flatnonzero(~np.array(kinds, dtype=bool))
        categories = [p for p in parameters if isinstance(p, CategoricalParameter)]
        self.choices = np.array([len(p.choices) for p in categories], dtype=int)
        ranges = [(p.low, p.high) for p in parameters if isinstance(p, FloatParameter)]
        self._low, self._high = np.array(ranges).reshape(-1, 2).T
        self._step = np.array([p.step for p in parameters if isinstance(p, FloatParameter)])
        self._log = np.flatnonzero([p.log for p in parameters if isinstance(p, FloatParameter)])
        self._scaled_low, self._scaled_high = self._scaled(self._low), self._scaled(self._high)

        column = {parameter.name: i for i, parameter in enumerate(parameters)}
        joints = {column[p.name]: len(p.choices) for p in categories if p.name.startswith("joint_")}
        self._joints = np.array(list(joints), dtype=int)
        self._strides = np.cumprod([1, *(n + 1 for n in joints.values())], dtype=np.int64)[:-1]
        self._number = column.get("n_joints")
        counts = next((p.choices for p in categories if p.name == "n_joints"), ())
        self._counts = np.array(counts, dtype=np.int64)

    def __len__(self) -> int:
        return len(self.real) + len(self.categorical)

    def random(self, n: int, rng: np.random.Generator) -> Array:
        """Return an (n, P) matrix of designs, uniform in every column."""
        matrix = np.empty((n, len(self)))
        matrix[:, self.real] = self.from_units(rng.random((n, len(self.real))))
        matrix[:, self.categorical] = rng.integers(self.choices, size=(n, len(self.choices)))
        return matrix

    def units(self, matrix: Array) -> Array:
        """Return the (N, R) real columns scaled to [0, 1], logarithmic ones on their scale; 0 for a single value."""
        width = self._scaled_high - self._scaled_low
        return (self._scaled(matrix[:, self.real]) - self._scaled_low) / np.where(width > 0.0, width, 1.0)

    def from_units(self, units: Array) -> Array:
        """Return the (N, R) real columns of points on the unit cube; points outside it are reflected, then clipped."""
        reflected = 1.0 - np.abs(1.0 - np.abs(units))
        scaled = self._scaled_low + reflected * (self._scaled_high - self._scaled_low)
        scaled[..., self._log] = np.exp(scaled[..., self._log])
        return self._on_grid(np.clip(scaled, self._low, self._high))

    def _scaled(self, reals: Array) -> Array:
        """Return (..., R) real columns on the scales of their parameters."""
        if not len(self._log):
            return reals
        scaled = reals.copy()
        scaled[..., self._log] = np.log(scaled[..., self._log])
        return scaled

    def structures(self, matrix: Array) -> NDArray[np.int64]:
        """Return the (N,) structures of designs, each as one number."""
        types = matrix[:, self._joints].astype(np.int64) + 1  # 0: the arm has no such joint
        types[np.arange(len(self._joints)) >= self.n_joints(matrix)[:, None]] = 0
        return types @ self._strides

    def n_joints(self, matrix: Array) -> NDArray[np.int64]:
        """Return the (N,) numbers of joints of designs."""
        if self._number is None:
            return np.full(len(matrix), len(self._joints))
        return self._counts[matrix[:, self._number].astype(np.int64)]

    def _on_grid(self, reals: Array) -> Array:
        """Round (N, R) real columns to the grid, if they have one."""
        if not self._step.any():
            return reals
        step = np.where(self._step > 0.0, self._step, 1.0)
        grid = np.round(self._low + step * np.round((reals - self._low) / step), GRID_DIGITS)
        return np.where(self._step > 0.0, grid, reals)
