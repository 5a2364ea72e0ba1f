"""Docstrings of this project taken apart: what they say of a name stands as `name: words`, below the first lines."""

import re
from collections.abc import Collection, Mapping


def taken_apart(docstring: str, names: Collection[str]) -> tuple[str, Mapping[str, str]]:
    """The docstring without what it says of the names, and that, by name.

    A name is told of at the beginning of a line or after the end of a sentence; `a, b: words` tells of both.
    """
    told: dict[str, str] = {}
    left: list[str] = []
    for paragraph in docstring.split("\n\n"):
        starts = list(_starts(names).finditer(paragraph)) if names else []
        ends = [*(found.start() for found in starts[1:]), *([len(paragraph)] if starts else [])]
        for found, end in zip(starts, ends, strict=True):
            words = " ".join(paragraph[found.end() : end].split())
            told |= dict.fromkeys(found["names"].split(", "), words)
        before = paragraph[: starts[0].start()] if starts else paragraph
        if before.strip():
            left.append(before.rstrip())
    return "\n\n".join(left), told


def _starts(names: Collection[str]) -> re.Pattern[str]:
    one = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    return re.compile(rf"(?:^|(?<=[.;]) +)(?P<names>(?:{one})(?:, (?:{one}))*): (?=\S)", re.MULTILINE)
