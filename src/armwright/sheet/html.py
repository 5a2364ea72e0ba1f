"""The data sheet as one HTML file that needs no network."""

import base64
import html
import io
import math
from collections.abc import Callable, Sequence
from importlib import resources
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from armwright.pictures.style import RC
from armwright.sheet import tables
from armwright.sheet.drawings import draw_side, draw_top
from armwright.sheet.record import DataSheet
from armwright.sheet.tables import Table

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
SIZES = (9.5, 9.0, 8.5, 8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0, 4.5, 4.0)  # of printed text [pt]; the largest that fits
PAGE = 500.0  # lines of 1 pt on a page of A4
WIDTH = 1150.0  # letters of 1 pt in a line
DRAWN = 160.0  # lines of 1 pt that the drawings take


def to_html(sheet: DataSheet) -> str:
    """Return the data sheet as HTML, which prints on two pages of A4; the same sheet gives the same text."""
    design = "" if sheet.design is None else f", design {sheet.design} ({sheet.joint_letters})"
    title = html.escape(f"Data sheet: {sheet.name}{design}")
    verdict = tables.verdict_of(sheet)
    left, right = (tables.key_figures, tables.reach_table), (tables.link_table, tables.mass_table)
    columns = [[make(sheet) for make in makers] for makers in (left, right)]
    first = [
        f"<h1>{title}</h1>",
        f"<p>{html.escape(verdict)}</p>" if verdict else "",
        _beside(*("".join(map(_table, column)) for column in columns)),
        _beside(_picture(sheet, draw_side, "side view"), _picture(sheet, draw_top, "top view")),
    ]
    joints, parts = tables.joint_table(sheet), tables.parts_table(sheet)
    assumed = [f"{about}: {text}." for about, text in sheet.assumptions.items()]
    bodies = [f"actuator at joint {joint.number}: {joint.body}" for joint in sheet.joints if joint.body]
    read = ((part.part, "; ".join(filter(None, (part.source, part.price_source)))) for part in sheet.parts)
    sources = [f"{name}: {source}" for name, source in read if source]
    second = [
        *(_table(joints), _list(bodies), _table(parts), _list(sources)),
        *("<h2>What the values assume</h2>", _list(assumed)),
    ]
    sizes = (
        min(_printed_size(column, (verdict,), PAGE - DRAWN, WIDTH / 2.0) for column in columns),
        _printed_size((joints, parts), (*bodies, *sources, *assumed, "", ""), PAGE, WIDTH),
    )
    pages = [
        f'<section style="--size: {size}pt">\n{chr(10).join(filter(None, texts))}\n</section>'
        for size, texts in zip(sizes, (first, second), strict=True)
    ]
    style = (resources.files("armwright.sheet") / "datasheet.css").read_text(encoding="utf-8")
    head = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{style}</style></head>\n'
    )
    return head + "<body>\n" + "\n".join(pages) + "\n</body></html>\n"


def _printed_size(shown: Sequence[Table], texts: Sequence[str], lines: float, width: float) -> float:
    """Return the largest size of text [pt] in which tables and paragraphs take at most `lines` lines of 1 pt."""
    rows = [" ".join((*row, *row[:1])) for table in shown for row in (*table.rows, table.header, (table.note,), ("",))]
    lengths = [len(text) for text in (*rows, *texts)]
    return next(
        (size for size in SIZES if sum(math.ceil((length + 1) * size / width) for length in lengths) * size <= lines),
        SIZES[-1],
    )


def _beside(*parts: str) -> str:
    """Return parts side by side."""
    return '<div class="pair">' + "".join(f"<div>{part}</div>" for part in parts) + "</div>"


def _picture(sheet: DataSheet, draw: Callable[[Any, DataSheet], None], caption: str) -> str:
    """Return a drawing as an image."""
    with matplotlib.rc_context(RC):
        figure, buffer = Figure(figsize=(4.6, 4.0), layout="constrained"), io.BytesIO()
        draw(figure.subplots(), sheet)
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<img alt="{html.escape(caption)}" src="data:image/svg+xml;base64,{data}">'


def _table(table: Table) -> str:
    rows = [_row(table, row, "td") for row in table.rows]
    header = [f"<thead>{_row(table, table.header, 'th')}</thead>"] if table.header and rows else []
    body = f'<div class="wide"><table>{"".join(header)}<tbody>{"".join(rows)}</tbody></table></div>' if rows else ""
    note = f"<p>{html.escape(table.note)}</p>" if table.note else ""
    return f"<h2>{html.escape(table.title)}</h2>{body}{note}"


def _row(table: Table, cells: tuple[str, ...], tag: str) -> str:
    starts = [f'<{tag} class="left">' if column in table.left else f"<{tag}>" for column in range(len(cells))]
    return f"<tr>{''.join(f'{start}{html.escape(c)}</{tag}>' for start, c in zip(starts, cells, strict=True))}</tr>"


def _list(lines: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(line)}</li>' for line in lines)}</ul>" if lines else ""
