"""Consoles and formats that all commands share."""

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console
from rich.table import Table
from rich.text import Text

from armwright.cli.signals import INTERRUPTED

WIDE = 1000  # [characters]


class _Console(Console):
    """A console that reports a closed pipe as any stream does; rich would end the process silently."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def open_console(is_json: bool = False) -> Console:
    """Return a console on stdout, or on stderr if another program reads stdout; plain text unless it is a terminal."""
    console = _Console(stderr=is_json, highlight=False, markup=False, emoji=False, soft_wrap=True)
    if not console.is_terminal:
        console.width = WIDE  # tables in files and pipes are whole
    return console


def print_json(content: Any) -> None:
    """Print content as indented JSON to stdout; paths become strings."""
    print(json.dumps(content, indent=2, default=str))


def plain_table(*names: str, right: Sequence[str] = (), title: str | None = None, gap: int = 2) -> Table:
    """Return a table without lines.

    Args:
        names: Heads of the columns.
        right: The columns that are aligned to the right and do not wrap.
        title: Title above the table.
        gap: Spaces between two columns.
    """
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, gap, 0, 0))
    for name in names:
        is_number = name in right
        table.add_column(Text(name), justify="right" if is_number else "left", no_wrap=is_number)
    return table


def exit_interrupted(console: Console, kept: str) -> NoReturn:
    """Print what an interrupted command has kept and how to resume it, and exit."""
    console.print(f"\nstopped; {kept}. Resume with:\n  {repeat_command()}")
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
