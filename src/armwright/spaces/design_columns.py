"""A matrix of designs, read module by module."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.spaces.design_parameters import named_parameters
from armwright.spaces.joint_modules import MOUNTS
from armwright.spaces.parameters import CategoricalParameter
from armwright.spaces.space_schema import SpaceSchema

Indices = NDArray[np.intp]


class DesignColumns:
    """N designs of up to M modules, from their (N, P) matrix."""

    present: NDArray[np.bool_]  # (N, M) True for the modules that a design has
    mount: Indices  # (N,) index of the mount
    links: Array  # (N, M) lengths, 0 for absent modules [m]
    tubes: Indices  # (N, M) indices of the tubes of links and rails

    def __init__(self, space: SpaceSchema, matrix: Array) -> None:
        self.matrix = matrix
        self._parameters = list(named_parameters(space).values())
        self._column = {parameter.name: i for i, parameter in enumerate(self._parameters)}
        self.n, self.modules = len(matrix), space.max_joints
        self.present = np.arange(self.modules) < self._choice("n_joints", int, str(self.modules))[:, None]
        self.mount = self._choice("mount", tuple(MOUNTS).index, space.mount[0])
        self.links = np.where(self.present, self.reals("link"), 0.0)
        names = space.tube_names
        self.tubes = self.choices("tube", names.index, names[0])
        if "tube" in self._column:
            self.tubes = np.repeat(self._choice("tube", names.index, names[0])[:, None], self.modules, axis=1)

    def choices(self, kind: str, index: Any, default: str) -> Indices:
        """Return the (N, M) indices of the choices kind_1, kind_2, …; of `default` without such parameters."""
        columns = [self._choice(f"{kind}_{j}", index, default) for j in range(1, self.modules + 1)]
        return np.stack(columns, axis=1)

    def reals(self, kind: str, default: float = 0.0) -> Array:
        """Return the (N, M) values of kind_1, kind_2, …; `default` without such parameters."""
        first = self._column.get(f"{kind}_1")
        if first is None or f"{kind}_{self.modules}" not in self._column:
            return np.full((self.n, self.modules), default)
        return self.matrix[:, first : first + self.modules]

    def _choice(self, name: str, index: Any, default: str) -> Any:
        """Return the (N,) `index` of each design's choice; of `default` without such a parameter."""
        if name not in self._column:
            return np.full(self.n, index(default))
        choices = cast("CategoricalParameter", self._parameters[self._column[name]]).choices
        return np.array([index(choice) for choice in choices])[self.matrix[:, self._column[name]].astype(np.intp)]
