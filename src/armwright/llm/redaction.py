"""Redaction of API keys in everything that is written or shown; keys are only read from the environment."""

import logging
import os
import re
from collections.abc import Callable, Iterator

from armwright.text import one_line

_NAMES = re.compile(r"(^|_)(KEY|TOKEN|SECRET|PASSWORD)$")
_SENT = re.compile(r"(^|_)API_(KEY|TOKEN)$")  # read and sent by vendors' clients
_MIXED = re.compile(r"[A-Za-z][0-9]|[0-9][A-Za-z]")
SHORTEST = 8  # shorter values occur in ordinary text
LONG = 20  # longer values are not words
PART = 12  # a beginning or an end of this length identifies a key
# sk-abcd****wxyz, as vendors show it, from the beginning of a word or from the mask on
_MASKED = re.compile(r"((?<![\w-])[\w-]*+|)((?:\*{2,}+|\.{3,}+|…))([\w-]*+)")


class WithoutKeys(logging.Filter):
    """Redact keys in the loggers of packages that log what a server sent."""

    def filter(self, record: logging.LogRecord) -> bool:
        record.msg, record.args = redacted(record.getMessage()), ()
        return True


def redacted(text: str) -> str:
    """Return `text` with every key of the environment redacted, since errors of a server may repeat it.

    This includes its beginning, its end, and forms with a masked middle.
    """
    for name, key in _keys():
        text = _MASKED.sub(_blot(key, f"<{name}>"), _whole(key).sub(lambda _, name=name: f"<{name}>", text))
    return text


def redacted_line(fault: object) -> str:
    """Return an error on one line without keys and without a full stop."""
    return one_line(redacted(str(fault)), 300).rstrip(".")


def _whole(key: str) -> re.Pattern[str]:
    """Return the pattern of a key and of words with its beginning or its end, which takes linear time."""
    whole, start, end = (re.escape(part) for part in (key, key[:PART], key[-PART:]))
    return re.compile(rf"{whole}|{start}[\w-]*+|(?<![\w-])[\w-]*{end}|{end}" if len(key) > PART else rf"{whole}")


def _blot(key: str, blot: str) -> Callable[[re.Match[str]], str]:
    """Return what replaces a masked word: `blot` for the mask and what of the key is beside it."""

    def replaced(found: re.Match[str]) -> str:
        left, mask, right = found.groups()
        starts, ends = key.startswith(left), key.endswith(right)
        if starts * len(left) + ends * len(right) < 4:
            return left + mask + right
        return ("" if starts else left) + blot + ("" if ends else right)

    return replaced


def _keys() -> Iterator[tuple[str, str]]:
    """Yield names and values of keys; a value with white space in pieces, since errors write it in other ways."""
    for name, value in os.environ.items():
        # An ordinary word, as in SORT_KEY=position_error, is no secret.
        if _NAMES.search(name) and (_SENT.search(name) or len(value) >= LONG or _MIXED.search(value)):
            pieces = value.split()
            for piece in pieces:
                if len(piece) >= SHORTEST and (len(pieces) == 1 or not piece.isalpha()):
                    yield name, piece
