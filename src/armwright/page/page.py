"""report.html: one file that shows a run in any browser, without a network."""

import base64
import zlib
from pathlib import Path

from armwright.exceptions import RunFolderError
from armwright.files import naming_write_errors, replace_file, replace_surrogates
from armwright.page.assembly import PageSource, assemble
from armwright.page.content import RunContent
from armwright.proof.results import REPORT

PAGE = PageSource("page.html", "main.js", ("page.css",), ("plotly-basic.min.js", "three.min.js"))


def write_report(folder: str | Path) -> Path:
    """Write report.html into a run folder, replacing an existing one."""
    folder = Path(folder)
    content = RunContent(folder)
    if not len(content.history):
        raise RunFolderError(f"{folder} has no finished trial yet, so there is nothing to report")
    data = base64.b64encode(zlib.compress(content.packed(), 6)).decode()
    holder = f'<script type="text/plain" id="content">{data}</script>'
    title = f"{replace_surrogates(folder.resolve().name)}: armwright"
    page = assemble(PAGE, title, connects=False, values={"data": holder})
    path = folder / REPORT
    with naming_write_errors(path, "; the trials are safe"):
        replace_file(path, page.encode())
    return path
