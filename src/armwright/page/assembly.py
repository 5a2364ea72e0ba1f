"""Join the files of a page into one HTML document.

The JavaScript modules become one script. The page's Content-Security-Policy allows its own scripts by hash.
"""

import base64
import hashlib
import html
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable

SHARED = resources.files("armwright.page") / "web"  # modules, styles and libraries that several pages use
_IMPORT = re.compile(r'^import \{([^{}]*)\} from "\./([\w-]+\.js)";\n', re.MULTILINE)
_PLACEHOLDER = re.compile(r"\{\{ (\w+) \}\}")
_EXPORT = re.compile(r"^export ((?:async )?function|class|const|let) ([\w$]+)", re.MULTILINE)


@dataclass(frozen=True)
class PageSource:
    """The files of a page."""

    template: str  # the body of the HTML, with placeholders such as {{ title }}
    main: str  # the JavaScript module that imports the others
    styles: tuple[str, ...]  # the style sheets, in order
    libraries: tuple[str, ...]  # the scripts in vendor/ that run before the modules
    folders: tuple[Traversable, ...] = (SHARED,)  # where files are looked for, in this order

    def read(self, name: str) -> str:
        """Return the text of a file."""
        return _read(self.folders, name)


def assemble(source: PageSource, title: str, connects: bool, values: Mapping[str, str]) -> str:
    """Return a page as HTML; the title is text, the values are HTML for the remaining placeholders.

    `connects` lets it ask its own server; otherwise the policy forbids all connections.
    """
    libraries = (source.read(f"vendor/{name}").replace("</script", "<\\/script") for name in source.libraries)
    scripts = [*libraries, program(source)]
    sums = " ".join(f"'sha256-{_sum(script)}'" for script in scripts)
    reach = "'self'" if connects else "'none'"
    policy = (
        f"default-src 'none'; script-src {sums}; style-src 'unsafe-inline'; img-src data: blob:; connect-src {reach}; "
        "base-uri 'none'; form-action 'none'"
    )
    given = {
        **values,
        "policy": policy,
        "title": html.escape(title),
        "style": "\n".join(map(source.read, source.styles)),
        "scripts": "\n".join(f"<script>{script}</script>" for script in scripts),
    }
    # Each in a single pass, so that inserted text is never taken for a placeholder.
    given["body"] = _PLACEHOLDER.sub(lambda found: given[found[1]], source.read(source.template))
    return _PLACEHOLDER.sub(lambda found: given[found[1]], source.read("shell.html"))


@cache
def program(source: PageSource) -> str:
    """Return the page's modules as one script, each in its own function, in order of their imports."""
    order: list[str] = []

    def visit(name: str) -> None:
        if name not in order:
            for _, other in _IMPORT.findall(source.read(name)):
                visit(other)
            order.append(name)

    visit(source.main)
    functions = "\n".join(_as_function(name, source.read(name)) for name in order)
    return f'"use strict";\n(() => {{\n{functions}\n}})();\n'


def _as_function(name: str, text: str) -> str:
    names = [found[1] for found in _EXPORT.findall(text)]
    text = _IMPORT.sub(lambda found: f"const {{{found[1].replace(' as ', ': ')}}} = {_variable(found[2])};\n", text)
    text = _EXPORT.sub(r"\1 \2", text)
    return f"const {_variable(name)} = (() => {{\n{text}\nreturn {{ {', '.join(names)} }};\n}})();"


def _variable(name: str) -> str:
    return f"{name.removesuffix('.js').replace('-', '_')}_module"


@cache
def _read(folders: tuple[Traversable, ...], name: str) -> str:
    found = next(folder / name for folder in folders if (folder / name).is_file())
    return found.read_text(encoding="utf-8")


@cache
def _sum(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
