"""Consoles and formats that all commands share."""

import json
import re
import shlex
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.text import Text

from armwright.cli.signals import INTERRUPTED
from armwright.cli.tables import NO_BREAK
from armwright.exceptions import SettingsError
from armwright.files import to_csv

WIDE = 1000  # [characters]
_UNBROKEN = re.compile(r"`[^`]*`|\d (?=(?:%|[A-Za-zµ]{1,3})(?:\W|$))")  # commands, and numbers with their units


class _Console(Console):
    """A console that breaks sentences between words, and reports a closed pipe as any stream does.

    Rich would end the process silently if the pipe is closed.
    """

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError

    def print(self, *objects: Any, **options: Any) -> None:
        """Print objects; sentences that are wider than a terminal are broken between words."""
        if self.is_terminal and len(objects) == 1 and isinstance(objects[0], str):
            objects = (wrap_sentences(objects[0], self.width),)
        super().print(*objects, **options)


def open_console(is_json: bool = False) -> Console:
    """Return a console on stdout, or on stderr if another program reads stdout; plain text unless it is a terminal."""
    console = _Console(stderr=is_json, highlight=False, markup=False, emoji=False, soft_wrap=True)
    if not console.is_terminal:
        console.width = WIDE  # tables in files and pipes are whole
    return console


def print_json(content: Any) -> None:
    """Print content as indented JSON to stdout; paths become strings."""
    print(json.dumps(content, indent=2, default=str))


def print_csv(rows: Iterable[Mapping[str, Any]]) -> None:
    """Print records as CSV with a header to stdout; a record that lacks a key gets an empty field."""
    records = list(rows)
    keys = dict.fromkeys(key for record in records for key in record)
    print(to_csv({key: record.get(key) for key in keys} for record in records), end="")


def check_formats(is_json: bool, is_csv: bool) -> bool:
    """Return whether a program reads stdout; SettingsError if both formats are asked for."""
    if is_json and is_csv:
        raise SettingsError("--json and --csv: expected one of them")
    return is_json or is_csv


def wrap_sentences(text: str, width: int) -> str:
    """Return text with line breaks between words; commands in backticks stay whole, for copying."""
    lines: list[str] = []
    for line in text.split("\n"):
        whole = _UNBROKEN.sub(lambda found: found[0].replace(" ", NO_BREAK), line)
        indent = line[: len(line) - len(line.lstrip())] + "  "
        lines += textwrap.wrap(
            whole, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        ) or [""]
    return "\n".join(lines).replace(NO_BREAK, " ")


def print_named(console: Console, name: str, text: str) -> None:
    """Print text that begins with a name in bold."""
    whole = wrap_sentences(name + text, console.width) if console.is_terminal else name + text
    shown = Text(whole)
    shown.stylize("bold", 0, len(name))
    console.print(shown)


def print_command(console: Console, command: str) -> None:
    """Print a command on a line of its own, whole, for copying."""
    console.print(Text(f"  {command}"))


def exit_interrupted(console: Console, kept: str) -> NoReturn:
    """Print what an interrupted command has kept and how to resume it, and exit."""
    console.print(f"\nstopped; {kept}. Resume with:")
    print_command(console, repeat_command())
    sys.exit(INTERRUPTED)


def list_files(name: str, files: Sequence[Path]) -> str:
    """Return a line that names files in one folder."""
    return f"{name}: {files[0].parent}/ ({', '.join(file.name for file in files)})"


def format_point(point: Sequence[float]) -> str:
    """Return a point as (x, y, z)."""
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"


def repeat_command() -> str:
    """Return the command that was given, quoted for a shell."""
    program, *arguments = sys.argv
    called = ["python", "-m", "armwright"] if Path(program).name == "__main__.py" else [program]
    return shlex.join([*called, *arguments])
