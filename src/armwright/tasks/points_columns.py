"""Columns of points, found by their names: positions, tool directions and names, with units in brackets."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from armwright.exceptions import TaskError

UNITS = {"m": 1.0, "mm": 1e-3}  # [m]
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}  # [rad]
POSITION = ("x", "y", "z")
ANGLES, QUATERNION, AXIS = ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw"), ("ax", "ay", "az")
DIRECTIONS = (ANGLES, QUATERNION, AXIS)
NAME = "name"
_KNOWN = frozenset((*POSITION, *ANGLES, *QUATERNION, *AXIS, NAME))
_ALIASES = {"tx": "x", "ty": "y", "tz": "z"}  # trajectories of the TUM format
_HEAD = re.compile(r"(?P<name>[^\[(]*)([\[(](?P<unit>[^\])]*)[\])])?")


@dataclass(frozen=True)
class Columns:
    """What the columns of a table hold.

    Attributes:
        indices: Index of each column that is read, by its name: POSITION, all of one of DIRECTIONS, and NAME.
        factors: Metres or radians per unit of columns with a unit.
        direction: The one of DIRECTIONS that is read; empty for none.
        unused: Heads of the other columns.
    """

    indices: Mapping[str, int]
    factors: Mapping[str, float]
    direction: tuple[str, ...]
    unused: tuple[str, ...]


@dataclass(frozen=True)
class _Head:
    """The text of a header's cell, and the name and unit in it."""

    text: str
    name: str
    unit: str


def names_columns(header: Sequence[str]) -> bool:
    """Return True if at least two cells are names of columns that are read."""
    return sum(_read_head(cell).name in _KNOWN for cell in header) >= 2


def find_columns(header: Sequence[str], unit: str | None, where: str) -> Columns:
    """Find the columns that are read by their names.

    Args:
        header: The cells of the header, such as `x [mm]`.
        unit: Unit of positions whose header states none; None for metres.
        where: Names the header in messages.

    Raises:
        TaskError: If columns are missing, given twice or in conflict, or if a unit is missing or unknown.
    """
    if unit is not None and unit not in UNITS:
        raise TaskError(f'unit: expected {" or ".join(UNITS)}, got "{unit}"')
    heads = [_read_head(cell) for cell in header]
    listed = f"columns: {quote_names(header)}"
    indices: dict[str, int] = {}
    for index, head in enumerate(heads):
        if head.name in indices:
            raise TaskError(f"{where}: expected one column {head.name}, got two; rename or remove one ({listed})")
        if head.name in _KNOWN:
            indices[head.name] = index
    given = [names for names in DIRECTIONS if not indices.keys().isdisjoint(names)]
    for names in (POSITION, *given):
        missing = [name for name in names if name not in indices]
        if missing:
            raise TaskError(
                f"{where}: expected columns {', '.join(names)}, got no {', '.join(missing)}; rename columns ({listed})"
            )
    if len(given) > 1:
        both = " and ".join(", ".join(names) for names in given)
        raise TaskError(f"{where}: expected one kind of tool direction, got {both}; rename or remove one ({listed})")
    direction = given[0] if given else ()
    factors = _length_factors([heads[indices[name]] for name in POSITION], unit, where)
    factors |= _direction_factors([heads[indices[name]] for name in direction], where)
    unused = tuple(head.text for index, head in enumerate(heads) if index not in indices.values())
    return Columns(indices, factors, direction, unused)


def quote_names(names: Iterable[str]) -> str:
    """Return names in quotes, one after the other; long ones and long lists are cut."""
    quoted = [repr(name[:40]) if name else "(unnamed)" for name in names]
    return ", ".join(quoted[:20]) + (f" and {len(quoted) - 20} more" if len(quoted) > 20 else "")


def _read_head(cell: str) -> _Head:
    match = _HEAD.fullmatch(cell)
    if match is None:
        return _Head(cell, "", "")
    name = match["name"].strip().lower()
    return _Head(cell, _ALIASES.get(name, name), (match["unit"] or "").strip())


def _length_factors(heads: Sequence[_Head], unit: str | None, where: str) -> dict[str, float]:
    """Return the metres per unit of the position's columns."""
    for head in heads:
        if head.unit and head.unit not in UNITS:
            raise TaskError(f'{where}: "{head.text}": expected the unit {" or ".join(UNITS)}')
        if head.unit and unit and head.unit != unit:
            raise TaskError(
                f'{where}: "{head.text}" states {head.unit}, but the unit is set to {unit}; use {head.unit}'
            )
    if unit is None and len({bool(head.unit) for head in heads}) > 1:
        texts = quote_names(head.text for head in heads)
        raise TaskError(f"{where}: expected a unit in each of {texts} or in none; write x [mm], y [mm], z [mm]")
    return {head.name: UNITS[head.unit or unit or "m"] for head in heads}


def _direction_factors(heads: Sequence[_Head], where: str) -> dict[str, float]:
    """Return the radians per unit of angles; TaskError if an angle states none, or another column one."""
    angles = [head for head in heads if head.name in ANGLES]
    for head in angles:
        if head.unit not in ANGLE_UNITS:
            raise TaskError(f'{where}: "{head.text}": expected a unit, {head.name} [deg] or {head.name} [rad]')
    for head in heads:
        if head not in angles and head.unit not in ("", "1", "-"):
            raise TaskError(f'{where}: "{head.text}": expected no unit; rename a column that holds something else')
    return {head.name: ANGLE_UNITS[head.unit] for head in angles}
