"""Tables of text: CSV, tabs or spaces, with a header, a commented header or none."""

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from armwright.exceptions import TaskError

NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE | re.ASCII)
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_CELLS = re.compile(r'"[^"]*"|\S+')
_QUOTED = re.compile(r'"[^"]*"')
_SPACE_BEFORE_UNIT = re.compile(r"(?<!\s)\s+(?=[\[(])")  # x [mm] is one name

Row = tuple[int, list[str]]


@dataclass(frozen=True)
class Table:
    """The cells of a text.

    Attributes:
        header: Names of the columns; None without a header.
        first: Number of the line of the header, or else of the first row.
        rows: Number and cells of each further line; empty cells at its end are left out.
        hint: Follows messages about a wrong number of columns; may be empty.
    """

    header: tuple[str, ...] | None
    first: int
    rows: tuple[Row, ...]
    hint: str


def read_table(text: str, where: str, is_header: Callable[[Sequence[str]], bool], limit: int) -> Table:
    """Split a text into rows of cells.

    The first line is the header if none of its cells is a number; if one is, a comment above may be the header. Columns
    are separated by semicolons, tabs, commas or spaces: the first of these that the first row contains.

    Args:
        text: The text; empty lines and comments (#) are skipped.
        where: Names the text in messages.
        is_header: Tells whether a comment with as many cells as the first row holds the names of columns.
        limit: Largest number of rows.

    Raises:
        TaskError: A quote has no end, or there are no rows or too many.
    """
    lines = [(number, line.strip(" ")) for number, line in enumerate(text.splitlines(), start=1)]
    comments = [(number, line.lstrip("# ")) for number, line in lines if line.startswith("#")]
    lines = [(number, line) for number, line in lines if line.strip(' \t;,"') and not line.startswith("#")]
    header: Row | None = None
    if lines:
        names = _split_header(*lines[0], where)
        header = None if any(map(_is_number, names)) else (lines.pop(0)[0], names)
    if not lines:
        raise TaskError(f"{where} has no points: expected three numbers x, y, z per line")
    if len(lines) > limit:
        raise TaskError(f"{where}: expected at most {limit:,} points, got {len(lines):,}; leave some out")
    delimiter = _delimiter(lines[0][1])
    rows = tuple((number, _split(line, f"{where}, line {number}", delimiter)) for number, line in lines)
    first, cells = rows[0]
    if header is None:
        above = (_split_comment(*comment, where) for comment in reversed(comments) if comment[0] < first)
        header = next((row for row in above if len(row[1]) == len(cells) and is_header(row[1])), None)
    hint = "; numbers with decimal commas need semicolons or tabs between the columns" if delimiter == "," else ""
    return Table(tuple(header[1]) if header else None, header[0] if header else first, rows, hint)


def _is_number(cell: str) -> bool:
    return bool(NUMBER.fullmatch(cell) or _NOT_FINITE.fullmatch(cell))


def _delimiter(line: str) -> str:
    """Return what separates the cells of a line; empty for spaces."""
    bare = _QUOTED.sub("", line)
    return next((delimiter for delimiter in ";\t," if delimiter in bare), "")


def _split_header(number: int, line: str, where: str) -> list[str]:
    delimiter = _delimiter(line)
    return _split(line if delimiter else _SPACE_BEFORE_UNIT.sub("", line), f"{where}, line {number}", delimiter)


def _split_comment(number: int, line: str, where: str) -> Row:
    try:
        return number, _split_header(number, line, where)
    except TaskError:  # prose with a quote
        return number, []


def _split(line: str, where: str, delimiter: str) -> list[str]:
    """Return the cells of a line without empty ones at its end."""
    if not delimiter:
        return [cell.strip('"').strip() for cell in _CELLS.findall(line)]
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error as fault:
        raise TaskError(f"{where}: expected cells separated by {delimiter!r}, got {line[:60]!r}: {fault}") from fault
    cells = [cell.strip() for cell in cells]
    while cells and not cells[-1]:
        del cells[-1]
    return cells
