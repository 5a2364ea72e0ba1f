"""The data sheet as two pages of A4."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, BinaryIO

import matplotlib
from matplotlib import font_manager
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armwright.report import datasheet_tables as tables
from armwright.report.datasheet_drawings import draw_errors, draw_payload, draw_side, draw_top
from armwright.report.datasheet_tables import Table
from armwright.report.style import FRONT, LINK, RC
from armwright.runs.datasheet.sheet import DataSheet

WIDTH, HEIGHT = 8.27, 11.69  # of A4 [inch]
LEFT, TOP, BOTTOM = 0.55, 0.5, 0.45  # margins [inch]
ACROSS, HALF, GUTTER = WIDTH - 2 * LEFT, 3.4, 0.37  # widths of columns, and between them [inch]
SIZES = (8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0, 4.5, 4.0)  # of text [pt]; the largest that fits is used
DRAWN = 6.3  # height of the drawings on the first page [inch]
NARROWEST, STEP = 0.4, 0.05  # of a wrapped column, and by how much columns are narrowed [inch]
BASELINE = 0.75  # of a line, from its top
POINT = 1.0 / 72.0  # [inch]


@dataclass
class TextColumn:
    """A column of headings, paragraphs and tables on a page, filled from the top.

    Attributes:
        figure: The page.
        x: Its left edge [inch].
        y: The place of the next line, from the top of the page [inch].
        width: [inch].
        size: Of its text [pt].
        drawn: Whether to draw; else only `y` moves.
    """

    figure: Figure
    x: float
    y: float
    width: float
    size: float
    drawn: bool = True
    line: float = field(init=False)

    def __post_init__(self) -> None:
        self.line = 1.3 * self.size * POINT

    def heading(self, text: str) -> None:
        """Add a heading."""
        self.y += 0.6 * self.line
        self._write(self.x, text, self.size + 1.0, is_bold=True)
        self.y += 1.35 * self.line

    def paragraph(self, text: str) -> None:
        """Add a wrapped paragraph."""
        for line in self._wrapped(text, self.width):
            self._write(self.x, line)
            self.y += self.line

    def table(self, table: Table) -> None:
        """Add a table under its title, with its note."""
        self.heading(table.title)
        cells = [table.header, *table.rows] if table.header else list(table.rows)
        if table.rows:
            widths = self._widths(table, cells)
            for number, row in enumerate(cells):
                self._row(table, row, widths, is_header=bool(table.header) and number == 0)
        if table.note:
            self.paragraph(table.note)

    def _row(self, table: Table, row: Sequence[str], widths: Sequence[float], is_header: bool) -> None:
        wrapped = [self._wrapped(cell, width, is_header) for cell, width in zip(row, widths, strict=True)]
        gap, x = self._gap, self.x
        for column, (lines, width) in enumerate(zip(wrapped, widths, strict=True)):
            at_left = column in table.left
            for number, text in enumerate(lines):
                place = x if at_left else x + width
                self._write(place, text, None, number * self.line, not at_left, is_bold=is_header)
            x += width + gap
        self.y += self.line * max(1, *map(len, wrapped))
        if self.drawn:
            place = 1.0 - self.y / HEIGHT
            ends = self.x / WIDTH, (self.x + self.width) / WIDTH
            colour, width = (FRONT, 0.7) if is_header else (LINK, 0.2)
            self.figure.add_artist(Line2D(ends, [place, place], color=colour, linewidth=width))

    def _widths(self, table: Table, cells: Sequence[Sequence[str]]) -> list[float]:
        """Return the widths of the columns [inch]; the widest left-aligned ones are narrowed until all fit.

        Names of columns of numbers are wrapped. Words are broken only if they have to be.
        """
        columns = list(zip(*cells, strict=True))
        words = [
            max((self._measure(word, bold=True) for text in column for word in text.split()), default=0.0)
            for column in columns
        ]
        n_names = 1 if table.header else 0
        wholes = [
            max(self._measure(text, bold=True) for text in column[0 if number in table.left else n_names :])
            for number, column in enumerate(columns)
        ]
        widths = [max(pair) for pair in zip(words, wholes, strict=True)]
        room = self.width - self._gap * (len(widths) - 1)
        for least in (words, [NARROWEST] * len(columns)):
            while sum(widths) > room:
                wide = [column for column in table.left if widths[column] > least[column]]
                if not wide:
                    break
                widest = max(wide, key=lambda column: widths[column])
                widths[widest] = max(least[widest], widths[widest] - STEP)
        return widths

    @property
    def _gap(self) -> float:
        return 0.9 * self.size * POINT

    def _wrapped(self, text: str, width: float, bold: bool = False) -> list[str]:
        """Return the lines of a text; words that are too long are broken."""
        lines, line = list[str](), ""
        for word in text.split():
            together = f"{line} {word}".strip()
            if self._measure(together, bold) <= width + 1e-6:
                line = together
                continue
            lines += [line] if line else []
            line = word
            while self._measure(line, bold) > width + 1e-6 and len(line) > 1:
                part = next(n for n in range(len(line) - 1, 0, -1) if n == 1 or self._measure(line[:n], bold) <= width)
                lines.append(line[:part])
                line = line[part:]
        return [*lines, line]

    def _measure(self, text: str, bold: bool = False) -> float:
        """Return the width of a text [inch]."""
        return self.size * POINT * sum(_advance(letter, bold) for letter in text)

    def _write(
        self,
        x: float,
        text: str,
        size: float | None = None,
        down: float = 0.0,
        at_right: bool = False,
        is_bold: bool = False,
    ) -> None:
        """Write a line that begins, or ends, at x, so far below the next line [inch]."""
        if self.drawn and text:
            y = 1.0 - (self.y + down + BASELINE * self.line) / HEIGHT
            line = self.figure.text(x / WIDTH, y, text, fontsize=size or self.size, va="baseline")
            line.set(ha="right" if at_right else "left", weight="bold" if is_bold else "normal")


@cache
def _advance(letter: str, bold: bool) -> float:
    """Return the width of a letter, as a multiple of the size of the text."""
    fonts: Any = font_manager
    font = fonts.get_font(fonts.findfont(fonts.FontProperties(weight="bold" if bold else "normal")))
    font.set_size(1.0, 72.0)
    return font.load_char(ord(letter)).linearHoriAdvance / 2**16


def write_pdf(sheet: DataSheet, file: BinaryIO) -> None:
    """Write the data sheet as PDF; the same sheet gives the same file."""
    with matplotlib.rc_context(RC), PdfPages(file, metadata={"CreationDate": None}) as pdf:
        for page in draw_pages(sheet):
            pdf.savefig(page)


def draw_pages(sheet: DataSheet) -> list[Figure]:
    """Return the two pages; to be called with the style of all figures."""
    return [_first_page(sheet), _second_page(sheet)]


def title_of(sheet: DataSheet) -> str:
    """Return the title of a sheet."""
    return sheet.name if sheet.design is None else f"{sheet.name}, design {sheet.design} ({sheet.joint_letters})"


def verdict_of(sheet: DataSheet) -> str:
    """Return role, verdict and survival in one sentence; empty for an existing arm."""
    role = f"recommended ({sheet.role.replace('_', ' ')})" if sheet.role else ""
    broken = f"infeasible: {', '.join(sheet.violated)}" if sheet.violated else ""
    parts = [part for part in (broken, role, sheet.status and f"simulation: {sheet.status}", sheet.survival) if part]
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}." if text else ""


def _first_page(sheet: DataSheet) -> Figure:
    page = _page()
    _title(page, sheet, "1 / 2")
    bottom = HEIGHT - BOTTOM - DRAWN
    verdict = verdict_of(sheet)

    def fill(size: float, drawn: bool) -> float:
        head = TextColumn(page, LEFT, TOP + 0.38, ACROSS, size, drawn)
        if verdict:
            head.paragraph(verdict)
        left = TextColumn(page, LEFT, head.y, HALF, size, drawn)
        left.table(tables.key_figures(sheet))
        left.table(tables.reach_table(sheet))
        right = TextColumn(page, LEFT + HALF + GUTTER, head.y, HALF, size, drawn)
        right.table(tables.link_table(sheet))
        right.table(tables.mass_table(sheet))
        return max(left.y, right.y)

    _fitted(fill, bottom)
    places = {
        draw_side: (0.75, 3.05, 3.2, 2.95),
        draw_top: (4.6, 3.05, 3.2, 2.95),
        draw_payload: (0.95, 0.45, 3.0, 1.75),
        draw_errors: (4.8, 0.45, 3.0, 1.75),
    }
    for draw, (x, y, width, height) in places.items():
        axes = page.add_axes((x / WIDTH, (BOTTOM + y) / HEIGHT, width / WIDTH, height / HEIGHT))
        draw(axes, sheet)
    return page


def _second_page(sheet: DataSheet) -> Figure:
    page = _page()
    _title(page, sheet, "2 / 2")

    def fill(size: float, drawn: bool) -> float:
        column = TextColumn(page, LEFT, TOP + 0.3, ACROSS, size, drawn)
        for make in (tables.joint_table, tables.parts_table):
            column.table(make(sheet))
        for line in tables.source_lines(sheet):
            column.paragraph(line)
        column.table(tables.sensitivity_table(sheet))
        column.heading("What the values assume")
        for about, text in sheet.assumptions.items():
            column.paragraph(f"{about}: {text}.")
        return column.y

    _fitted(fill, HEIGHT - BOTTOM)
    return page


def _page() -> Figure:
    return Figure(figsize=(WIDTH, HEIGHT))


def _title(page: Figure, sheet: DataSheet, number: str) -> None:
    place = 1.0 - TOP / HEIGHT
    page.text(LEFT / WIDTH, place, f"Data sheet: {title_of(sheet)}", fontsize=14, weight="bold", va="top")
    page.text(1.0 - LEFT / WIDTH, place, number, fontsize=8, ha="right", va="top")


def _fitted(fill: Callable[[float, bool], float], bottom: float) -> None:
    """Fill a page with the largest text that ends above the bottom [inch]."""
    size = next((size for size in SIZES if fill(size, False) <= bottom), SIZES[-1])
    fill(size, True)
