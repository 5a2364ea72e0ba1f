"""report.html: one file that shows a run in any browser, without a network.

It ends with the sha256 of itself and all that it was made from. If that is still true, and all around its content is
ours, since a stranger's folder may bring a page with its sum, it is not made again.
"""

import base64
import hashlib
import re
import zlib
from contextlib import suppress
from pathlib import Path

from armwright.exceptions import RunFolderError
from armwright.files import MAX_DERIVED, check_no_links, digest, naming_write_errors, read_bytes, replace_file
from armwright.page.assembly import PageSource, assemble
from armwright.page.content import RunContent
from armwright.proof.design_record import DESIGNS
from armwright.proof.results import REPORT

PAGE = PageSource("page.html", "main.js", ("page.css",), ("plotly-basic.min.js", "three.min.js"))
PACKAGE = Path(__file__).parents[1]
MARK = b"\n<!-- made from "  # before the sum
_CONTENT = re.compile(rb'<script type="text/plain" id="content">([A-Za-z0-9+/=]*)</script>')


def write_report(folder: str | Path) -> Path:
    """Write report.html into a run folder, replacing an existing one; one that is still true stays."""
    folder = Path(folder)
    path, origin = folder / REPORT, _origin(folder)
    with suppress(ValueError):  # there is none
        page, _, stated = read_bytes(path, MAX_DERIVED, ValueError).rpartition(MARK)
        kept = _CONTENT.search(page)
        if kept and stated == _sum(origin, page) and page == _around(kept[1], folder):
            return path
    content = RunContent(folder)
    if not len(content.history):
        raise RunFolderError(f"{folder} has no finished trial yet, so there is nothing to report")
    page = _around(base64.b64encode(zlib.compress(content.packed(), 6)), folder)
    with naming_write_errors(path, "; the trials are safe"):
        replace_file(path, page + MARK + _sum(origin, page))
    return path


def _around(content: bytes, folder: Path) -> bytes:
    """Return the page around its content, in base64."""
    holder = f'<script type="text/plain" id="content">{content.decode()}</script>'
    page = assemble(PAGE, f"{folder.resolve().name}: armwright", connects=False, values={"data": holder})
    return page.encode(errors="replace")  # lone surrogates


def _origin(folder: Path) -> bytes:
    """Return the sha256 of a run's files, with its name, and of this package: its version may be that of a checkout."""
    check_no_links(folder)
    folder = folder.resolve()
    files = {*folder.glob("[!.]*"), *folder.glob(f"{DESIGNS}/*/*"), *PACKAGE.rglob("*[!c]")} - {folder / REPORT}
    return digest(sorted(files))  # without .pyc


def _sum(origin: bytes, page: bytes) -> bytes:
    return f"{hashlib.sha256(origin + page).hexdigest()} -->\n".encode()
