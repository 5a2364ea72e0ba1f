"""Write a data sheet: datasheet.html and datasheet.json."""

import json
from pathlib import Path

from pydantic_core import to_jsonable_python

from armwright.files import naming_write_errors, replace_file
from armwright.sheet.html import to_html
from armwright.sheet.record import UNITS, DataSheet

HTML, JSON = "datasheet.html", "datasheet.json"


def write_datasheet(sheet: DataSheet, folder: Path) -> list[Path]:
    """Write a data sheet into a folder, replacing an existing one, and return the files."""
    with naming_write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        replace_file(folder / HTML, to_html(sheet).encode())
        replace_file(folder / JSON, (json.dumps(sheet_record(sheet), indent=2, allow_nan=False) + "\n").encode())
    return [folder / name for name in (HTML, JSON)]


def sheet_record(sheet: DataSheet) -> dict[str, object]:
    """Return a data sheet in JSON types, with the units of its keys; null: not stated."""
    return {"units": dict(UNITS), **to_jsonable_python(sheet)}
