"""Inputs of the surrogate: quantities of a design that the built-in physics gives, and its parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmwrightError, SettingsError
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.search.encoding import DesignEncoding
from armwright.search.surrogate.dynamic_quantities import dynamic_quantities
from armwright.spaces.design_columns import DesignColumns
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Design, FloatParameter

PHYSICS, DYNAMICS, PARAMETERS = "physics", "dynamics", "parameters"  # sets of inputs
PROBES = 400  # random designs that scale the inputs
FEW = 64  # of these, that tell which quantities are defined: most do not follow a cycle
BASE = slice(3)  # columns of a design matrix: the position of the base, which means the same in every structure
HEAVY_TAIL = 8.0  # the largest value over the median, from which a quantity counts by its logarithm
LOG_FLOOR = 3e-2  # of the median, added before a logarithm
SAME = 0.9999  # correlation of two quantities from which one is left out

FeatureFunction = Callable[[Design], Sequence[float]]


@dataclass(frozen=True)
class Scaling:
    """Scaling of inputs to mean 0 and variance 1 over random designs."""

    kept: NDArray[np.intp]  # (K,) columns that differ and are no copies of others
    floors: Array  # (K,) added before the logarithm; NaN for columns that have none
    mean: Array  # (K,) after it
    deviation: Array  # (K,) after it
    largest: Array  # (F,) of each column, for what was not evaluated

    @classmethod
    def of(cls, columns: Array) -> "Scaling":
        """Return the scaling of columns (N, F); NaN where not evaluated."""
        largest = np.fmax.reduce(columns, axis=0)
        columns = np.where(np.isnan(columns), largest, columns)
        floors = np.array([_log_floor(column) for column in columns.T])
        shaped = _logarithms(columns, floors)
        deviation = shaped.std(axis=0)
        varying = np.flatnonzero(deviation > 1e-9 * (1.0 + np.abs(shaped).max(axis=0, initial=0.0)))
        kept: list[int] = []
        units = (shaped - shaped.mean(axis=0)) / np.where(deviation > 0.0, deviation, 1.0)
        for column in varying.tolist():
            if not kept or np.abs(units[:, kept].T @ units[:, column]).max() < SAME * len(units):
                kept.append(column)
        index = np.array(kept, dtype=np.intp)
        return cls(index, floors[index], shaped[:, index].mean(axis=0), deviation[index], largest)

    def __call__(self, columns: Array) -> Array:
        """Return the (N, K) scaled inputs of columns (N, F)."""
        known = np.where(np.isnan(columns), self.largest, columns)[:, self.kept]
        return (_logarithms(known, self.floors) - self.mean) / self.deviation


def _log_floor(column: Array) -> float:
    """Return what is added to a column before its logarithm is taken; NaN if it is not positive with a heavy tail."""
    positive = column[column > 0.0]
    if column.min() < 0.0 or len(np.unique(column)) < 20:
        return np.nan
    median = float(np.median(positive))
    return (
        LOG_FLOOR * median if positive.max() > HEAVY_TAIL * median or positive.min() < median / HEAVY_TAIL else np.nan
    )


def _logarithms(columns: Array, floors: Array) -> Array:
    """Return the columns, the logarithm taken of those with a floor."""
    has = ~np.isnan(floors)
    shaped = columns.copy()
    shaped[:, has] = np.log(np.maximum(columns[:, has], 0.0) + floors[has])
    return shaped


@dataclass(frozen=True)
class Description:
    """What is known of N designs without evaluating them."""

    inputs: Mapping[str, Array]  # (N, F) scaled inputs of each set: `physics`, `dynamics` and `parameters`
    violations: Array  # (N, C) of the constraints, which the built-in physics alone decides

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> "Description":
        """Return the description of some of the designs."""
        return Description({name: table[rows] for name, table in self.inputs.items()}, self.violations[rows])

    def __add__(self, other: "Description") -> "Description":
        """Return the description of both sets of designs."""
        inputs = {name: np.vstack([table, other.inputs[name]]) for name, table in self.inputs.items()}
        return Description(inputs, np.vstack([self.violations, other.violations]))


class CheapFeatures:
    """Inputs of the surrogate for designs of a problem, whose evaluator is never called; `function` gives more."""

    def __init__(self, problem: Problem, function: FeatureFunction | None = None) -> None:
        self._problem = problem
        self._function = function
        self._encoding = DesignEncoding(problem.space.parameters)

    def describe(self, matrix: Array) -> Description:
        """Return the description of designs (N, P)."""
        columns, violations = self._columns(matrix)
        return Description({name: self._scalings[name](table) for name, table in columns.items()}, violations)

    def _columns(self, matrix: Array) -> tuple[dict[str, Array], Array]:
        """Return the unscaled inputs of designs in each set, and their violations (N, C)."""
        values, violations = self._values(matrix)
        others = [custom_inputs(self._problem.space, matrix), self._features(matrix)]
        n = len(self._quantities)
        columns = {
            PHYSICS: np.column_stack([values[:, :n], matrix[:, BASE], self._joint_counts(matrix), *others]),
            DYNAMICS: np.column_stack([values[:, n:], *others]),
            PARAMETERS: self._parameters(matrix),
        }
        return columns, violations

    def _values(self, matrix: Array) -> tuple[Array, Array]:
        """Return all quantities of designs, the dynamic ones last, and their violations (N, C) in the worst case."""
        tables: list[Array] = []
        violations = np.empty((len(matrix), len(self._problem.constraints)))
        for rows in self._problem.chunks(len(matrix)):
            evaluation = self._problem.physics(matrix[rows])
            physics = [quantity(evaluation) for quantity in self._quantities]
            tables.append(np.column_stack([*physics, *dynamic_quantities(evaluation).values()]))
            others = (self._problem.physics(matrix[rows], case) for case in range(1, len(self._problem.scenes)))
            violations[rows] = np.max([self._problem.violations(one) for one in (evaluation, *others)], axis=0)
        return np.concatenate(tables), violations

    def _features(self, matrix: Array) -> Array:
        """Return (N, F) the custom features of designs."""
        if self._function is None:
            return np.empty((len(matrix), 0))
        return _checked_features(self._function, self._problem.space.designs(matrix))

    def _parameters(self, matrix: Array) -> Array:
        """Return (N, R) the parameters of designs: real ones on the unit cube, choices as indicators."""
        choices: list[Array] = [
            (matrix[:, [column]] == np.arange(n)).astype(np.float64)
            for column, n in zip(self._encoding.categorical, self._encoding.choices, strict=True)
        ]
        return np.column_stack([self._encoding.units(matrix), *choices])

    def _joint_counts(self, matrix: Array) -> Array:
        """Return (N, L) how many joints of each type designs have."""
        types, columns = self._problem.space.joint_types, DesignColumns(self._problem.space, matrix)
        kinds = np.where(columns.present, columns.choices("joint", types.index, types[0]), len(types))  # (N, M)
        return (kinds[..., None] == np.arange(len(types))).sum(axis=1).astype(np.float64)

    @cached_property
    def _probes(self) -> Array:
        return self._problem.space.normalised(self._encoding.random(PROBES, np.random.default_rng(0)))

    @cached_property
    def _scalings(self) -> Mapping[str, Scaling]:
        return {name: Scaling.of(table) for name, table in self._columns(self._probes)[0].items()}

    @cached_property
    def _quantities(self) -> tuple[Objective, ...]:
        """Return the quantities that the task allows; clearances only if they matter, because they take long."""
        problem = self._problem
        clearances = bool(problem.task.obstacles) or problem.uses("clearance")
        asked = [q for q in QUANTITIES.values() if q.name != "joints" and (clearances or "clearance" not in q.needs)]
        evaluation = problem.physics(self._probes[:FEW])
        return tuple(quantity for quantity in asked if _is_defined(quantity, evaluation))


def custom_inputs(space: DesignSpace, matrix: Array) -> Array:
    """Return (N, K) inputs for the custom parameters of designs, which mean the same in every structure.

    They are numbers on [-1, 1] on the scales of their parameters, then an indicator for each choice. Inactive
    parameters are 0, the centre of a range.
    """
    active = {p: space.active(p.name, matrix) for p in space.parameters if p.name in space.custom_names}
    column = {p: i for i, p in enumerate(space.parameters)}
    numbers = [p for p in active if isinstance(p, FloatParameter)]
    units = DesignEncoding(numbers).units(matrix[:, [column[p] for p in numbers]])
    columns = [np.where(active[p], 2.0 * units[:, i] - 1.0, 0.0) for i, p in enumerate(numbers)]
    indicators: list[Array] = [
        (matrix[:, [column[p]]] == np.arange(len(p.choices))) & active[p][:, None]
        for p in active
        if isinstance(p, CategoricalParameter)
    ]
    return np.column_stack([np.empty((len(matrix), 0)), *columns, *indicators])


def _checked_features(function: FeatureFunction, designs: Sequence[Design]) -> Array:
    """Return (N, F) the custom features of designs, or raise SettingsError."""
    rows: list[Array] = []
    for design in designs:
        given: Any = function(design)
        try:
            row = np.atleast_1d(np.asarray(given, dtype=np.float64))
        except (TypeError, ValueError):
            raise SettingsError(f"features: expected numbers, got {given!r}") from None
        rows.append(row)
        if row.shape != rows[0].shape or row.ndim != 1 or not np.all(np.isfinite(row)):
            raise SettingsError(
                f"features: expected {rows[0].size} finite numbers for every design, got {row.tolist()} for "
                f"{dict(design.params)}"
            )
    return np.array(rows)


def _is_defined(quantity: Objective, evaluation: Evaluation) -> bool:
    """Return whether a quantity exists for such arms and such a task."""
    try:
        values = quantity(evaluation)[~evaluation.is_stopped]
        return bool(len(values)) and bool(np.all(np.isfinite(values)))
    except ArmwrightError:
        return False
