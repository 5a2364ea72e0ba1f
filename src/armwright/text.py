"""Untrusted text made safe to show."""

import math
import re
import unicodedata
from collections.abc import Callable, Sequence
from typing import Any, cast

_ESCAPE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")  # terminal colours and other escape sequences


def one_line(text: str, most: int) -> str:
    """Return `text` on one line of at most `most` characters, without invisible characters."""
    if len(text) > 8 * most:
        text = text[: 8 * most]  # an upper bound for blanks and colour codes
    text = " ".join(visible(text).split())
    return text if len(text) <= most else text[: most - 2].rstrip() + " …"


def visible(text: str) -> str:
    """Replace control characters by blanks and drop characters without width."""
    kinds = ((letter, unicodedata.category(letter)) for letter in _ESCAPE.sub("", text))
    return "".join(" " if kind == "Cc" else letter for letter, kind in kinds if kind not in ("Cf", "Cs"))


def listed(names: Sequence[str], most: int = 6) -> str:
    """Return names with commas; of many, the first ones and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def rounded(value: float | None, digits: int = 3) -> str:
    """Return a value with so many significant digits; a large one with all its digits, not with an exponent."""
    if value is None:
        return "–"
    return f"{value:.{digits}g}" if abs(value) < 10.0**digits else f"{value:,.0f}"


def decimals(value: float | None, places: int = 2) -> str:
    """Return a value with this many decimal places."""
    return "–" if value is None else f"{value:.{places}f}"


def percent(share: float | None, places: int = 0) -> str:
    """Return a share in percent."""
    return "–" if share is None else f"{100.0 * share:.{places}f} %"


def significant(value: float, digits: int = 3) -> str:
    """Return a value with significant digits, without an exponent and with at most three decimals."""
    decimals = 0 if value == 0.0 else digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{value:,.{min(max(decimals, 0), 3)}f}"
    return text if any(letter in "123456789" for letter in text) else "0"


_THOUGHTS = re.compile(r"<(/?)think(?:ing)?>", re.IGNORECASE)


def without_thoughts(text: str) -> str:
    """Return `text` without the <think> blocks of a model, including blocks that lack their start or end tag."""
    kept: list[str] = []
    end, is_thought = 0, False
    for tag in _THOUGHTS.finditer(text):
        if tag[1]:
            kept = kept if is_thought else []  # what came before are thoughts without their start
            end, is_thought = tag.end(), False
        elif not is_thought:
            kept.append(text[end : tag.start()])
            is_thought = True
    return "".join([*kept, "" if is_thought else text[end:]])


def end_of(text: str, most: int) -> str:
    """Return the last `most` characters of `text`, where the answer is, without invisible characters."""
    return "\n".join(map(visible, text[-most:].splitlines()))


def fence(text: str) -> str:
    """Return a line of dashes that is longer than any in `text`."""
    return "-" * max([9, *map(len, re.findall(r"-+", text))]) + "-"


def map_text(content: Any, change: Callable[[str], str]) -> Any:
    """Return JSON content with every text in it changed; names and numbers stay."""
    if isinstance(content, str):
        return change(content)
    if isinstance(content, list):
        return [map_text(item, change) for item in cast("list[Any]", content)]
    if isinstance(content, dict):
        return {name: map_text(value, change) for name, value in cast("dict[Any, Any]", content).items()}
    return content
