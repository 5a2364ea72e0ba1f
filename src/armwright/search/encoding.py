"""Columns of a design matrix, as the searches vary them: real ones on the unit cube, categories, and structures."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.spaces.parameters import GRID_DIGITS, CategoricalParameter, FloatParameter, Parameter

Structures = NDArray[np.int64]


class DesignEncoding:
    """Design matrices (`DesignSpace.matrix`), and their real columns on the unit cube.

    The structure of a design is its joint sequence: the parameters n_joints and joint_1, joint_2, … up to that number.

    Attributes:
        real: (R,) indices of the real columns.
        categorical: (C,) indices of the categorical columns.
        choices: (C,) number of categories of each categorical column.
        structural: (C,) whether a categorical column is a part of the structure.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        kinds = [isinstance(parameter, CategoricalParameter) for parameter in parameters]
        self.categorical = np.flatnonzero(kinds)
        self.real = np.flatnonzero(~np.array(kinds))
        categories = [p for p in parameters if isinstance(p, CategoricalParameter)]
        self.choices = np.array([len(p.choices) for p in categories], dtype=int)
        ranges = [(p.low, p.high) for p in parameters if isinstance(p, FloatParameter)]
        self._low, self._high = np.array(ranges).reshape(-1, 2).T
        self._step = np.array([p.step for p in parameters if isinstance(p, FloatParameter)])

        column = {p.name: i for i, p in enumerate(parameters)}
        joints = {column[p.name]: len(p.choices) for p in categories if p.name.startswith("joint_")}
        self._joints = np.array(list(joints), dtype=int)
        self._bases = np.array(list(joints.values()), dtype=np.int64) + 1
        self._weights = np.cumprod([1, *self._bases], dtype=np.int64)[: len(joints)]
        self._number = column.get("n_joints")
        counts = next((p.choices for p in categories if p.name == "n_joints"), (len(joints),))
        self._counts = np.array(counts, dtype=np.int64)
        self.structural = np.isin(self.categorical, [*joints, self._number or -1])

    def __len__(self) -> int:
        return len(self.real) + len(self.categorical)

    def random(self, n: int, rng: np.random.Generator) -> Array:
        """Return an (n, P) matrix of designs, uniform in every column."""
        matrix = np.empty((n, len(self)))
        matrix[:, self.real] = self.from_units(rng.random((n, len(self.real))))
        matrix[:, self.categorical] = rng.integers(self.choices, size=(n, len(self.choices)))
        return matrix

    def units(self, matrix: Array) -> Array:
        """Return the (N, R) real columns scaled to [0, 1]; 0 if a range is a single value."""
        width = self._high - self._low
        return (matrix[:, self.real] - self._low) / np.where(width > 0.0, width, 1.0)

    def from_units(self, units: Array) -> Array:
        """Return the (N, R) real columns of points on the unit cube; points outside it are reflected, then clipped."""
        reflected = 1.0 - np.abs(1.0 - np.abs(units))
        return self._on_grid(np.clip(self._low + reflected * (self._high - self._low), self._low, self._high))

    def structures(self, matrix: Array) -> Structures:
        """Return the (N,) structures of designs, each as one number."""
        types = matrix[:, self._joints].astype(np.int64) + 1
        types[np.arange(len(self._joints)) >= self._n_joints(matrix)[:, None]] = 0
        return types @ self._weights

    def n_joints(self, structures: Structures) -> NDArray[np.int64]:
        """Return the (N,) numbers of joints of structures."""
        return np.count_nonzero(self._types(structures), axis=1)

    def with_structures(self, matrix: Array, structures: Structures) -> Array:
        """Return a copy of designs (N, P) with the (N,) given structures."""
        types = self._types(structures)
        changed = matrix.copy()
        changed[:, self._joints] = np.where(types > 0, types - 1, matrix[:, self._joints])
        if self._number is not None:
            changed[:, self._number] = np.searchsorted(self._counts, np.count_nonzero(types, axis=1))
        return changed

    def sample_structures(self, n: int, rng: np.random.Generator) -> Structures:
        """Return at most `n` different structures; each number of joints has an equal share, if it has as many."""
        chosen: list[Structures] = []
        for left, count in zip(range(len(self._counts), 0, -1), self._counts, strict=True):
            share = (n - sum(map(len, chosen))) // left
            bases = self._bases[:count]
            numbers = random_distinct(math.prod((bases - 1).tolist()), share, rng)
            types = numbers[:, None] // np.cumprod([1, *(bases[:-1] - 1)]) % (bases - 1) + 1
            chosen.append(types @ self._weights[:count])
        return np.concatenate(chosen)

    def _n_joints(self, matrix: Array) -> NDArray[np.int64]:
        if self._number is None:
            return np.full(len(matrix), len(self._joints))
        return self._counts[matrix[:, self._number].astype(np.int64)]

    def _types(self, structures: Structures) -> NDArray[np.int64]:
        """Return the (N, J) joint types of structures: 0 for a missing joint, else one more than the category."""
        return structures[:, None] // self._weights % self._bases

    def _on_grid(self, reals: Array) -> Array:
        """Round (N, R) real columns to the grid, if they have one."""
        if not self._step.any():
            return reals
        step = np.where(self._step > 0.0, self._step, 1.0)
        grid = np.round(self._low + step * np.round((reals - self._low) / step), GRID_DIGITS)
        return np.where(self._step > 0.0, grid, reals)


def random_distinct(total: int, n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return min(n, total) different numbers below `total`."""
    return rng.permutation(total)[:n] if total <= 100_000 else np.unique(rng.integers(total, size=n))
