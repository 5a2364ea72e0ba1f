"""The entry point `armwright`: registers the commands and turns errors into one line and an exit code.

Modules that a command needs are imported when it runs, so that `armwright --help` stays fast.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from io import TextIOWrapper
from typing import Annotated, NoReturn

import typer

from armwright.cli.datasheet_command import datasheet
from armwright.cli.experiment_commands import compare, compare_arms, experiment
from armwright.cli.input_commands import actuators, check, draft, edit, init, tasks
from armwright.cli.options import read_declaration
from armwright.cli.output_commands import doctor, export, pick, report
from armwright.cli.reach_map_command import reach_map
from armwright.cli.search_commands import design, optimize
from armwright.cli.signals import INTERRUPTED, install_handlers
from armwright.cli.simulate_command import simulate
from armwright.cli.streams import abandon_streams, claim_streams, print_error
from armwright.exceptions import ArmwrightError, SettingsError
from armwright.extras import naming_extras
from armwright.user_code import open_closed_streams

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Which robot arm should I build for this task? Searches base position, joint types and link lengths "
    "for small position error and small joint torque, and returns the Pareto set with a URDF for each arm.",
)
CLOSED = "output pipe closed; rerun the same command to resume an unfinished run"
COMMANDS = {
    "Before a run": (init, edit, check, tasks, actuators, draft),
    "Search": (design, optimize, experiment),
    "After a run": (pick, export, simulate, datasheet, reach_map, compare, compare_arms),
    "Show": (report, doctor),
}


def _command(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command as Typer declares it, which claims the streams first and names the extra that it lacks.

    Not before Typer has printed help, which uses sys.stdout.
    """

    @wraps(function)
    def command(*arguments: object, **options: object) -> None:
        claim_streams()
        if options.get("json_") and options.get("csv_"):
            raise SettingsError("--json and --csv: expected one of them")
        with naming_extras(function.__name__.replace("_", "-")):
            function(*arguments, **options)

    command.__doc__, command.__signature__ = read_declaration(function)  # pyright: ignore[reportAttributeAccessIssue]
    return command


for _panel, _functions in COMMANDS.items():
    for _function in _functions:
        app.command(rich_help_panel=_panel)(_command(_function))


def main() -> NoReturn:
    """Run a command; expected errors become one line and an exit code."""
    open_closed_streams()
    install_handlers()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without "³" still shows the rest
    try:
        app()
    except ArmwrightError as error:
        for note in getattr(error, "__notes__", ()):  # the traceback of an evaluator's code
            print_error(note)
        print_error(f"armwright: {error}")
        sys.exit(error.exit_code)
    except OSError as error:
        with suppress(OSError):  # stderr may be gone as well
            reason = f"{error.strerror or error}: {error.filename or 'the output'}"
            print_error(f"armwright: {CLOSED if isinstance(error, BrokenPipeError) else reason}")
        abandon_streams()
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.exit(0)


def _show_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        print(version("armwright"))
        raise typer.Exit


@app.callback()
def _options(  # pyright: ignore[reportUnusedFunction] - registered by the decorator
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Declare the options of armwright itself."""
