"""Commands that show and export what a run holds: pick, export, report, doctor."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from armwright.cli.activity import activity
from armwright.cli.options import Csv, Json, ModelName, ModelOptionsFile, RunFolder, option
from armwright.cli.streams import check_formats, open_console, print_csv, print_json, print_text
from armwright.exceptions import FailureError, SettingsError


def pick(
    run: RunFolder,
    where: Annotated[list[str] | None, option('A condition such as "position_error<=0.05" (may be repeated).')] = None,
    by: Annotated[str | None, option("The quantity to minimise: torque, mass, link_1, …")] = None,
    weights: Annotated[
        str | None, option("Weights of objectives relative to the reference point: position_error=2,torque=1.")
    ] = None,
    robust: Annotated[
        bool, option("Only designs that stay good with the base or a link 1 mm off.", "--robust")
    ] = False,
    n: Annotated[int, option("Number of designs, the best first.", "-n")] = 1,
    all_: Annotated[bool, option("All designs that meet the conditions, in a table.", "--all")] = False,
    json_: Json = False,
    csv_: Csv = False,
) -> None:
    """Choose designs of RUN's front by conditions, one quantity or weights; by default, its knee."""
    from armwright.cli.show_picked import picked_rows, show_picked, show_picked_table, with_parts
    from armwright.problem.conditions import read_condition, read_weights
    from armwright.proof.selection import pick_from, survival_of

    check_formats(json_, csv_)
    if n < 1:
        raise SettingsError(f"-n {n}: expected a whole number from 1")
    conditions = [read_condition(text) for text in where or ()]
    weighed = None if weights is None else read_weights(weights)
    with activity(f"reading {run}"):
        history, picked, records = pick_from(run, conditions, by, weighed, robust)
    chosen = picked if all_ else picked[:n]
    names = [*(condition.name for condition in conditions), *([] if by is None else [by])]
    rows = picked_rows(history, chosen, names, records)
    if csv_:
        print_csv(rows)
        return
    if all_ and not json_:
        show_picked_table(open_console(), history, chosen, names, records)
        return
    with activity("perturbing the chosen designs"):
        survival = {} if all_ else survival_of(run, history, [member.number for member in chosen])
    if json_:
        print_json(list(with_parts(rows, records, survival)))
        return
    show_picked(open_console(), run, history, picked, records, survival, n)


def export(
    run: RunFolder,
    design: Annotated[int | None, option("Number of the design.", default="the knee of the front")] = None,
    format_: Annotated[
        str, option("urdf, ros2_control or mjcf; optuna: the whole run as a study.", "--format")
    ] = "urdf",
    out: Annotated[
        Path | None, option("Output file.", default="stdout; for optuna, study.db in the run folder")
    ] = None,
) -> None:
    """Write a design of RUN for a simulator or a workshop, or all of RUN for Optuna.

    Any design of the run can be exported, not only those of the front.
    """
    from armwright.extras import naming_extras
    from armwright.proof.export import OPTUNA, export_design

    if format_ == OPTUNA:
        with naming_extras(f"--format {OPTUNA}"):
            from armwright.study.optuna_export import export_study

        if design is not None:
            raise SettingsError(f"--design {design} does not go with --format optuna, which exports the whole run")
        with activity(f"exporting {run}"):
            database = export_study(run, out)
        print_text(f"{database}; to view it in a browser (pip install optuna-dashboard):")
        print_text(f"  {shlex.join(['optuna-dashboard', f'sqlite:///{database.as_posix()}'])}")
        return
    with activity(f"exporting a design of {run}"):
        text = export_design(run, design, format_)
    if out is None:
        print_text(text, end="")
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")


def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")],
    live: Annotated[bool, option("Serve the live page of RUN until Ctrl-C instead (extra live).", "--live")] = False,
    host: Annotated[
        str, option("Address to listen on; any other than the default opens the page to a network.")
    ] = "127.0.0.1",
    port: Annotated[int, option("Port to listen on; 0: any free port.")] = 0,
    follow: Annotated[bool, typer.Option("--follow", hidden=True)] = False,
) -> None:
    """Write report.html into each RUN: one file for any browser, without a network."""
    from armwright.page.live_server import serve
    from armwright.page.page import write_report
    from armwright.runs.folder import read_config

    if live:
        if len(runs) > 1:
            raise SettingsError(f"--live: expected one run folder, got {len(runs)}")
        if not follow:
            read_config(runs[0])  # report a folder without a run at once
        serve(runs[0], print_text, host, port, sys.stdin.buffer if follow else None)
        return
    for run in runs:
        with activity(f"writing the page of {run}"):
            written = write_report(run)
        print_text(str(written))


def doctor(
    model: ModelName = None,
    model_options: ModelOptionsFile = None,
    call: Annotated[bool, option("Make one small call to the configured model.", "--call")] = False,
) -> None:
    """Show what is installed and which models are configured.

    Nothing is sent unless --call is given.
    """
    from armwright.cli.doctor import WRONG, examine, try_model
    from armwright.llm.configuration import load_model_options

    console = open_console()
    options = load_model_options(model_options, model=model)
    marks: set[str] = set()
    for mark, finding in examine(options):
        console.print(f"{mark} {finding}")
        marks.add(mark)
    if WRONG in marks:
        sys.exit(FailureError.exit_code)
    if call:
        console.print(try_model(options))
