"""A line on stderr that says what a command is doing, in a terminal only."""

import threading
from collections.abc import Generator
from contextlib import contextmanager

from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from armwright.cli.streams import open_console

DELAY = 0.7  # [s] before the line appears: short work is not announced


@contextmanager
def activity(description: str, delay: float = DELAY) -> Generator[None]:
    """Show on stderr what is being done and for how long, until it is done.

    Nothing is shown if stderr is no terminal. Nothing may be printed meanwhile.

    Args:
        description: The work, such as "drawing figures".
        delay: Time before the line appears [s].
    """
    console = open_console(is_json=True)
    if not console.file.isatty():
        yield
        return
    text = TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True))
    line = Progress(SpinnerColumn(), text, TimeElapsedColumn(), console=console, transient=True)
    line.add_task(description, total=None)
    timer = threading.Timer(delay, line.start)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may just have started the line
        line.stop()
