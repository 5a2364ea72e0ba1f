"""Decimal commas in lists of numbers: in YAML, [0,4, 0.1] are the three numbers 0, 4 and 0.1."""

import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, cast

import yaml

from armwright.units import NUMBER

_WHOLE, _NUMBER = re.compile(r"[-+]?\d+"), re.compile(NUMBER)
_Loader: Any = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader


def find_decimal_commas(text: str) -> list[str]:
    """Return a message for each list of a valid YAML text in which only some commas are followed by a space."""
    return [message for items, commas in _number_lists(text) if (message := _describe(text, items, commas))]


def _number_lists(text: str) -> Iterator[tuple[list[yaml.ScalarEvent], list[str]]]:
    """Yield the items of each list of numbers in brackets, and the text between each two of them."""
    items: list[yaml.ScalarEvent] | None = None
    for event in cast("Iterator[Any]", yaml.parse(text, Loader=_Loader)):
        match event:
            case yaml.SequenceStartEvent(flow_style=True):
                items = []
            case yaml.ScalarEvent() if items is not None:
                items.append(event)
            case yaml.SequenceEndEvent() if items is not None:
                if all(not item.style and _NUMBER.fullmatch(item.value) for item in items):
                    yield items, [text[a.end_mark.index : b.start_mark.index] for a, b in pairwise(items)]
                items = None
            case _:
                items = None


def _describe(text: str, items: list[yaml.ScalarEvent], commas: list[str]) -> str:
    """Return a message if a whole number, a comma without a space and digits may be one number."""
    if all(comma == "," for comma in commas):
        return ""
    for (first, second), comma in zip(pairwise(items), commas, strict=True):
        if comma == "," and _WHOLE.fullmatch(first.value) and second.value.isdigit():
            shown = text[items[0].start_mark.index : items[-1].end_mark.index]
            return (
                f"line {first.start_mark.line + 1}: [{shown}] is a list of {len(items)} numbers; if "
                f"{first.value},{second.value} was meant as one, write {first.value}.{second.value}"
            )
    return ""
