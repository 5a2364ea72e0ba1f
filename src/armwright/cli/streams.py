"""Consoles and formats that all commands share."""

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table


class _Console(Console):
    """A console that reports a closed pipe as any stream does; rich would end the process silently."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def stdout_console() -> Console:
    """Return a console on stdout, in plain text unless stdout is a terminal."""
    return _Console(highlight=False, markup=False, emoji=False, soft_wrap=True)


def stderr_console() -> Console:
    """Return a console on stderr, for commands whose stdout another program reads."""
    return _Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


def print_json(content: Any) -> None:
    """Print content as indented JSON to stdout."""
    print(json.dumps(content, indent=2))


def plain_table(*names: str, right: Sequence[str] = ()) -> Table:
    """Return a table without lines; the columns in `right` are aligned to the right."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in names:
        table.add_column(name, justify="right" if name in right else "left")
    return table


def format_point(point: Sequence[float]) -> str:
    """Return a point as (x, y, z)."""
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"


def repeat_command() -> str:
    """Return the command that was given, quoted for a shell."""
    program, *arguments = sys.argv
    called = ["python", "-m", "armwright"] if Path(program).name == "__main__.py" else [program]
    return shlex.join([*called, *arguments])
