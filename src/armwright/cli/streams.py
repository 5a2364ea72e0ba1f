"""Output streams, consoles and formats that all commands share."""

import json
import os
import shlex
import sys
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn, TextIO

from rich.console import Console
from rich.text import Text

from armwright.cli.signals import INTERRUPTED

WIDE = 1000  # [characters]
_own: dict[int, TextIO] = {}  # our copies of stdout (1) and stderr (2)


def claim_streams() -> None:
    """Keep stdout for our own output: what other code in this process prints, C libraries included, goes to stderr.

    Nor does it end our output if that code closes its streams. The streams of a test runner stay as they are.
    """
    if _own or sys.stdout is not sys.__stdout__:
        return
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        encoding, errors = ("utf-8", None) if stream is None else (stream.encoding, stream.errors)
        _own[number] = open(os.dup(number), "w", encoding=encoding, errors=errors)  # noqa: SIM115 (used until the end)
    os.dup2(2, 1)


def abandon_streams() -> None:
    """Drop what is still to be written to stdout and stderr, which cannot be written."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2, *(stream.fileno() for stream in _own.values())):
        os.dup2(nowhere, number)


def print_text(text: str, end: str = "\n") -> None:
    """Print text to stdout as it is, at once."""
    _print(text, end, _own.get(1))


def print_error(text: str) -> None:
    """Print text to stderr as it is, at once."""
    _print(text, "\n", _own.get(2, sys.stderr))


def _print(text: str, end: str, stream: TextIO | None) -> None:
    try:
        print(text, end=end, file=stream, flush=True)
    except BrokenPipeError:
        raise BrokenPipeError from None  # without its number, for which Typer would end the process silently


class _Console(Console):
    """A console that reports a closed pipe as any stream does, where Rich would end the process silently."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def open_console(is_json: bool = False) -> Console:
    """Return a console on stdout, or on stderr if another program reads stdout; plain text unless it is a terminal."""
    file = _own.get(2 if is_json else 1)
    console = _Console(file=file, stderr=is_json, highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.soft_wrap, console.width = True, WIDE  # lines and tables in files and pipes are whole
    return console


@contextmanager
def activity(description: str) -> Generator[None]:
    """Show on stderr what is being done, such as "drawing figures", in a terminal; nothing may be printed meanwhile."""
    with open_console(is_json=True).status(Text(f"{description} ...", no_wrap=True)):
        yield


def print_json(content: Any) -> None:
    """Print content as indented JSON to stdout; paths become strings."""
    print_text(json.dumps(content, indent=2, default=str))


def print_csv(rows: Iterable[Mapping[str, Any]]) -> None:
    """Print records as CSV with a header to stdout."""
    from armwright.files import to_csv  # imports pydantic

    print_text(to_csv(rows), end="")


def print_records(is_json: bool, is_csv: bool, content: Any, rows: Iterable[Mapping[str, Any]]) -> bool:
    """Print content as JSON or rows as CSV; return whether either was asked for."""
    if is_json:
        print_json(content)
    elif is_csv:
        print_csv(rows)
    return is_json or is_csv


def print_named(console: Console, name: str, text: str) -> None:
    """Print text that begins with a name in bold."""
    console.print(Text.assemble((name, "bold"), text))


def print_command(console: Console, command: str) -> None:
    """Print a command on a line of its own, whole, for copying."""
    console.print(f"  {command}", soft_wrap=True)


def exit_interrupted(console: Console, kept: str) -> NoReturn:
    """Print what an interrupted command has kept and how to resume it, and exit."""
    console.print(f"\nstopped; {kept}. Resume with:")
    program, *arguments = sys.argv
    called = ["python", "-m", "armwright"] if Path(program).name == "__main__.py" else [program]
    print_command(console, shlex.join([*called, *arguments]))
    sys.exit(INTERRUPTED)


def list_files(name: str, files: Sequence[Path]) -> str:
    """Return a line that names files in one folder."""
    return f"{name}: {files[0].parent}/ ({', '.join(file.name for file in files)})"


def format_point(point: Sequence[float]) -> str:
    """Return a point as (x, y, z)."""
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"
