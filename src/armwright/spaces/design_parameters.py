"""The parameters of a design space, and the conditions under which they are active.

A parameter of module j is inactive if the arm has fewer modules, or if its type lacks it: a roll joint has no stroke.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

from armwright.exceptions import did_you_mean
from armwright.spaces.joint_modules import MODULES
from armwright.spaces.parameters import GRID_DIGITS, GRID_ERROR, CategoricalParameter, FloatParameter, Parameter, Range
from armwright.spaces.space_schema import MAX_LENGTH, Restriction, SpaceSchema

GRID_KINDS = ("origin", "link", "stroke", "limit")


# The cache is outside the model: a copy of a space with other ranges would inherit a cached property.
@lru_cache(maxsize=64)
def named_parameters(space: SpaceSchema) -> dict[str, Parameter]:
    """Return all parameters of a space by name, in their fixed order, restrictions and grids applied."""
    steps, restrictions = dict(space.grid), dict(space.restrict)
    found: dict[str, Parameter] = {}
    for parameter in _unrestricted(space):
        if parameter.name in restrictions:
            parameter = _restrict(parameter, restrictions[parameter.name])
        step = steps.get(parameter.name, steps.get(_kind(parameter.name), 0.0))
        if step > 0.0 and isinstance(parameter, FloatParameter):
            parameter = _on_grid(parameter, step)
        found[parameter.name] = parameter
    return found


def _unrestricted(space: SpaceSchema) -> Iterator[Parameter]:
    """Yield the parameters without restrictions and grids."""
    revolute = frozenset(letter for letter, module in MODULES.items() if module.is_revolute)
    prismatic = frozenset(letter for letter, module in MODULES.items() if module.is_prismatic)
    moving = revolute | prismatic
    for axis, limits in zip("xyz", (space.origin_x, space.origin_y, space.origin_z), strict=True):
        yield FloatParameter(f"origin_{axis}", *limits, "m")
    counts = tuple(str(n) for n in range(space.min_joints, space.max_joints + 1))
    for name, choices in (("mount", space.mount), ("n_joints", counts)):
        if len(choices) > 1:
            yield CategoricalParameter(name, choices)
    yield from _per_module(space, "joint", _choice(space.joint_types))
    yield from _per_module(space, "link", _between(space.link, "m"))
    if len(space.link_directions) > 1:
        yield from _per_module(space, "direction", _choice(space.link_directions))
    if len(space.tube_names) > 1 and space.link_section.per_link:
        yield from _per_module(space, "tube", _choice(space.tube_names))
    elif len(space.tube_names) > 1:
        yield CategoricalParameter("tube", space.tube_names)
    if len(space.actuators) > 1:
        yield from _per_module(space, "motor", _choice(tuple(record.name for record in space.actuators)), moving)
    if not isinstance(space.stroke, (int, float)):
        yield from _per_module(space, "stroke", _between(space.stroke, "m"), prismatic)
    if space.limit is not None:
        yield from _per_module(space, "limit", _between(space.limit, "rad"), revolute)
    for name, custom in space.custom:
        if custom.per is None:
            yield custom.parameter(name)
        else:
            yield from _per_module(
                space, name, custom.parameter, None if moving.issuperset(space.joint_types) else moving
            )


def _per_module(
    space: SpaceSchema, kind: str, make: Callable[[str], Parameter], types: frozenset[str] | None = None
) -> Iterator[Parameter]:
    """Yield `make("kind_j")` for each module j, unless no module may have it: active for these types, None for all."""
    used = None if types is None else types & set(space.joint_types)
    if used is not None and not used:
        return
    for j in range(1, space.max_joints + 1):
        is_always_active = j <= space.min_joints and (used is None or len(used) == len(space.joint_types))
        yield replace(make(f"{kind}_{j}"), module=None if is_always_active else j, types=used)


def _choice(choices: tuple[str, ...]) -> Callable[[str], Parameter]:
    return lambda name: CategoricalParameter(name, choices)


def _between(limits: Range, unit: str) -> Callable[[str], Parameter]:
    return lambda name: FloatParameter(name, *limits, unit)


def _kind(name: str) -> str:
    """Return the kind of a parameter that a grid may name: `link` of link_3; empty for a parameter without one."""
    kind, _, suffix = name.rpartition("_")
    return kind if suffix.isdigit() or kind == "origin" else ""


def _restrict(parameter: Parameter, to: Restriction) -> Parameter:
    """Return the parameter with fewer choices or a narrower range; ValueError if these are not a part of its own."""
    values: tuple[float | str, ...] = (to,) if isinstance(to, (str, float, int)) else to
    if isinstance(parameter, CategoricalParameter):
        for choice in values:
            if choice not in parameter.choices:
                raise ValueError(
                    f"restrict: {parameter.name} = {choice!r} is not one of {', '.join(parameter.choices)}"
                )
        if not values:
            raise ValueError(f"restrict: {parameter.name} has no choice left")
        return replace(parameter, choices=tuple(c for c in parameter.choices if c in values))
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
    known = {parameter.name: parameter for parameter in _unrestricted(space)}
    real = [parameter for parameter in known.values() if isinstance(parameter, FloatParameter)]
    kinds = [*GRID_KINDS, *(name for name, custom in space.custom if custom.per is not None)]
    _check_known("restrict", [name for name, _ in space.restrict], list(known))
    _check_known("grid", [name for name, _ in space.grid], [*kinds, *(parameter.name for parameter in real)])
    _check_known("tie", [name for pair in space.tie for name in pair], list(known))
    for name, step in space.grid:
        if not GRID_ERROR < step <= MAX_LENGTH:
            raise ValueError(f"grid: {name} = {step:g}: expected a step above 0")
        for parameter in real:
            if name in (parameter.name, _kind(parameter.name)):
                if parameter.log:
                    raise ValueError(f"grid: {parameter.name}: expected a parameter on a linear scale, got scale: log")
                if parameter.integer and not step.is_integer():
                    raise ValueError(f"grid: {parameter.name} = {step:g}: expected a whole number, as its values are")
    _check_ties(space)


def _check_known(key: str, names: Iterable[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f'{key}: unknown parameter "{name}".{did_you_mean(name, known)}')


def _check_ties(space: SpaceSchema) -> None:
    parameters, ties = named_parameters(space), dict(space.tie)
    for name, other in ties.items():
        if other in ties:
            raise ValueError(f"tie: {name} is tied to {other}, which is tied itself; tie both to a free parameter")
        tied, free = parameters[name], parameters[other]
        if tied != replace(free, name=name, module=tied.module, types=tied.types):
            raise ValueError(f"tie: {name} and {other} have different ranges or choices")
        if free.types is not None or (free.module or 0) > (tied.module or 0):
            raise ValueError(f"tie: {other} may be inactive while {name} is active; reverse the tie")
