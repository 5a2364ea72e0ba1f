"""Commands, programs and files shown in the documentation."""

import re
from dataclasses import dataclass

from markdown_it import MarkdownIt

from tests import ROOT

PAGES = tuple(sorted(str(file.relative_to(ROOT)) for file in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))))

PROGRAMS = ("armwright", ".venv/bin/armwright", "python", "python3", ".venv/bin/python", "pip", "make", "export", "sh",
            "xargs", "sudo", "apt", "apt-get", "dask", "ssh", "git", "docker", ".")  # fmt: skip


@dataclass(frozen=True)
class Block:
    """A block of code on a page. language: as it is fenced; of an indented one sh where it begins with a program."""

    page: str
    line: int
    language: str
    text: str

    @property
    def where(self) -> str:
        return f"{self.page}:{self.line}"


@dataclass(frozen=True)
class Command:
    """A line for a shell, without what is said behind #."""

    where: str
    text: str


def blocks(page: str) -> list[Block]:
    """All blocks of code, indented or fenced, in their order."""
    tokens = MarkdownIt().parse((ROOT / page).read_text(encoding="utf-8"))
    found = []
    for token in tokens:
        if token.type in ("fence", "code_block"):
            language = token.info.strip() or ("sh" if _begins_with_a_program(token.content) else "")
            assert token.map is not None
            found.append(Block(page, token.map[0] + 1, language, token.content))
    return found


def sections(page: str) -> dict[str, list[Block]]:
    """Return the blocks below each heading of the second level, in their order."""
    found: dict[str, list[Block]] = {}
    tokens = MarkdownIt().parse((ROOT / page).read_text(encoding="utf-8"))
    headings = [(t.map[0], tokens[i + 1].content) for i, t in enumerate(tokens) if t.tag == "h2" and t.map]
    for block in blocks(page):
        above = [title for line, title in headings if line < block.line]
        found.setdefault(above[-1] if above else "", []).append(block)
    return found


def commands(page: str) -> list[Command]:
    """The commands of a page, in their order."""
    return [
        Command(f"{block.page}:{block.line + number}", text)
        for block in blocks(page)
        if block.language in ("sh", "console", "bash")
        for number, line in enumerate(block.text.splitlines())
        if (text := without_comment(line))
    ]


def code_spans(page: str) -> list[str]:
    """Everything that a page sets in code within its sentences and tables."""
    tokens = MarkdownIt().enable("table").parse((ROOT / page).read_text(encoding="utf-8"))
    return [span.content for block in tokens for span in block.children or () if span.type == "code_inline"]


def without_comment(line: str) -> str:
    """A line for a shell up to its comment."""
    found = re.match(r"""(?:[^\s"'#][^\s"']*|"[^"]*"|'[^']*'|\s+)*""", line)
    assert found is not None
    return found[0].strip()


def _begins_with_a_program(text: str) -> bool:
    return text.split()[:1] in [[program] for program in PROGRAMS]
