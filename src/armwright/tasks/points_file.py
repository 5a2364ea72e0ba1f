"""Points from CSV files and pasted text."""

import csv
import math
from pathlib import Path

from armwright.exceptions import TaskError
from armwright.files import read_text
from armwright.tasks.targets import Point

MAX_BYTES = 16 * 1024 * 1024
UNITS = {"m": 1.0, "mm": 1e-3}  # [m]


def read_points(path: Path, unit: str = "m", offset: Point = (0.0, 0.0, 0.0)) -> tuple[Point, ...]:
    """Read points from a CSV file with x, y and z in its first three columns.

    A first line without numbers is a header. Empty lines and lines that start with # are skipped. Columns may be
    separated by commas, semicolons, tabs or spaces.

    Args:
        path: The CSV file.
        unit: The unit of its numbers, `m` or `mm`.
        offset: Vector added to every point [m].

    Returns:
        The points [m].

    Raises:
        TaskError: If a line is not three finite numbers, or there is none.
    """
    _metres(unit)  # before the file, which may be large
    return parse_points(read_text(path, MAX_BYTES, TaskError), unit, str(path), offset)


def parse_points(text: str, unit: str, where: str, offset: Point = (0.0, 0.0, 0.0)) -> tuple[Point, ...]:
    """Return the points [m] of a text as `read_points` does; `where` names it in messages."""
    metres, lines = _metres(unit), text.splitlines()
    points: list[Point] = []
    rows = [(number, _split_row(line)) for number, line in enumerate(lines, start=1) if _holds_data(line)]
    if rows and not any(map(_is_number, rows[0][1][:3])):
        rows = rows[1:]  # column names
    for number, row in rows:
        try:
            x, y, z = (float(cell) * metres for cell in row[:3])
        except ValueError as fault:
            raise TaskError(f"{where}, line {number}: expected three numbers x, y, z, got {row[:3]}") from fault
        if not all(math.isfinite(c) for c in (x, y, z)):
            raise TaskError(f"{where}, line {number}: expected finite coordinates, got {row[:3]}")
        points.append((_tidy(x + offset[0]), _tidy(y + offset[1]), _tidy(z + offset[2])))
    if not points:
        raise TaskError(f"{where} has no points: expected three numbers x, y, z per line")
    return tuple(points)


def _metres(unit: str) -> float:
    """Return the metres per unit."""
    if unit not in UNITS:
        raise TaskError(f'unit: expected {" or ".join(UNITS)}, got "{unit}"')
    return UNITS[unit]


def _holds_data(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _split_row(line: str) -> list[str]:
    for delimiter in (",", ";", "\t"):
        if delimiter in line:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    return line.split()


def _tidy(value: float) -> float:
    return round(value, 9)
