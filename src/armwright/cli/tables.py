"""Tables that fit a terminal: heads are stacked, texts shortened and columns dropped; no number is ever cut."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

ELLIPSIS = "…"
NO_BREAK = "\N{NO-BREAK SPACE}"  # in heads, between words that stay on one line
COMPLETE = "--json and --csv print all"


@dataclass(frozen=True)
class Column:
    """A column of a table: its head, and the text of its cell for each record."""

    head: str
    value: str | Callable[[Any], Any]  # a key or an attribute of the records, or a function of them
    write: Callable[[Any], str] | None = None  # of a number, which is aligned to the right; None for texts
    rank: int = 0  # of a table that is too wide, the highest rank is dropped first, rank 0 never
    least: int | None = None  # characters to which its texts may be shortened; None if they are shown whole

    def cell(self, record: Any) -> str:
        """Return the text of a record's cell."""
        get: Any = self.value
        if isinstance(get, str):
            get = itemgetter(get) if isinstance(record, Mapping) else attrgetter(get)
        return (self.write or str)(get(record))


@dataclass(frozen=True)
class _Cells:
    """The texts of a column."""

    column: Column
    head: str
    cells: Sequence[str]

    @property
    def head_width(self) -> int:
        return max(map(cell_len, self.head.split("\n")))

    @property
    def width(self) -> int:
        return max([self.head_width, *map(cell_len, self.cells)])

    def aligned(self, line: str) -> str:
        """Return a line of the column in its width."""
        space = " " * (self.width - cell_len(line))
        return space + line if self.column.write else line + space


def print_table(
    console: Console, columns: Sequence[Column], records: Iterable[Any], complete: str = COMPLETE, gap: int = 2
) -> None:
    """Print records as a table that is at most as wide as the console, and name the columns that it leaves out.

    Args:
        console: The console.
        columns: The columns.
        records: The records, one a line.
        complete: Where columns are found that are left out, such as an option.
        gap: Spaces between two columns.
    """
    records = list(records)
    whole = [_Cells(column, column.head, [column.cell(record) for record in records]) for column in columns]
    fitted, dropped = _fitted(whole, console.width, gap)
    heads = [each.head.split("\n") for each in fitted]
    height = max(map(len, heads))
    lines = zip(*([""] * (height - len(head)) + head for head in heads), strict=True)
    for number, line in enumerate((*lines, *zip(*(each.cells for each in fitted), strict=True))):
        aligned = (" " * gap).join(each.aligned(part) for each, part in zip(fitted, line, strict=True))
        console.print(Text(aligned.rstrip().replace(NO_BREAK, " "), style="bold" if number < height else ""))
    if dropped:
        console.print(f"left out at this width: {', '.join(dropped)}; {complete}")


def _fitted(columns: Sequence[_Cells], width: int, gap: int) -> tuple[Sequence[_Cells], list[str]]:
    """Return columns that fit, if those of rank 0 leave room for it, and the heads of those that were dropped."""
    shown, dropped = list(columns), list[str]()
    while _total(shown, gap) > width:
        narrow = _shortened([replace(each, head=each.head.replace(" ", "\n")) for each in shown], width, gap)
        droppable = [each for each in shown if each.column.rank]
        if _total(narrow, gap) <= width or not droppable or len(shown) == 1:
            return narrow, dropped
        last = max(reversed(droppable), key=lambda each: each.column.rank)
        dropped.insert(0, last.head.replace("\n", " ").replace(NO_BREAK, " "))
        shown.remove(last)
    return shown, dropped


def _shortened(columns: Sequence[_Cells], width: int, gap: int) -> list[_Cells]:
    """Return columns with shorter texts, as far as the width demands and they allow."""
    excess = _total(columns, gap) - width
    shown: list[_Cells] = []
    for each in columns:
        if each.column.least is not None and excess > 0:
            limit = max(each.column.least, each.head_width, each.width - excess)
            excess -= max(0, each.width - limit)
            each = replace(each, cells=[shorten(cell, limit) for cell in each.cells])
        shown.append(each)
    return shown


def shorten(text: str, width: int) -> str:
    """Return a text of at most so many characters, with an ellipsis for what is left out."""
    while cell_len(text) > width:
        text = text.removesuffix(ELLIPSIS)[:-1].rstrip() + ELLIPSIS
    return text


def _total(columns: Sequence[_Cells], gap: int) -> int:
    return sum(each.width for each in columns) + gap * (len(columns) - 1)
