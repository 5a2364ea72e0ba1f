"""For the API reference: in docstrings, what is said of parameters and attributes becomes a list."""

from typing import Any

import griffe

from website.words import taken_apart


class NamesAsLists(griffe.Extension):
    """Markdown of this project's docstrings."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        self._list(func, [parameter.name for parameter in func.parameters])

    def on_class(self, *, cls: griffe.Class, **_: Any) -> None:
        begin = cls.members.get("__init__")
        given = [parameter.name for parameter in begin.parameters] if isinstance(begin, griffe.Function) else []
        self._list(cls, given + [name for name, member in cls.members.items() if member.is_attribute])

    def _list(self, thing: griffe.Object, names: list[str]) -> None:
        if thing.docstring is None:
            return
        words, told = taken_apart(thing.docstring.value, names)
        words, examples = _without_examples(words)
        together: dict[str, list[str]] = {}  # `low, high: words` is one entry
        for name, said in told.items():
            together.setdefault(said, []).append(f"`{name}`")
        rows = [f"- {', '.join(group)}: {said}" for said, group in together.items()]
        parts = [words, "\n".join(rows), f"```pycon\n{examples}\n```" if examples else ""]
        thing.docstring.value = "\n\n".join(part for part in parts if part)


def _without_examples(words: str) -> tuple[str, str]:
    """A docstring's words, and its examples, which end it."""
    first, sign, rest = words.partition(">>> ")
    return first.rstrip(), sign + rest
