"""Atomic replacement of files, CSV, and names that any file system accepts."""

import csv
import io
import os
import re
import shutil
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from armwright.exceptions import ArmwrightError, RunFolderError

# Windows reserves device names, whatever their suffix, and drops a dot at the end.
_NO_FILE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?|.*\.", re.IGNORECASE)


@contextmanager
def naming_write_errors(path: Path, note: str = "", error: type[ArmwrightError] = RunFolderError) -> Generator[None]:
    """Turn an OSError inside the block into an error that names the path; note: appended to its message."""
    try:
        yield
    except OSError as fault:
        raise error(f"cannot write {path}: {fault.strerror or fault}{note}") from fault


def read_bytes(path: Path, limit: int, error: type[Exception]) -> bytes:
    """Read a file of at most `limit` bytes; raise `error` with a one-line message if that fails."""
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)  # not stat(): a device has no size
    except (OSError, ValueError) as fault:  # ValueError: a NUL in the name
        raise error(f"cannot read {path}: {getattr(fault, 'strerror', None) or fault}") from fault
    if len(data) > limit:
        raise error(f"{path}: expected at most {limit // 1024:,} KiB")
    return data


def read_text(path: Path, limit: int, error: type[Exception]) -> str:
    """Read a text file in UTF-8 as `read_bytes` does, without a byte order mark."""
    try:
        return read_bytes(path, limit, error).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not a text file in UTF-8") from fault


def replace_file(target: Path, content: bytes) -> None:
    """Replace a file atomically: readers, and a crash, leave the old or the new content."""
    part = target.with_name(target.name + ".part")
    part.write_bytes(content)
    os.replace(part, target)


def replace_folder(target: Path, part: Path | None = None) -> None:
    """Replace a folder by `part`, or remove it; a crash leaves the old folder, none or the new one."""
    old = target.with_name(target.name + ".old")
    if old.exists():
        shutil.rmtree(old)
    if target.exists():
        target.rename(old)  # atomic, unlike the removal of its files
    if part is not None:
        part.rename(target)
    if old.exists():
        shutil.rmtree(old)


def replace_surrogates(text: str) -> str:
    """Return text without lone surrogates, which JSON and file names allow and UTF-8 does not."""
    return text.encode("utf-8", "replace").decode("utf-8")


def check_name(name: str) -> str:
    """Return the name; raise ValueError if Windows does not allow a file of this name."""
    if _NO_FILE.fullmatch(name):
        raise ValueError(f'"{name}" cannot be the name of a file on Windows; choose another')
    return name


def to_csv(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return records with the same keys as CSV with a header; empty if there are none."""
    rows, out = list(rows), io.StringIO()
    if rows:
        writer = csv.DictWriter(out, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return out.getvalue()
