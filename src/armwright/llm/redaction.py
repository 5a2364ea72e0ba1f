"""Redaction of API keys in everything that is written or shown; keys are only read from the environment."""

import logging
import os
import re
from collections.abc import Iterator

_NAMES = re.compile(r"(^|_)(KEY|TOKEN|SECRET|PASSWORD)$")
_SENT = re.compile(r"(^|_)API_(KEY|TOKEN)$")  # read and sent by vendors' clients
_MIXED = re.compile(r"[A-Za-z][0-9]|[0-9][A-Za-z]")
SHORTEST = 8  # shorter values occur in ordinary text
LONG = 20  # longer values are not words
PART = 12  # a beginning or an end of this length identifies a key
_MASKED = re.compile(r"([\w-]*)(?:\*{2,}|\.{3,}|…)([\w-]*)")  # sk-abcd****wxyz, as vendors show it


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
        for shown in range(len(key) - 1, PART - 1, -1):
            if key[:PART] in text or key[-PART:] in text:
                text = text.replace(key[:shown], blot).replace(key[-shown:], blot)
        text = _MASKED.sub(lambda masked, key=key, blot=blot: blot if _is_of(key, masked) else masked[0], text)
    return text


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


def _is_of(key: str, masked: re.Match[str]) -> bool:
    return len(masked[1] + masked[2]) >= 4 and key.startswith(masked[1]) and key.endswith(masked[2])
