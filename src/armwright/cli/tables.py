"""Tables that fit a terminal: heads are stacked, texts shortened and columns dropped; no number is ever cut."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

ELLIPSIS = "…"
NO_BREAK = "\N{NO-BREAK SPACE}"  # in heads, between words that stay on one line


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    head: str
    is_number: bool = False  # aligned to the right
    rank: int = 0  # of a table that is too wide, the highest rank is dropped first, rank 0 never
    least: int | None = None  # characters to which its texts may be shortened; None if they are shown whole


@dataclass(frozen=True)
class Table:
    """A table of texts without lines."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[str]]
    complete: str  # where dropped columns are found, such as an option
    title: str = ""  # the line above the table
    caption: str = ""  # the line below the table
    gap: int = 2  # spaces between two columns
    indent: int = 0  # spaces before each line


def numbers(*heads: str, rank: int = 0) -> tuple[Column, ...]:
    """Return columns of numbers."""
    return tuple(Column(head, is_number=True, rank=rank) for head in heads)


def print_table(console: Console, table: Table) -> None:
    """Print a table that is at most as wide as the console, and name the columns that it leaves out."""
    fitted, dropped = fit_table(table, console.width)
    widths = _widths(fitted)
    if table.title:
        console.print(Text(table.title, style="italic"))
    for line in _head_lines(fitted, widths):
        console.print(Text(line.replace(NO_BREAK, " "), style="bold"))
    for row in fitted.rows:
        console.print(Text(_line(fitted, row, widths)))
    if table.caption:
        console.print(table.caption)
    if dropped:
        console.print(f"left out at this width: {', '.join(dropped)}; {table.complete}")


def fit_table(table: Table, width: int) -> tuple[Table, list[str]]:
    """Return a table that fits, if columns of rank 0 leave room for it, and the heads of its dropped columns.

    Args:
        table: The table.
        width: Characters in a line.
    """
    shown, dropped = table, list[str]()
    while _total(shown) > width:
        shortened = _shorten(_stack_heads(shown), width)
        droppable = [i for i, column in enumerate(shown.columns) if column.rank]
        if _total(shortened) <= width or not droppable or len(shown.columns) == 1:
            return shortened, dropped
        last = max(droppable, key=lambda i: (shown.columns[i].rank, i))
        dropped.insert(0, shown.columns[last].head.replace("\n", " ").replace(NO_BREAK, " "))
        shown = _without(shown, last)
    return shown, dropped


def _without(table: Table, index: int) -> Table:
    kept = [i for i in range(len(table.columns)) if i != index]
    rows = [[row[i] for i in kept] for row in table.rows]
    return replace(table, columns=[table.columns[i] for i in kept], rows=rows)


def _stack_heads(table: Table) -> Table:
    """Return a table whose heads are broken at spaces."""
    return replace(table, columns=[replace(c, head=c.head.replace(" ", "\n")) for c in table.columns])


def _shorten(table: Table, width: int) -> Table:
    """Return a table with shorter texts, as far as the width demands and its columns allow."""
    widths = _widths(table)
    excess = _total(table) - width
    limits: dict[int, int] = {}
    for i, column in enumerate(table.columns):
        if column.least is not None and excess > 0:
            limits[i] = max(column.least, _head_width(column), widths[i] - excess)
            excess -= max(0, widths[i] - limits[i])
    rows = [[shorten(text, limits.get(i, widths[i])) for i, text in enumerate(row)] for row in table.rows]
    return replace(table, rows=rows)


def shorten(text: str, width: int) -> str:
    """Return a text of at most so many characters, with an ellipsis for what is left out."""
    while cell_len(text) > width:
        text = text.removesuffix(ELLIPSIS)[:-1].rstrip() + ELLIPSIS
    return text


def _head_width(column: Column) -> int:
    return max(map(cell_len, column.head.split("\n")))


def _widths(table: Table) -> list[int]:
    return [
        max([_head_width(column), *(cell_len(row[i]) for row in table.rows)]) for i, column in enumerate(table.columns)
    ]


def _total(table: Table) -> int:
    widths = _widths(table)
    return table.indent + sum(widths) + table.gap * (len(widths) - 1)


def _head_lines(table: Table, widths: Sequence[int]) -> Iterable[str]:
    """Yield the lines of the heads, aligned at the bottom."""
    heads = [column.head.split("\n") for column in table.columns]
    n_lines = max(map(len, heads))
    padded = [[""] * (n_lines - len(head)) + head for head in heads]
    for line in zip(*padded, strict=True):
        yield _line(table, line, widths)


def _line(table: Table, row: Sequence[str], widths: Sequence[int]) -> str:
    cells = (
        " " * (width - cell_len(text)) + text if column.is_number else text + " " * (width - cell_len(text))
        for column, text, width in zip(table.columns, row, widths, strict=True)
    )
    return (" " * table.indent + (" " * table.gap).join(cells)).rstrip()
