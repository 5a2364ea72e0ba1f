"""Custom parameters of a space as inputs of the surrogate, which mean the same in every structure."""

import numpy as np

from armwright.arrays import Array
from armwright.search.encoding import DesignEncoding
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, FloatParameter


class CustomInputs:
    """Columns for the custom parameters of a space: numbers on [-1, 1], then an indicator for each choice."""

    def __init__(self, space: DesignSpace) -> None:
        self._space = space
        custom = [(i, p) for i, p in enumerate(space.parameters) if p.name in space.custom_names]
        self._numbers = [(i, p) for i, p in custom if isinstance(p, FloatParameter)]
        self._choices = [(i, p) for i, p in custom if isinstance(p, CategoricalParameter)]
        self._encoding = DesignEncoding([p for _, p in self._numbers])

    def __call__(self, matrix: Array) -> Array:
        """Return the (N, K) inputs of designs (N, P).

        Numbers are on the scales of their parameters. Inactive parameters are 0, the centre of a range.
        """
        numbers = 2.0 * self._encoding.units(matrix[:, [i for i, _ in self._numbers]]) - 1.0
        for column, (_, parameter) in enumerate(self._numbers):
            numbers[~self._space.active(parameter.name, matrix), column] = 0.0
        indicators: list[Array] = [
            (matrix[:, [i]] == np.arange(len(p.choices))) & self._space.active(p.name, matrix)[:, None]
            for i, p in self._choices
        ]
        return np.column_stack([numbers, *indicators])
