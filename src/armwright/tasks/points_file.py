"""Targets from files of points and pasted text."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from armwright.exceptions import TaskError
from armwright.files import read_text
from armwright.rotations import rotation_from_quaternion, rpy_from_rotation
from armwright.tasks.points_columns import (
    ANGLES,
    AXIS,
    NAME,
    POSITION,
    QUATERNION,
    Columns,
    find_columns,
    names_columns,
    quote_names,
)
from armwright.tasks.points_table import NUMBER, Row, Table, read_table
from armwright.tasks.targets import TARGET_NAME, Point, Target
from armwright.tasks.task import MAX_TARGETS
from armwright.yaml_documents import check_document

MAX_BYTES = 16 * 1024 * 1024
MAX_NORM_ERROR = 0.01  # of a quaternion: it is normalised after rounding in the file


@dataclass(frozen=True)
class TargetList:
    """Targets that a text holds.

    Attributes:
        targets: The targets: points [m], or records if they have a name or a tool direction.
        notes: What a user should know about how the text was read, one sentence each.
    """

    targets: tuple[Point | Target, ...]
    notes: tuple[str, ...]


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
    table = read_table(text, where, names_columns, MAX_TARGETS)
    if table.header is None and len(table.rows[0][1]) != len(POSITION):
        raise TaskError(_without_header(table, where))
    columns = find_columns(table.header or POSITION, unit, f"{where}, line {table.first}")
    _check_rows(table, where)
    notes = [f"columns not used: {quote_names(columns.unused)}"] if columns.unused else []
    if comma := _decimal_comma(table.rows, columns, where)[:40]:
        notes.append(f"numbers have decimal commas: {comma} is read as {comma.replace(',', '.')}")
    targets = tuple(_read_row(row, columns, where, offset) for row in table.rows)
    _check_names(targets, table.rows, where)
    return TargetList(targets, tuple(notes))


def _without_header(table: Table, where: str) -> str:
    cells = table.rows[0][1]
    if len(cells) < len(POSITION):
        return f"{where}, line {table.first}: expected three numbers x, y, z, got {quote_names(cells)}{table.hint}"
    return (
        f"{where}, line {table.first}: expected a header, as there are {len(cells)} columns ({quote_names(cells)}); "
        f"add a first line that names them, such as name,x,y,z{table.hint}"
    )


def _check_rows(table: Table, where: str) -> None:
    """Raise TaskError for a row that is longer than the header."""
    width = len(table.header or POSITION)
    for number, cells in table.rows:
        if len(cells) > width:
            raise TaskError(
                f"{where}, line {number}: expected {width} columns as in the first line, got {len(cells)} "
                f"({quote_names(cells)}){table.hint}"
            )


def _decimal_comma(rows: Sequence[Row], columns: Columns, where: str) -> str:
    """Return the first number with a decimal comma; empty if there is none, TaskError if others have points."""
    first: dict[str, tuple[int, str]] = {}
    for number, cells in rows:
        for cell in _number_cells(cells, columns).values():
            for mark in ",.":
                if mark in cell and mark not in first and NUMBER.fullmatch(cell):
                    first[mark] = number, cell
    if len(first) == 2:
        (line, comma), (other, point) = first[","], first["."]
        raise TaskError(
            f"{where}, line {line}: {comma[:40]!r} has a decimal comma, but {point[:40]!r} in line {other} a decimal "
            "point; write all numbers alike"
        )
    return first[","][1] if "," in first else ""


def _number_cells(cells: Sequence[str], columns: Columns) -> dict[str, str]:
    """Return the cells that should be numbers by the names of their columns; empty where the row is too short."""
    wanted = (*POSITION, *columns.direction)
    return {name: cells[i] if (i := columns.indices[name]) < len(cells) else "" for name in wanted}


def _read_row(row: Row, columns: Columns, where: str, offset: Point) -> Point | Target:
    line, cells = row
    place = f"{where}, line {line}"
    values: dict[str, float] = {}
    for column, cell in _number_cells(cells, columns).items():
        value = float(cell.replace(",", ".")) if NUMBER.fullmatch(cell) else math.nan
        if not math.isfinite(value):
            raise TaskError(f"{place}: {column}: expected a finite number, got {cell[:60]!r}")
        values[column] = value * columns.factors.get(column, 1.0)
    x, y, z = (_tidy(values[column] + shift) for column, shift in zip(POSITION, offset, strict=True))
    direction = _direction([values[name] for name in columns.direction], columns, place)
    record = {"name": _name(cells, columns, place), "position": [x, y, z], **direction}
    target = check_document(record, Target, TaskError, place)
    return (x, y, z) if target.is_plain else target


def _name(cells: Sequence[str], columns: Columns, place: str) -> str:
    """Return the name of a target; empty for none."""
    index = columns.indices.get(NAME, len(cells))
    name = cells[index] if index < len(cells) else ""
    if not re.fullmatch(TARGET_NAME, name):
        raise TaskError(
            f"{place}: name: expected a letter, then at most 39 letters, digits, spaces, dots, _ or -, "
            f"got {name[:60]!r}; rename the column to leave the names out"
        )
    return name


def _direction(values: list[float], columns: Columns, place: str) -> dict[str, list[float]]:
    """Return the key of a tool direction with its value; empty for none."""
    if columns.direction == AXIS:
        return {"axis": values}
    if columns.direction == ANGLES:
        return {"orientation": list(map(_tidy, values))}
    if columns.direction == QUATERNION:
        norm = math.hypot(*values)
        if abs(norm - 1.0) > MAX_NORM_ERROR:
            raise TaskError(f"{place}: qx, qy, qz, qw: expected a quaternion of length 1, got {values} of {norm:.4g}")
        x, y, z, w = values
        return {"orientation": list(map(_tidy, rpy_from_rotation(rotation_from_quaternion(x, y, z, w))))}
    return {}


def _check_names(targets: Sequence[Point | Target], rows: Sequence[Row], where: str) -> None:
    """Raise TaskError if two targets have the same name."""
    lines: dict[str, int] = {}
    for name, line in _names(targets, rows):
        if name in lines:
            raise TaskError(f'{where}, line {line}: the name "{name}" is also in line {lines[name]}; rename one')
        lines[name] = line


def _names(targets: Sequence[Point | Target], rows: Sequence[Row]) -> Iterator[tuple[str, int]]:
    for target, (line, _) in zip(targets, rows, strict=True):
        if isinstance(target, Target) and target.name:
            yield target.name, line


def _tidy(value: float) -> float:
    return round(value, 9) + 0.0  # no -0.0
