"""Redaction of API keys in everything that is written or shown; keys are only read from the environment."""

import logging
import os
import re
from collections.abc import Iterable, Iterator

from armwright.text import one_line

_NAMES = re.compile(r"(^|_)(KEY|TOKEN|SECRET|PASSWORD)$")
_SENT = re.compile(r"(^|_)API_(KEY|TOKEN)$")  # read and sent by vendors' clients
_MIXED = re.compile(r"[A-Za-z][0-9]|[0-9][A-Za-z]")
SHORTEST = 8  # shorter values occur in ordinary text
LONG = 20  # longer values are not words
PART = 12  # a beginning or an end of this length identifies a key
# sk-abcd****wxyz, as vendors show it. It begins where a word does, and what follows the mask is only looked at, since
# it may be followed by another one.
_MASKED = re.compile(r"(?<![\w-])([\w-]*+)(?:\*{2,}+|\.{3,}+|…)(?=([\w-]*+))")


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
        blot = f"<{name}>"
        text = text.replace(key, blot)
        text = _without(_parts(key, text), blot, text)
        text = _without(_masked(key, text), blot, text)
    return text


def redacted_line(fault: object) -> str:
    """Return an error on one line without keys and without a full stop."""
    return one_line(redacted(str(fault)), 300).rstrip(".")


def _parts(key: str, text: str) -> Iterator[tuple[int, int]]:
    """Yield where beginnings and ends of a key are that identify it, in linear time."""
    reversed_key, reversed_text = key[::-1], text[::-1]
    spans = [(at, at + n) for at, n in _beginnings(key, text)]
    spans += [(len(text) - at - n, len(text) - at) for at, n in _beginnings(reversed_key, reversed_text)]
    yield from sorted(spans)


def _beginnings(key: str, text: str) -> Iterator[tuple[int, int]]:
    """Yield the position and the length of each beginning of a key that identifies it."""
    at = text.find(key[:PART]) if len(key) > PART else -1
    while at >= 0:
        length = PART
        while length < len(key) and text.startswith(key[length], at + length):
            length += 1
        yield at, length
        at = text.find(key[:PART], at + length)


def _masked(key: str, text: str) -> Iterator[tuple[int, int]]:
    """Yield where forms of a key with a masked middle are: the mask, and what of the key is beside it."""
    for found in _MASKED.finditer(text):
        left, right = (len(word) for word in found.groups())
        left, right = left * key.startswith(found[1]), right * key.endswith(found[2])
        if left + right >= 4:
            yield found.end(1) - left, found.start(2) + right


def _without(spans: Iterable[tuple[int, int]], blot: str, text: str) -> str:
    """Replace spans of a text, which may overlap, by `blot`; they are sorted by their starts."""
    pieces: list[str] = []
    end = 0
    for start, stop in spans:
        if start >= end:
            pieces += [text[end:start], blot]
        end = max(end, stop)
    return "".join([*pieces, text[end:]])


def _keys() -> Iterator[tuple[str, str]]:
    """Yield names and values of keys; a value with white space in pieces, since errors write it in other ways."""
    for name, value in os.environ.items():
        if _NAMES.search(name) and (_SENT.search(name) or _looks_secret(value)):
            pieces = value.split()
            for piece in pieces:
                if len(piece) >= SHORTEST and (len(pieces) == 1 or not piece.isalpha()):
                    yield name, piece


def _looks_secret(value: str) -> bool:
    """Return whether a value is not an ordinary word, as in SORT_KEY=position_error."""
    return len(value) >= LONG or bool(_MIXED.search(value))
