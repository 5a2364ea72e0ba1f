"""Atomic replacement of files that follows no links, CSV, and names that any file system accepts."""

import csv
import hashlib
import io
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import FileIO
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from pydantic import ValidationError

from armwright.exceptions import ArmwrightError, DesignError, RunFolderError

MAX_DERIVED = 64 * 1024 * 1024  # [bytes] of a file that a run derives from its trials, far above the largest
MAX_LINE = 16 * 1024 * 1024  # [bytes] of a record; a prompt has at most 1,000,000 characters
MAX_RECORDS = 1024 * 1024 * 1024  # [bytes] of a file of records, such as 300,000 trials
_PART = re.compile(r"(\d{1,10})-[0-9a-f]{16}\.part$")  # of a process
# Windows reserves device names, whatever their suffix, and drops a dot at the end.
_NO_FILE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?|.*\.", re.IGNORECASE)


T = TypeVar("T")


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
    return decode_text(read_bytes(path, limit, error), path, error)


def decode_text(content: bytes, path: Path, error: type[Exception]) -> str:
    """Return the text of a file in UTF-8, with LF line ends and without a byte order mark."""
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not a text file in UTF-8") from fault


def read_records(file: BinaryIO, path: Path) -> Iterator[bytes]:
    """Yield the lines of a file from its position on, without their ends and without a truncated last line.

    Raises:
        RunFolderError: A line, or all of them, are longer than any that a run writes.
    """
    total = 0
    while line := file.readline(MAX_LINE + 1):
        total += len(line)
        if len(line) > MAX_LINE or total > MAX_RECORDS:
            limit, of = (MAX_LINE, "a line") if len(line) > MAX_LINE else (MAX_RECORDS, "all lines")
            raise RunFolderError(f"{path}: expected at most {limit // 1024**2:,} MiB of {of}; restore the file")
        if line.endswith(b"\n"):
            yield line[:-1]


def read_log(path: Path, parse: Callable[[bytes, int], T], way_out: str) -> tuple[list[T], int]:
    """Return the records of a file that grows line by line, and its length [bytes] without a truncated last line.

    Without a file there are none. `parse` gets a line and its number, from 0.

    Raises:
        RunFolderError: The file cannot be read, or a line is damaged; the message ends with the way out.
    """
    records: list[T] = []
    end = 0
    try:
        with path.open("rb") as file:
            for number, line in enumerate(read_records(file, path)):
                end += len(line) + 1
                records.append(parse(line, number))
    except FileNotFoundError:
        return [], 0
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault
    except (ValueError, DesignError) as fault:
        raise RunFolderError(
            f"{path}, line {len(records) + 1} is damaged ({_first_error(fault)}); {way_out}"
        ) from fault
    return records, end


def _first_error(fault: Exception) -> str:
    if not isinstance(fault, ValidationError):
        return str(fault)
    first = fault.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg'].removeprefix('Value error, ')}".removeprefix(": ")


def digest(files: Iterable[Path]) -> bytes:
    """Return the sha256 of files, with their folders' names; those that no reader of records takes are ignored."""
    found = hashlib.sha256()
    for path in files:
        with suppress(OSError), path.open("rb") as file:
            if os.fstat(file.fileno()).st_size <= MAX_RECORDS:
                name = os.fsencode("/".join(path.parts[-2:]))
                found.update(name + hashlib.file_digest(file, "sha256").digest())
    return found.digest()


def replace_file(target: Path, content: bytes, mode: int = 0o666) -> None:
    """Replace a file atomically: readers, and a crash, leave the old or the new content. A link is replaced itself.

    `mode` states its permissions, less those of the umask, from the moment when it is created.
    """
    part = new_part(target)
    try:
        with open(part, "xb", opener=lambda path, flags: os.open(path, flags, mode)) as file:
            file.write(content)
        os.replace(part, target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def replace_folder(target: Path, part: Path | None = None) -> None:
    """Replace a folder by `part`, or remove it; a crash leaves the old folder, none or the new one."""
    old = new_part(target)
    if target.exists():
        target.rename(old)  # atomic, unlike the removal of its files
    if part is not None:
        part.rename(target)
    if old.exists():
        shutil.rmtree(old)


def new_part(target: Path) -> Path:
    """Return a name beside a file or folder for its next content, which no other writer has.

    What killed processes left there for the same file or folder is removed.
    """
    prefix = f".{target.name}."
    for other in target.parent.iterdir():
        found = _PART.fullmatch(other.name.removeprefix(prefix)) if other.name.startswith(prefix) else None
        if found is not None and not _is_alive(int(found[1])):
            shutil.rmtree(other) if other.is_dir() and not other.is_symlink() else other.unlink(missing_ok=True)
    return target.with_name(f"{prefix}{os.getpid()}-{secrets.token_hex(8)}.part")


def is_part(name: str) -> bool:
    """Return whether `new_part` gave this name."""
    return name.startswith(".") and _PART.search(name) is not None


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):  # another user's, or no number of a process
        return True
    return True


def open_to_append(path: Path) -> FileIO:
    """Open a file to append, without a buffer; OSError if it is a link."""
    return open(path, "ab", buffering=0, opener=lambda path, flags: os.open(path, flags | os.O_NOFOLLOW, 0o666))


def check_no_links(folder: Path) -> None:
    """Raise RunFolderError if a folder holds links, pipes or devices: what is unpacked may lead out of the folder."""
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = os.path.join(place, name)
            try:
                mode = os.lstat(path).st_mode
            except OSError:  # deleted meanwhile, or unreadable: whoever needs it says so
                continue
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                kind = "a link" if stat.S_ISLNK(mode) else "no ordinary file"
                raise RunFolderError(f"{path} is {kind}; remove it, or put the file itself in its place")


def replace_surrogates(text: str) -> str:
    """Return text without lone surrogates, which JSON and file names allow and UTF-8 does not."""
    return text.encode("utf-8", "replace").decode("utf-8")


def check_name(name: str) -> str:
    """Return the name; raise ValueError if Windows does not allow a file of this name."""
    if _NO_FILE.fullmatch(name):
        raise ValueError(f'"{name}" cannot be the name of a file on Windows; choose another')
    return name


def to_csv(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return records as CSV with a header; empty if there are none. A record that lacks a key gets an empty field."""
    rows, out = list(rows), io.StringIO()
    if rows:
        keys = dict.fromkeys(key for row in rows for key in row)
        writer = csv.DictWriter(out, fieldnames=list(keys), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return out.getvalue()
