"""Keys live in the environment alone: what is written or shown passes through here."""

import logging
import os
import re
from collections.abc import Iterator
from typing import Any

from armwright.text import map_text

_NAMES = re.compile(r"(^|_)(KEY|TOKEN|SECRET|PASSWORD)$")
_SENT = re.compile(r"(^|_)API_(KEY|TOKEN)$")  # what vendors' clients read, and send
_MIXED = re.compile(r"[A-Za-z][0-9]|[0-9][A-Za-z]")
SHORTEST = 8  # a shorter value is no key, and would be found in ordinary words
LONG = 20  # from so many characters on, a value is no word
PART = 12  # so much of a key's beginning or end tells it
_MASKED = re.compile(r"([\w-]*)(?:\*{2,}|\.{3,}|…)([\w-]*)")  # sk-abcd****wxyz, as vendors show it


class WithoutKeys(logging.Filter):
    """For loggers of packages that write what a server sent."""

    def filter(self, record: logging.LogRecord) -> bool:
        record.msg, record.args = redacted(record.getMessage()), ()
        return True


def redacted(text: str) -> str:
    """`text` with every key of the environment blotted out: a server may repeat in its errors what it was sent.

    Also where it shows only the beginning or the end, or masks the middle.
    """
    for name, key in _keys():
        blot = f"<{name}>"
        text = text.replace(key, blot)
        for shown in range(len(key) - 1, PART - 1, -1):
            if key[:PART] in text or key[-PART:] in text:
                text = text.replace(key[:shown], blot).replace(key[-shown:], blot)
        text = _MASKED.sub(lambda masked, key=key, blot=blot: blot if _is_of(key, masked) else masked[0], text)
    return text


def without_keys(content: Any) -> Any:
    """Return JSON content with the keys of the environment redacted in every text."""
    return map_text(content, redacted)


def _keys() -> Iterator[tuple[str, str]]:
    """Names and values; of a value with line breaks or blanks each piece, as errors write these in other ways."""
    for name, value in os.environ.items():
        if _NAMES.search(name) and (_SENT.search(name) or _looks_secret(value)):
            pieces = value.split()
            for piece in pieces:
                if len(piece) >= SHORTEST and (len(pieces) == 1 or not piece.isalpha()):
                    yield name, piece


def _looks_secret(value: str) -> bool:
    """Whether a value is no word or name that an answer could hold by itself, as in SORT_KEY=position_error."""
    return len(value) >= LONG or bool(_MIXED.search(value))


def _is_of(key: str, masked: re.Match[str]) -> bool:
    return len(masked[1] + masked[2]) >= 4 and key.startswith(masked[1]) and key.endswith(masked[2])
