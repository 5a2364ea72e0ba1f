"""Targets from files of points and pasted text: CSV, tabs or spaces, with a header, a commented header or none."""

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from armwright.exceptions import TaskError
from armwright.files import read_text
from armwright.rotations import rotation_from_quaternion, rpy_from_rotation
from armwright.tasks.targets import TARGET_NAME, Point, Target
from armwright.tasks.task import MAX_TARGETS
from armwright.yaml_documents import check_document

MAX_BYTES = 16 * 1024 * 1024
MAX_NORM_ERROR = 0.01  # of a quaternion: it is normalised after rounding in the file
UNITS = {"m": 1.0, "mm": 1e-3}  # [m]
POSITION, NAME = ("x", "y", "z"), "name"
ANGLES, QUATERNION, AXIS = ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw"), ("ax", "ay", "az")
_NO_UNIT = {"": 1.0, "1": 1.0, "-": 1.0}
_ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}
# Units of each column that is read
_COLUMNS: Mapping[str, Mapping[str, float]] = {
    **dict.fromkeys(POSITION, UNITS),
    **dict.fromkeys(ANGLES, _ANGLE_UNITS),
    **dict.fromkeys((*QUATERNION, *AXIS), _NO_UNIT),
    NAME: {},
}
_ALIASES = {"tx": "x", "ty": "y", "tz": "z"}  # trajectories of the TUM format
_HEAD = re.compile(r"([^\[(]*)(?:[\[(]([^\])]*)[\])])?")
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE | re.ASCII)
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_QUOTED = re.compile(r'"[^"]*"')
_SPACE_BEFORE_UNIT = re.compile(r"(?<!\s)\s+(?=[\[(])")  # x [mm] is one name

Row = tuple[int, list[str]]  # number of the line, and its cells


@dataclass(frozen=True)
class TargetList:
    """Targets that a text holds."""

    targets: tuple[Point | Target, ...]  # points [m], or records if they have a name or a tool direction
    notes: tuple[str, ...]  # what a user should know about how the text was read, one sentence each


def read_points(path: Path, unit: str | None = None, offset: Point = (0.0, 0.0, 0.0)) -> TargetList:
    """Read targets from a file of points.

    The header names the columns: x, y, z (or tx, ty, tz); name; and a tool direction as roll, pitch, yaw, as a
    quaternion qx, qy, qz, qw, or as the direction ax, ay, az of the tool's z axis. Units are in brackets, such as
    `x [mm]` and `yaw [deg]`. Without a header, a file has three columns x, y, z.

    Args:
        path: The file: CSV, or columns separated by semicolons, tabs or spaces.
        unit: Unit of x, y and z if the header states none, `m` or `mm`; None for metres.
        offset: Vector added to every point [m].

    Raises:
        TaskError: If columns or units are ambiguous, a cell is not a finite number, or there is no point.
    """
    return parse_points(read_text(path, MAX_BYTES, TaskError), unit, str(path), offset)


def parse_points(text: str, unit: str | None, where: str, offset: Point = (0.0, 0.0, 0.0)) -> TargetList:
    """Return the targets of a text as `read_points` does; `where` names it in messages."""
    if unit is not None and unit not in UNITS:
        raise TaskError(f'unit: expected {" or ".join(UNITS)}, got "{unit}"')
    (first, header), *rows = _read_table(text, where)
    columns = _find_columns(header, unit, f"{where}, line {first}")
    read = {index for index, _ in columns.values()}
    unused = [cell for index, cell in enumerate(header) if index not in read]
    notes = [f"columns not used: {quote_names(unused)}"] if unused else []
    numbers = {name: column for name, column in columns.items() if name != NAME}
    cells_of_numbers = ((line, cells[index]) for line, cells in rows for index, _ in numbers.values())
    if comma := _decimal_comma(cells_of_numbers, where)[:40]:
        notes.append(f"numbers have decimal commas: {comma} is read as {comma.replace(',', '.')}")
    targets: list[Point | Target] = []
    lines: dict[str, int] = {}
    for line, cells in rows:
        place, name = f"{where}, line {line}", cells[columns[NAME][0]] if NAME in columns else ""
        values = [_read_number(cells[i], f"{place}: {key}") * size for key, (i, size) in numbers.items()]
        if not re.fullmatch(TARGET_NAME, name):
            raise TaskError(
                f"{place}: name: expected a letter, then at most 39 letters, digits, spaces, dots, _ or -, "
                f"got {name[:60]!r}; rename the column to leave the names out"
            )
        if name and lines.setdefault(name, line) != line:
            raise TaskError(f'{place}: the name "{name}" is also in line {lines[name]}; rename one')
        position = [_tidy(value + shift) for value, shift in zip(values[:3], offset, strict=True)]
        record = {NAME: name, "position": position, **_direction(tuple(numbers)[3:], values[3:], place)}
        target = check_document(record, Target, TaskError, place)
        targets.append(target.position if target.is_plain else target)
    return TargetList(tuple(targets), tuple(notes))


def quote_names(names: Iterable[str]) -> str:
    """Return names in quotes, one after the other; long ones and long lists are cut."""
    quoted = [repr(name[:40]) if name else "(unnamed)" for name in names]
    return ", ".join(quoted[:20]) + (f" and {len(quoted) - 20} more" if len(quoted) > 20 else "")


def _read_table(text: str, where: str) -> Iterator[Row]:
    """Yield the header, by default x, y, z at the line of the first row, then all rows, as long as the header.

    The first line is the header if none of its cells is a number; if one is, a comment above may be the header. Columns
    are separated by semicolons, tabs, commas or spaces: the first of these that the first row contains.
    """
    lines = [(number, line.strip(" ")) for number, line in enumerate(text.splitlines(), start=1)]
    comments = [(number, line.lstrip("# ")) for number, line in lines if line.startswith("#")]
    lines = [(number, line) for number, line in lines if line.strip(' \t;,"') and not line.startswith("#")]
    header: Row | None = None
    if lines:
        names = _split_header(*lines[0], where)
        is_row = any(_NUMBER.fullmatch(cell) or _NOT_FINITE.fullmatch(cell) for cell in names)
        header = None if is_row else (lines.pop(0)[0], names)
    if not lines:
        raise TaskError(f"{where} has no points: expected three numbers x, y, z per line")
    if len(lines) > MAX_TARGETS:
        raise TaskError(f"{where}: expected at most {MAX_TARGETS:,} points, got {len(lines):,}; leave some out")
    delimiter = _delimiter(lines[0][1])
    rows = [(number, _split(line, f"{where}, line {number}", delimiter)) for number, line in lines]
    first, cells = rows[0]
    for number, line in reversed(comments):
        if header is None and number < first:
            with suppress(TaskError):  # prose with a quote
                names = _split_header(number, line, where)
                if len(names) == len(cells) and sum(_read_head(name)[0] in _COLUMNS for name in names) >= 2:
                    header = number, names
    hint = "; numbers with decimal commas need semicolons or tabs between the columns" if delimiter == "," else ""
    if header is None and len(cells) < len(POSITION):
        raise TaskError(f"{where}, line {first}: expected three numbers x, y, z, got {quote_names(cells)}{hint}")
    if header is None and len(cells) > len(POSITION):
        raise TaskError(
            f"{where}, line {first}: expected a header, as there are {len(cells)} columns ({quote_names(cells)}); "
            f"add a first line that names them, such as name,x,y,z{hint}"
        )
    yield header or (first, list(POSITION))
    width = len(header[1] if header else POSITION)
    for number, cells in rows:
        if len(cells) > width:
            raise TaskError(
                f"{where}, line {number}: expected {width} columns as in the first line, got {len(cells)} "
                f"({quote_names(cells)}){hint}"
            )
        yield number, cells + [""] * (width - len(cells))


def _delimiter(line: str) -> str:
    """Return what separates the cells of a line."""
    bare = _QUOTED.sub("", line)
    return next((delimiter for delimiter in ";\t," if delimiter in bare), " ")


def _split_header(number: int, line: str, where: str) -> list[str]:
    delimiter = _delimiter(line)
    return _split(_SPACE_BEFORE_UNIT.sub("", line) if delimiter == " " else line, f"{where}, line {number}", delimiter)


def _split(line: str, where: str, delimiter: str) -> list[str]:
    """Return the cells of a line without empty ones at its end."""
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error as fault:
        raise TaskError(f"{where}: expected cells separated by {delimiter!r}, got {line[:60]!r}: {fault}") from fault
    cells = [cell.strip() for cell in cells]
    while cells and not cells[-1]:
        del cells[-1]
    return cells


def _read_head(cell: str) -> tuple[str, str]:
    """Return the name of a column and its unit, which may be empty."""
    match = _HEAD.fullmatch(cell)
    name, unit = match.groups("") if match else ("", "")
    return _ALIASES.get(name.strip().lower(), name.strip().lower()), unit.strip()


def _find_columns(header: Sequence[str], unit: str | None, where: str) -> dict[str, tuple[int, float]]:
    """Return index and size of the unit [m] or [rad] of x, y, z, of the columns of a tool direction, and of names."""
    listed = f"(columns: {quote_names(header)})"
    heads: dict[str, tuple[int, str]] = {}
    for index, cell in enumerate(header):
        name, own = _read_head(cell)
        if name in heads:
            raise TaskError(f"{where}: expected one column {name}, got two; rename or remove one {listed}")
        if name in _COLUMNS:
            heads[name] = index, own
    given = [kind for kind in (ANGLES, QUATERNION, AXIS) if not heads.keys().isdisjoint(kind)]
    for kind in (POSITION, *given):
        if missing := [name for name in kind if name not in heads]:
            raise TaskError(
                f"{where}: expected columns {', '.join(kind)}, got no {', '.join(missing)}; rename columns {listed}"
            )
    if len(given) > 1:
        both = " and ".join(", ".join(kind) for kind in given)
        raise TaskError(f"{where}: expected one kind of tool direction, got {both}; rename or remove one {listed}")
    if unit is None and len({bool(heads[name][1]) for name in POSITION}) > 1:
        texts = quote_names(header[heads[name][0]] for name in POSITION)
        raise TaskError(f"{where}: expected a unit in each of {texts} or in none; write x [mm], y [mm], z [mm]")
    columns = {NAME: (heads[NAME][0], 1.0)} if NAME in heads else {}
    for name in (*POSITION, *(given[0] if given else ())):
        index, own = heads[name]
        if name in POSITION and own in UNITS and unit not in (None, own):
            raise TaskError(f'{where}: "{header[index]}" states {own}, but the unit is set to {unit}; use {own}')
        own = own or unit or "m" if name in POSITION else own
        allowed = _COLUMNS[name]
        if own not in allowed:
            units = " or ".join(f"{name} [{known}]" for known in allowed)
            expected = "no unit; rename a column that holds something else" if allowed is _NO_UNIT else units
            raise TaskError(f'{where}: "{header[index]}": expected {expected}')
        columns[name] = index, allowed[own]
    return columns


def _decimal_comma(cells: Iterable[tuple[int, str]], where: str) -> str:
    """Return the first number with a decimal comma; empty if there is none, TaskError if others have points."""
    first: dict[str, tuple[int, str]] = {}
    for number, cell in cells:
        for mark in ",.":
            if mark in cell and _NUMBER.fullmatch(cell):
                first.setdefault(mark, (number, cell))
    if len(first) == 2:
        (line, comma), (other, point) = first[","], first["."]
        raise TaskError(
            f"{where}, line {line}: {comma[:40]!r} has a decimal comma, but {point[:40]!r} in line {other} a decimal "
            "point; write all numbers alike"
        )
    return first.get(",", (0, ""))[1]


def _read_number(cell: str, where: str) -> float:
    value = float(cell.replace(",", ".")) if _NUMBER.fullmatch(cell) else math.nan
    if not math.isfinite(value):
        raise TaskError(f"{where}: expected a finite number, got {cell[:60]!r}")
    return value


def _direction(columns: tuple[str, ...], values: list[float], place: str) -> dict[str, list[float]]:
    """Return the key of a tool direction with its value; empty for none."""
    if columns == QUATERNION:
        norm = math.hypot(*values)
        if abs(norm - 1.0) > MAX_NORM_ERROR:
            raise TaskError(f"{place}: qx, qy, qz, qw: expected a quaternion of length 1, got {values} of {norm:.4g}")
        x, y, z, w = values
        values = list(rpy_from_rotation(rotation_from_quaternion(x, y, z, w)))
    if not columns:
        return {}
    return {"axis": values} if columns == AXIS else {"orientation": list(map(_tidy, values))}


def _tidy(value: float) -> float:
    return round(value, 9) + 0.0  # no -0.0
