"""The data sheet as one HTML file that needs no network."""

import base64
import html
import io
from collections.abc import Callable
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from armwright.pictures.style import RC
from armwright.sheet import tables
from armwright.sheet.drawings import draw_errors, draw_payload, draw_side, draw_top
from armwright.sheet.record import DataSheet
from armwright.sheet.tables import Table

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff; margin: 2rem auto; max-width: 60rem;
       padding: 0 1rem; }
h1 { font-size: 1.5em; } h2 { font-size: 1.1em; margin: 1.6em 0 0.4em; }
.wide { overflow-x: auto; } .pair { display: flex; flex-wrap: wrap; gap: 0 2em; }
.pair > * { flex: 1 1 20rem; max-width: 100%; min-width: 0; }
img { max-width: 100%; }
table { border-collapse: collapse; font-size: 0.85em; }
th, td { padding: 0.15em 0.6em 0.15em 0; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }
th { border-bottom-color: #111; } .left { text-align: left; } p, li { font-size: 0.85em; overflow-wrap: anywhere; }
@page { size: A4; margin: 12mm; }
@media print {
  body { margin: 0; max-width: none; padding: 0; line-height: 1.25; } section { font-size: 7.5pt; }
  section + section { break-before: page; } h1 { margin: 0; } h2 { margin: 0.8em 0 0.2em; break-after: avoid; }
  tr, img { break-inside: avoid; } .wide { overflow-x: visible; } .pair > * { flex-basis: 40%; }
  img { width: 100%; max-height: 80mm; } ul { margin: 0.2em 0; padding-left: 1.2em; } p { margin: 0.3em 0; }
}
"""


def to_html(sheet: DataSheet) -> str:
    """Return the data sheet as HTML, which prints on A4; the same sheet gives the same text."""
    title, verdict = html.escape(f"Data sheet: {tables.title_of(sheet)}"), tables.verdict_of(sheet)
    left, right = (
        "".join(_table(make(sheet)) for make in makers)
        for makers in ((tables.key_figures, tables.reach_table), (tables.link_table, tables.mass_table))
    )
    first = [
        f"<h1>{title}</h1>",
        f"<p>{html.escape(verdict)}</p>" if verdict else "",
        _beside(left, right),
        _beside(_picture(sheet, draw_side, 4.0, "side view"), _picture(sheet, draw_top, 4.0, "top view")),
        _beside(_picture(sheet, draw_payload, 2.5, "payload"), _picture(sheet, draw_errors, 2.5, "errors")),
    ]
    second = [
        _table(tables.joint_table(sheet)),
        _list(tables.body_lines(sheet)),
        _table(tables.parts_table(sheet)),
        _list(tables.source_lines(sheet)),
        _table(tables.sensitivity_table(sheet)),
        "<h2>What the values assume</h2>",
        _list(tuple(f"{about}: {text}." for about, text in sheet.assumptions.items())),
    ]
    pages = "\n".join(f"<section>\n{chr(10).join(filter(None, texts))}\n</section>" for texts in (first, second))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>{STYLE}</style></head>\n'
        f"<body>\n{pages}\n</body></html>\n"
    )


def _beside(*parts: str) -> str:
    """Return parts side by side."""
    return '<div class="pair">' + "".join(f"<div>{part}</div>" for part in parts) + "</div>"


def _picture(sheet: DataSheet, draw: Callable[[Any, DataSheet], None], height: float, caption: str) -> str:
    """Return a drawing of this height [inch] as an image."""
    with matplotlib.rc_context(RC):
        figure, buffer = Figure(figsize=(4.6, height), layout="constrained"), io.BytesIO()
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
    aligned = [' class="left"' * (column in table.left) for column in range(len(cells))]
    shown = (f"<{tag}{side}>{html.escape(cell)}</{tag}>" for side, cell in zip(aligned, cells, strict=True))
    return f"<tr>{''.join(shown)}</tr>"


def _list(lines: tuple[str, ...]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(line)}</li>' for line in lines)}</ul>" if lines else ""
