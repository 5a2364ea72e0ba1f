"""No regular expression of the package takes more than linear time, whatever text it is given."""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import hypothesis
import pytest
from hypothesis import strategies as st

import armwright
from tests.fuzz.target import TooSlowError, limited

ROOT = Path(armwright.__file__).parent
WHOLE = {"match", "fullmatch"}
SEARCHES = {"search", "sub", "subn", "findall", "finditer", "split"}
LETTERS = 30_000  # of a text: some milliseconds in linear time, a minute in quadratic time
SECONDS = 1.0  # of CPU time
ENDS = ("\0", "\n", '"', "x")
TRIES = 50


class Pattern(NamedTuple):
    text: str
    flags: int = 0
    searches: bool = True  # anywhere in a text


def patterns() -> Iterator[tuple[str, Pattern]]:
    """Every pattern in the package's Python files, with its place."""
    for file in sorted(ROOT.rglob("*.py")):
        name, source = ".".join(file.relative_to(ROOT.parent).with_suffix("").parts), file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(source)):
            if not (isinstance(node, ast.Call) and node.args):
                continue
            holder, _, function = ast.unparse(node.func).rpartition(".")
            if holder != "re" or function not in {*WHOLE, *SEARCHES, "compile"}:
                continue
            module = vars(importlib.import_module(name))
            options = [*node.args[1:], *(keyword.value for keyword in node.keywords)]
            named = [getattr(re, n.attr, 0) for one in options for n in ast.walk(one) if isinstance(n, ast.Attribute)]
            flags = sum({int(flag) for flag in named if isinstance(flag, re.RegexFlag)})
            kept = re.match(r"(\w+) = re\.compile", source.splitlines()[node.lineno - 1])
            used = rf"\b{kept[1]}\.({'|'.join(SEARCHES)})\b" if kept else ""
            searches = function in SEARCHES or (function == "compile" and bool(re.search(used, source)))
            yield f"{file.relative_to(ROOT)}:{node.lineno}", Pattern(text_of(node.args[0], module), flags, searches)


def text_of(node: ast.expr, module: dict[str, Any]) -> str:
    """A pattern as it is written; what only a run knows is a letter."""
    if isinstance(node, ast.JoinedStr):
        return "".join(text_of(part, module) for part in node.values)
    if isinstance(node, ast.IfExp):
        return f"(?:{text_of(node.body, module)}|{text_of(node.orelse, module)})"
    if isinstance(node, ast.FormattedValue):
        value = module.get(node.value.id, "a") if isinstance(node.value, ast.Name) else "a"
        return value if isinstance(value, str) else "a"
    return str(node.value if isinstance(node, ast.Constant) else module[ast.unparse(node)])


ALL = {pattern: place for place, pattern in patterns()}


def reads_in_time(wanted: Pattern) -> None:
    """Give texts that match in part: a match, in which any piece is repeated until it is long, with another end."""
    pattern = re.compile(wanted.text, wanted.flags)

    @hypothesis.settings(max_examples=TRIES, phases=[hypothesis.Phase.generate])
    @hypothesis.given(st.from_regex(pattern, fullmatch="(?=" not in wanted.text), st.data())
    def search(match: str, data: st.DataObject) -> None:
        start = data.draw(st.integers(0, max(0, len(match) - 1)))
        end = data.draw(st.integers(start + 1, start + 3))
        piece = match[start:end] or "a"
        rest = data.draw(st.sampled_from([match[end:], match[end:-1], *ENDS]))
        long = match[:start] + piece * (LETTERS // len(piece)) + rest
        with limited(SECONDS):
            list(pattern.finditer(long)) if wanted.searches else pattern.fullmatch(long)

    search()


def test_patterns_are_found() -> None:
    assert len(ALL) > 50
    assert any(place.startswith("llm/redaction.py") and "*" in one.text for one, place in ALL.items())


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ALL, ids=ALL.values())
def test_pattern_reads_long_repetitions_in_time(pattern: Pattern) -> None:
    reads_in_time(pattern)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        r"([\w-]*)(?:\*{2,}|\.{3,}|…)([\w-]*)", r"(?:a+b?)+c", r'//[^"\n]*$', r"JOINTS:\s*\w*\s*\w*;",
    ],
)  # fmt: skip
def test_pattern_that_takes_quadratic_time_is_noticed(text: str) -> None:
    with pytest.raises(TooSlowError):
        reads_in_time(Pattern(text))
