"""Files replaced in one step, text that they can hold, and names that they can have."""

import os
import re
import shutil
from pathlib import Path

# What Windows takes for a device, whatever its ending; and a dot at the end, which it drops.
_NO_FILE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?|.*\.", re.IGNORECASE)


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


def check_name(name: str) -> str:
    """A name of letters that any file can have; ValueError where a file of this name can be made on no Windows."""
    if _NO_FILE.fullmatch(name):
        raise ValueError(f'"{name}" cannot be the name of a file on Windows; choose another')
    return name
