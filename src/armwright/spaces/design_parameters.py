"""The parameters of a design space, and the conditions under which they are active.

A parameter of module j is inactive if the arm has fewer modules, or if its type does not have the
parameter: a roll joint has no stroke.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

from armwright.exceptions import did_you_mean
from armwright.spaces.joint_modules import MODULES
from armwright.spaces.parameters import (
    GRID_DIGITS,
    GRID_ERROR,
    CategoricalParameter,
    FloatParameter,
    Parameter,
    ParameterValue,
    Range,
)
from armwright.spaces.space_schema import MAX_LENGTH, Restriction, SpaceSchema

GRID_KINDS = ("origin", "link", "stroke", "limit")


@dataclass(frozen=True)
class ConditionalParameter:
    """A parameter and the condition under which it is active."""

    parameter: Parameter
    # The module, counted from 1, that the arm must have; None if the parameter is always active
    module: int | None = None
    types: frozenset[str] | None = None  # the types that this module may have; None for any

    @property
    def name(self) -> str:
        """The name of the parameter."""
        return self.parameter.name

    def is_active(self, params: Mapping[str, ParameterValue], max_joints: int) -> bool:
        """Return whether the parameter is active, given the values of the parameters before it."""
        if self.module is None:
            return True
        if self.module > int(params.get("n_joints", max_joints)):
            return False
        return self.types is None or params.get(f"joint_{self.module}") in self.types


# The cache is outside the model: a copy of a space with other ranges would inherit a cached property.
@lru_cache(maxsize=64)
def conditional_parameters(space: SpaceSchema) -> dict[str, ConditionalParameter]:
    """Return all parameters of a space by name, in their fixed order, restrictions and grids applied."""
    steps, restrictions = dict(space.grid), dict(space.restrict)
    entries: dict[str, ConditionalParameter] = {}
    for entry in _unrestricted(space):
        parameter = entry.parameter
        if parameter.name in restrictions:
            parameter = _restrict(parameter, restrictions[parameter.name])
        step = steps.get(parameter.name, steps.get(_kind(parameter.name), 0.0))
        if step > 0.0 and isinstance(parameter, FloatParameter):
            parameter = _on_grid(parameter, step)
        entries[entry.name] = replace(entry, parameter=parameter)
    return entries


def _unrestricted(space: SpaceSchema) -> tuple[ConditionalParameter, ...]:
    """Return the parameters without restrictions and grids."""
    revolute = tuple(letter for letter, module in MODULES.items() if module.is_revolute)
    prismatic = tuple(letter for letter, module in MODULES.items() if module.is_prismatic)
    entries = [*_arm_parameters(space), *_per_module(space, "joint", space.joint_types)]
    entries += _per_module(space, "link", space.link, "m")
    if len(space.link_directions) > 1:
        entries += _per_module(space, "direction", space.link_directions)
    if len(space.tube_names) > 1 and space.link_section.per_link:
        entries += _per_module(space, "tube", space.tube_names)
    elif len(space.tube_names) > 1:
        entries.append(ConditionalParameter(CategoricalParameter("tube", space.tube_names)))
    if len(space.actuators) > 1:
        names = tuple(record.name for record in space.actuators)
        entries += _per_module(space, "motor", names, types=revolute + prismatic)
    if not isinstance(space.stroke, (int, float)):
        entries += _per_module(space, "stroke", space.stroke, "m", prismatic)
    if space.limit is not None:
        entries += _per_module(space, "limit", space.limit, "rad", revolute)
    return (*entries, *_custom_parameters(space, revolute + prismatic))


def _custom_parameters(space: SpaceSchema, moving: tuple[str, ...]) -> Iterator[ConditionalParameter]:
    """Yield the custom parameters; those per joint for each module of a type that moves."""
    types = () if set(space.joint_types) <= set(moving) else moving
    for name, custom in space.custom:
        if custom.per is None:
            yield ConditionalParameter(custom.parameter(name))
        else:
            for j, always, used in _modules(space, types):
                yield ConditionalParameter(custom.parameter(f"{name}_{j}"), None if always else j, used)


def _arm_parameters(space: SpaceSchema) -> Iterator[ConditionalParameter]:
    """Yield the parameters of the whole arm: base position, mount and number of modules."""
    for axis, (low, high) in zip("xyz", (space.origin_x, space.origin_y, space.origin_z), strict=True):
        yield ConditionalParameter(FloatParameter(f"origin_{axis}", low, high, "m"))
    if len(space.mount) > 1:
        yield ConditionalParameter(CategoricalParameter("mount", space.mount))
    if space.min_joints < space.max_joints:
        counts = tuple(str(n) for n in range(space.min_joints, space.max_joints + 1))
        yield ConditionalParameter(CategoricalParameter("n_joints", counts))


def _per_module(
    space: SpaceSchema,
    kind: str,
    values: tuple[str, ...] | Range,
    unit: str = "",
    types: tuple[str, ...] = (),
) -> Iterator[ConditionalParameter]:
    """Yield one parameter for each module.

    Args:
        space: The design space.
        kind: The name of the parameters, without the number of the module.
        values: The range, or the choices if there is no unit.
        unit: The unit of a real parameter.
        types: The module types for which the parameters are active; empty for all.
    """
    for j, always, used in _modules(space, types):
        if unit:
            parameter = FloatParameter(f"{kind}_{j}", float(values[0]), float(values[1]), unit)
        else:
            parameter = CategoricalParameter(f"{kind}_{j}", cast("tuple[str, ...]", values))
        yield ConditionalParameter(parameter, None if always else j, used)


def _modules(space: SpaceSchema, types: tuple[str, ...]) -> Iterator[tuple[int, bool, frozenset[str] | None]]:
    """Yield each module, counted from 1, for which a parameter may be active.

    With it: whether the parameter is always active there, and the types for which it is; None for all.
    """
    used = frozenset(letter for letter in space.joint_types if letter in types) if types else None
    if used is not None and not used:
        return
    for j in range(1, space.max_joints + 1):
        yield j, j <= space.min_joints and (used is None or len(used) == len(space.joint_types)), used


def _kind(name: str) -> str:
    """Return the kind of a parameter that a grid may name: `link` of link_3; empty for a parameter without one."""
    kind, _, suffix = name.rpartition("_")
    return kind if suffix.isdigit() or kind == "origin" else ""


def _restrict(parameter: Parameter, to: Restriction) -> Parameter:
    """Return the parameter with fewer choices or a narrower range.

    Raises:
        ValueError: If the restriction is not a part of the parameter.
    """
    values: tuple[float | str, ...] = (to,) if isinstance(to, (str, float, int)) else to
    if isinstance(parameter, CategoricalParameter):
        for choice in values:
            if choice not in parameter.choices:
                raise ValueError(
                    f"restrict: {parameter.name} = {choice!r} is not one of {', '.join(parameter.choices)}"
                )
        if not values:
            raise ValueError(f"restrict: {parameter.name} has no choice left")
        return CategoricalParameter(parameter.name, tuple(c for c in parameter.choices if c in values))
    numbers = [float(value) for value in values if not isinstance(value, str)]
    if not 1 <= len(numbers) == len(values) <= 2:
        raise ValueError(f"restrict: {parameter.name} = {to!r} is neither a number nor a range [{parameter.unit}]")
    low, high = numbers[0], numbers[-1]
    if not parameter.low <= low <= high <= parameter.high:
        raise ValueError(
            f"restrict: {parameter.name} = [{low:g}, {high:g}] {parameter.unit} is outside "
            f"[{parameter.low:g}, {parameter.high:g}]"
        )
    if parameter.integer and not (low.is_integer() and high.is_integer()):
        raise ValueError(f"restrict: {parameter.name} = [{low:g}, {high:g}]: expected whole numbers")
    return replace(parameter, low=low, high=high)


def _on_grid(parameter: FloatParameter, step: float) -> FloatParameter:
    """Return the parameter on a grid that starts at its lower bound; its upper bound is the last grid point."""
    steps = math.floor((parameter.high - parameter.low) / step + GRID_ERROR)
    return replace(parameter, high=round(parameter.low + steps * step, GRID_DIGITS), step=step)


def check_parameters(space: SpaceSchema) -> None:
    """Raise ValueError for restrictions, grids and ties that do not fit the parameters."""
    names = [entry.name for entry in _unrestricted(space)]
    real = [entry.name for entry in _unrestricted(space) if isinstance(entry.parameter, FloatParameter)]
    _check_known("restrict", [name for name, _ in space.restrict], names)
    kinds = [*GRID_KINDS, *(name for name, custom in space.custom if custom.per is not None)]
    _check_known("grid", [name for name, _ in space.grid], [*kinds, *real])
    _check_known("tie", [name for pair in space.tie for name in pair], names)
    for name, step in space.grid:
        if not GRID_ERROR < step <= MAX_LENGTH:
            raise ValueError(f"grid: {name} = {step:g}: expected a step above 0")
        for entry in _unrestricted(space):
            if name in (entry.name, _kind(entry.name)) and isinstance(entry.parameter, FloatParameter):
                _check_step(entry.parameter, step)
    _check_ties(space)


def _check_step(parameter: FloatParameter, step: float) -> None:
    if parameter.log:
        raise ValueError(f"grid: {parameter.name}: expected a parameter on a linear scale, got scale: log")
    if parameter.integer and not step.is_integer():
        raise ValueError(f"grid: {parameter.name} = {step:g}: expected a whole number, as its values are")


def _check_known(key: str, names: Iterable[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f'{key}: unknown parameter "{name}".{did_you_mean(name, known)}')


def _check_ties(space: SpaceSchema) -> None:
    parameters, ties = conditional_parameters(space), dict(space.tie)
    for name, other in ties.items():
        if other in ties:
            raise ValueError(f"tie: {name} is tied to {other}, which is tied itself; tie both to a free parameter")
        tied, free = parameters[name], parameters[other]
        if tied.parameter != replace(free.parameter, name=name):
            raise ValueError(f"tie: {name} and {other} have different ranges or choices")
        if free.types is not None or (free.module or 0) > (tied.module or 0):
            raise ValueError(f"tie: {other} may be inactive while {name} is active; reverse the tie")
