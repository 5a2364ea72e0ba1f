"""Files replaced in one step, and text that they can hold."""

import os
import shutil
from pathlib import Path


def replace_file(target: Path, content: bytes) -> None:
    """Writes a file so that a crash, and whoever reads it meanwhile, finds the old one or the new one."""
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    os.replace(part, target)


def replace_folder(target: Path, part: Path | None = None) -> None:
    """Puts the folder `part` in the place of another, or nothing; a crash leaves the old one, none or the new one."""
    old = target.with_name(target.name + ".old")
    if old.exists():
        shutil.rmtree(old)
    if target.exists():
        target.rename(old)  # in one step, while its files go one by one
    if part is not None:
        part.rename(target)
    if old.exists():
        shutil.rmtree(old)


def writable(text: str) -> str:
    """Without lone surrogates, which JSON and names of files can carry and UTF-8 cannot."""
    return text.encode("utf-8", "replace").decode("utf-8")
