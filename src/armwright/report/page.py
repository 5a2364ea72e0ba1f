"""report.html: one file that shows a run in any browser, without a network.

The modules in page/ are joined into one script. The page's Content-Security-Policy allows its own scripts by hash and
forbids all connections.
"""

import base64
import hashlib
import html
import re
import zlib
from functools import cache
from importlib import resources
from pathlib import Path

from armwright.exceptions import RunFolderError
from armwright.files import naming_write_errors, replace_file
from armwright.report.page_content import RunContent
from armwright.runs.results import REPORT

LIBRARIES = ("plotly-basic.min.js", "three.min.js")
MAIN = "main.js"
_FOLDER = resources.files("armwright.report") / "page"
_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([\w-]+\.js)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?function|class|const|let) ([\w$]+)", re.MULTILINE)


def write_report(folder: str | Path) -> Path:
    """Write report.html into a run folder, replacing an existing one."""
    folder = Path(folder)
    content = RunContent(folder)
    if not len(content.history):
        raise RunFolderError(f"{folder} has no finished trial yet, so there is nothing to report")
    data = base64.b64encode(zlib.compress(content.packed(), 6)).decode()
    task = content.config.task.name
    page = render_page(f"{task}, seed {content.config.seed}: armwright", data=data)
    path = folder / REPORT
    with naming_write_errors(path, "; the trials are safe"):
        replace_file(path, page.encode())
    return path


def render_page(title: str, data: str = "", token: str = "") -> str:
    """Return the page's HTML: with embedded data, or live with the token for its requests."""
    scripts = [*map(_library, LIBRARIES), program()]
    sums = " ".join(f"'sha256-{_sum(script)}'" for script in scripts)
    reach = "connect-src 'self'" if token else "connect-src 'none'"
    policy = (
        f"default-src 'none'; script-src {sums}; style-src 'unsafe-inline'; img-src data: blob:; {reach}; "
        "base-uri 'none'; form-action 'none'"
    )
    holder = f'<script type="text/plain" id="content">{data}</script>' if data else ""
    values = {
        "policy": policy,
        "title": html.escape(title),
        "style": _read("page.css"),
        "data": holder,
        "token": f'<meta name="armwright-token" content="{html.escape(token)}">' if token else "",
        "scripts": "\n".join(f"<script>{script}</script>" for script in scripts),
    }
    # A single pass, so that inserted text is never taken for a placeholder.
    return re.sub(r"\{\{ (\w+) \}\}", lambda found: values[found[1]], _read("page.html"))


@cache
def program() -> str:
    """Return the page's modules as one script, each in its own function, in order of their imports."""
    order: list[str] = []

    def visit(name: str) -> None:
        if name not in order:
            for _, other in _IMPORT.findall(_read(name)):
                visit(other)
            order.append(name)

    visit(MAIN)
    return '"use strict";\n(() => {\n' + "\n".join(map(_as_function, order)) + "\n})();\n"


def _as_function(name: str) -> str:
    text = _read(name)
    names = [found[1] for found in _EXPORT.findall(text)]
    text = _IMPORT.sub(lambda found: f"const {{{found[1].replace(' as ', ': ')}}} = {_variable(found[2])};\n", text)
    text = _EXPORT.sub(r"\1 \2", text)
    return f"const {_variable(name)} = (() => {{\n{text}\nreturn {{ {', '.join(names)} }};\n}})();"


def _variable(name: str) -> str:
    return f"{name.removesuffix('.js').replace('-', '_')}_module"


@cache
def _library(name: str) -> str:
    return _read(f"vendor/{name}").replace("</script", "<\\/script")


@cache
def _read(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


@cache
def _sum(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
