"""Links of the repository's Markdown, as they read on GitHub, made links of the guide."""

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
# The files beside docs/ that are pages, and their paths there.
PAGES = {file.name: file.name.lower() for file in ROOT.glob("*.md")} | {"README.md": "index.md"}
LANGUAGES = {".py": "python", ".yaml": "yaml", ".csv": "text", ".j2": "jinja", ".js": "javascript"}

_LINK = re.compile(r"\]\((?P<to>[^)#:\s]+)(?P<anchor>#[^)\s]*)?\)")


def rewritten(text: str, at: str) -> str:
    """The text of a page with its links to files of the repository made links to pages; at: its path in the guide."""

    def link(found: re.Match[str]) -> str:
        page = _page_of(_file(found["to"], at))
        to = posixpath.relpath(page, posixpath.dirname(at) or ".") if page else found["to"]
        return f"]({to}{found['anchor'] or ''})"

    return _LINK.sub(link, text)


def sources(text: str, at: str) -> set[str]:
    """The files and folders that a page links to and that are no pages: shown as they are."""
    files = {_file(found["to"], at) for found in _LINK.finditer(text)}
    return {file for file in files if _page_of(file).startswith("source/")}


def source_page(file: str) -> str:
    """A file of the repository as a page, or what lies in a folder."""
    path = ROOT / file
    if path.is_dir():
        names = sorted(one.name + "/" * one.is_dir() for one in path.iterdir() if not one.name.startswith("__"))
        return f"# {file}/\n\n" + "\n".join(f"- `{name}`" for name in names) + "\n"
    text = path.read_text(encoding="utf-8").rstrip()
    return f"# {file}\n\n``````{LANGUAGES.get(path.suffix, 'text')}\n{text}\n``````\n"


def _file(link: str, at: str) -> str:
    """The path in the repository that a page's link leads to."""
    beside = {page: file for file, page in PAGES.items()}.get(at, f"docs/{at}")
    return posixpath.normpath(posixpath.join(posixpath.dirname(beside), link))


def _page_of(file: str) -> str:
    """Where a file of the repository is found in the guide; empty for one that is not there."""
    if file in PAGES:
        return PAGES[file]
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    return f"source/{file}.md" if (ROOT / file).exists() else ""
