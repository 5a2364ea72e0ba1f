"""A line on stderr that says what a command is doing, in a terminal only."""

from collections.abc import Generator
from contextlib import contextmanager

from rich.text import Text

from armwright.cli.streams import open_console


@contextmanager
def activity(description: str) -> Generator[None]:
    """Show on stderr what is being done, such as "drawing figures"; nothing may be printed meanwhile."""
    console = open_console(is_json=True)
    with console.status(Text(f"{description} ...", no_wrap=True)):
        yield
