"""The data sheet as one HTML file that needs no network."""

import base64
import html
import io
from collections.abc import Callable
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from armwright.report import datasheet_tables as tables
from armwright.report.datasheet_drawings import draw_errors, draw_payload, draw_side, draw_top
from armwright.report.datasheet_pdf import title_of, verdict_of
from armwright.report.datasheet_tables import Table
from armwright.report.style import RC
from armwright.runs.datasheet.sheet import DataSheet

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff; margin: 2rem auto; max-width: 60rem;
       padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin: 1.6rem 0 0.4rem; }
.wide { overflow-x: auto; } .pair { display: flex; flex-wrap: wrap; gap: 1rem; }
.pair img { flex: 1 1 20rem; max-width: 100%; min-width: 0; }
table { border-collapse: collapse; font-size: 0.85rem; }
th, td { padding: 0.15rem 0.6rem 0.15rem 0; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }
th { border-bottom-color: #111; } .left { text-align: left; } p, li { font-size: 0.85rem; overflow-wrap: anywhere; }
@media print { body { margin: 0; } h2, tr, img { break-inside: avoid; } }
"""


def to_html(sheet: DataSheet) -> str:
    """Return the data sheet as HTML; the same sheet gives the same text."""
    title = html.escape(f"Data sheet: {title_of(sheet)}")
    verdict = verdict_of(sheet)
    pictures = [
        _pair((draw_side, 4.6, 4.4, "side view"), (draw_top, 4.6, 4.4, "top view"), sheet),
        _pair((draw_payload, 4.6, 2.7, "payload over the reach"), (draw_errors, 4.6, 2.7, "errors over reach"), sheet),
    ]
    makers = (tables.joint_table, tables.link_table, tables.mass_table, tables.parts_table)
    parts = [
        f"<h1>{title}</h1>",
        f"<p>{html.escape(verdict)}</p>" if verdict else "",
        _table(tables.key_figures(sheet)),
        *pictures,
        *(_table(make(sheet)) for make in makers),
        _list(tables.source_lines(sheet)),
        _table(tables.reach_table(sheet)),
        _table(tables.sensitivity_table(sheet)),
        "<h2>What the values assume</h2>",
        _list(tuple(f"{about}: {text}." for about, text in sheet.assumptions.items())),
    ]
    head = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>{STYLE}</style></head>\n'
    )
    return head + "<body>\n" + "\n".join(part for part in parts if part) + "\n</body></html>\n"


def _pair(*drawn: Any) -> str:
    """Return two drawings side by side; the last argument is the sheet."""
    *pictures, sheet = drawn
    return '<div class="pair">' + "".join(_picture(sheet, *picture) for picture in pictures) + "</div>"


def _picture(
    sheet: DataSheet, draw: Callable[[Any, DataSheet], None], width: float, height: float, caption: str
) -> str:
    """Return a drawing of this size [inch] as an image."""
    with matplotlib.rc_context(RC):
        figure, buffer = Figure(figsize=(width, height), layout="constrained"), io.BytesIO()
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
    shown: list[str] = []
    for column, cell in enumerate(cells):
        aligned = ' class="left"' if column in table.left else ""
        shown.append(f"<{tag}{aligned}>{html.escape(cell)}</{tag}>")
    return f"<tr>{''.join(shown)}</tr>"


def _list(lines: tuple[str, ...]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(line)}</li>' for line in lines)}</ul>" if lines else ""
