"""Designs as rows of numbers, and back.

A matrix has one row per design and one column per parameter of the space. A choice is represented by its index.
Inactive parameters have their default value: the middle of a range, the first of the choices.
"""

from collections.abc import Iterable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.spaces.design_parameters import ConditionalParameter, conditional_parameters, parameters_of
from armwright.spaces.parameters import CategoricalParameter, Design, FloatParameter, Parameter, ParameterValue
from armwright.spaces.space_schema import SpaceSchema


def encode(space: SpaceSchema, designs: Sequence[Design]) -> Array:
    """Return the (N, P) matrix of N designs."""
    parameters = parameters_of(space)
    columns = [
        [_number(parameter, design.params.get(parameter.name)) for design in designs] for parameter in parameters
    ]
    return np.array(columns, dtype=np.float64).T.reshape(len(designs), len(parameters))


def decode(space: SpaceSchema, matrix: Array) -> list[Design]:
    """Return the designs of the (N, P) rows."""
    entries = list(enumerate(conditional_parameters(space)))
    designs: list[Design] = []
    for row in normalise(space, matrix).tolist():
        params: dict[str, ParameterValue] = {}
        for i, entry in entries:
            if entry.is_active(params, space.max_joints):
                params[entry.name] = _value(entry.parameter, row[i])
        designs.append(Design(params))
    return designs


def normalise(space: SpaceSchema, matrix: Array) -> Array:
    """Return the (N, P) rows as `encode` would: tied values equal, inactive parameters at their defaults."""
    entries = conditional_parameters(space)
    if not space.tie and all(entry.module is None for entry in entries):
        return matrix
    rows = matrix.copy()
    column = {entry.name: i for i, entry in enumerate(entries)}
    for name, other in space.tie:
        rows[:, column[name]] = rows[:, column[other]]
    for i, entry in enumerate(entries):
        if entry.module is not None:
            rows[~_active(space, rows, entry, column), i] = _number(entry.parameter, None)
    return rows


def _active(
    space: SpaceSchema, matrix: Array, entry: ConditionalParameter, column: dict[str, int]
) -> NDArray[np.bool_]:
    """Return the (N,) designs for which a parameter with a condition is active."""
    active = np.ones(len(matrix), dtype=bool)
    if "n_joints" in column:
        active &= cast("int", entry.module) <= matrix[:, column["n_joints"]] + space.min_joints
    if entry.types is not None:
        at = column[f"joint_{entry.module}"]
        letters = cast("CategoricalParameter", parameters_of(space)[at]).choices
        active &= np.array([letter in entry.types for letter in letters])[matrix[:, at].astype(np.intp)]
    return active


def sample(space: SpaceSchema, n: int, seed: int) -> list[Design]:
    """Return `n` designs, uniform in every parameter."""
    rng = np.random.default_rng(seed)
    parameters = parameters_of(space)
    rows = [[_draw(parameter, rng) for parameter in parameters] for _ in range(n)]
    return decode(space, np.array(rows, dtype=np.float64).reshape(n, len(parameters)))


def clip(
    space: SpaceSchema, origin: Iterable[float], joints: str, links: Iterable[float], like: Design | None = None
) -> Design:
    """Return the design with these numbers, each moved into its range.

    Args:
        space: The design space.
        origin: (3,) base position [m].
        joints: The letters of the joint modules.
        links: (D,) link lengths [m].
        like: The source of all other values. Those that it lacks have their defaults; actuators are by default the
            strongest at the base and the weakest at the tip.
    """
    known: dict[str, Any] = {f"motor_{j}": name for j, name in enumerate(_default_motors(space), start=1)}
    known |= {} if like is None else dict(like.params)
    known |= {f"origin_{axis}": value for axis, value in zip("xyz", origin, strict=True)}
    known |= {f"joint_{j}": letter for j, letter in enumerate(joints, start=1)}
    known |= {f"link_{j}": length for j, length in enumerate(links, start=1)}
    known["n_joints"] = str(min(max(len(joints), space.min_joints), space.max_joints))
    row = [_number(p, _clip(p, known[p.name]) if p.name in known else None) for p in parameters_of(space)]
    return decode(space, np.array([row], dtype=np.float64))[0]


def _default_motors(space: SpaceSchema) -> tuple[str, ...]:
    """Return one actuator for each module, if there is a choice: from the strongest at the base to the weakest."""
    if len(space.actuators) < 2:
        return ()
    ranked = sorted(space.arm_actuators, key=lambda actuator: -actuator.effort)
    return tuple(ranked[len(ranked) * j // space.max_joints].name for j in range(space.max_joints))


def _default(parameter: Parameter) -> ParameterValue:
    if isinstance(parameter, CategoricalParameter):
        return parameter.choices[0]
    return parameter.nearest((parameter.low + parameter.high) / 2)


def _clip(parameter: Parameter, value: Any) -> ParameterValue:
    if isinstance(parameter, FloatParameter):
        return parameter.nearest(value)
    return value if value in parameter.choices else parameter.choices[0]


def _number(parameter: Parameter, value: ParameterValue | None) -> float:
    """Return a value as a number; the default for None."""
    value = _default(parameter) if value is None else value
    return value if isinstance(parameter, FloatParameter) else parameter.choices.index(value)  # pyright: ignore[reportReturnType, reportArgumentType]


def _value(parameter: Parameter, number: float) -> ParameterValue:
    return number if isinstance(parameter, FloatParameter) else parameter.choices[int(number)]


def _draw(parameter: Parameter, rng: np.random.Generator) -> float:
    if isinstance(parameter, FloatParameter):
        return parameter.nearest(float(rng.uniform(parameter.low, parameter.high)))
    return float(rng.integers(len(parameter.choices)))
