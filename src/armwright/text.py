"""Text from outside, made safe for one line."""

import re
import unicodedata

_ESCAPE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")  # terminal colours and other escape sequences


def one_line(text: str, most: int) -> str:
    """Return `text` on one line of at most `most` characters, without invisible characters."""
    if len(text) > 8 * most:
        text = text[: 8 * most]  # an upper bound for blanks and colour codes
    text = " ".join(_visible(text).split())
    return text if len(text) <= most else text[: most - 2].rstrip() + " …"


def _visible(text: str) -> str:
    """Replace control characters by blanks and drop characters without width."""
    kinds = ((letter, unicodedata.category(letter)) for letter in _ESCAPE.sub("", text))
    return "".join(" " if kind == "Cc" else letter for letter, kind in kinds if kind not in ("Cf", "Cs"))


_THOUGHTS = re.compile(r"<think(?:ing)?>.*?(?:</think(?:ing)?>|\Z)", re.DOTALL | re.IGNORECASE)


_THOUGHTS_END = re.compile(r"</think(?:ing)?>", re.IGNORECASE)


def without_thoughts(text: str) -> str:
    """`text` without a model's <think> blocks, also one of which only the end, or only the beginning, is there."""
    return _THOUGHTS_END.split(_THOUGHTS.sub("", text))[-1]


def end_of(text: str, most: int) -> str:
    """The last `most` characters of `text`, which is where an answer stands; visible ones and line ends alone."""
    return "\n".join(map(_visible, text[-most:].splitlines()))


def fence(text: str) -> str:
    """A line of dashes that is longer than any in `text`."""
    return "-" * max([9, *map(len, re.findall(r"-+", text))]) + "-"
