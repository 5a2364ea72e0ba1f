"""Keys live in the environment alone: what is written or shown passes through here."""

import os
import re

_NAMES = re.compile(r"(_KEY|_TOKEN|_SECRET|_PASSWORD)$")
SHORTEST = 8  # a shorter value is no key, and would be found in ordinary words


def redacted(text: str) -> str:
    """`text` with every key of the environment blotted out: a server may repeat in its errors what it was sent."""
    for name, value in os.environ.items():
        if _NAMES.search(name) and len(value) >= SHORTEST:
            text = text.replace(value, f"<{name}>")
    return text
