"""Files replaced in one step, and text that they can hold."""

import os
from pathlib import Path


def replace_file(target: Path, content: bytes) -> None:
    """Writes a file so that a crash, and whoever reads it meanwhile, finds the old one or the new one."""
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    os.replace(part, target)


def writable(text: str) -> str:
    """Without lone surrogates, which JSON and names of files can carry and UTF-8 cannot."""
    return text.encode("utf-8", "replace").decode("utf-8")
