"""Commands that show and export what a run holds: pick, export, report, live, prompt, doctor."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from armwright.cli.activity import activity
from armwright.cli.options import (
    Csv,
    EvaluatorName,
    Json,
    ModelName,
    ModelOptionsFile,
    RunFolder,
    SpaceFile,
    load_problem,
)
from armwright.cli.streams import check_formats, open_console, print_csv, print_error, print_json, print_text
from armwright.exceptions import FailureError, SettingsError


def pick(
    run: RunFolder,
    where: Annotated[
        list[str] | None, typer.Option(help='A condition such as "position_error<=0.05" (may be repeated).')
    ] = None,
    by: Annotated[str | None, typer.Option(help="The quantity to minimise: torque, mass, link_1, …")] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="Weights of objectives relative to the reference point: position_error=2,torque=1."),
    ] = None,
    robust: Annotated[
        bool, typer.Option("--robust", help="Only designs that stay good with the base or a link 1 mm off.")
    ] = False,
    n: Annotated[int, typer.Option("-n", help="Number of designs, the best first.")] = 1,
    all_: Annotated[bool, typer.Option("--all", help="All designs that meet the conditions, in a table.")] = False,
    json_: Json = False,
    csv_: Csv = False,
) -> None:
    """Choose designs of RUN's front by conditions, one quantity or weights; by default, its knee."""
    from armwright.cli.show_picked import picked_records, picked_rows, show_picked, show_picked_table
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
    if csv_:
        print_csv(picked_rows(history, chosen, names, records))
        return
    if all_ and not json_:
        show_picked_table(open_console(), history, chosen, names, records)
        return
    with activity("perturbing the chosen designs"):
        survival = {} if all_ else survival_of(run, history, [member.number for member in chosen])
    if json_:
        print_json(list(picked_records(history, chosen, names, records, survival)))
        return
    show_picked(open_console(), run, history, picked, records, survival, n)


def export(
    run: RunFolder,
    design: Annotated[
        int | None, typer.Option(help="Number of the design.", show_default="the knee of the front")
    ] = None,
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="urdf, ros2_control or mjcf; optuna: the whole run as a study.",
        ),
    ] = "urdf",
    out: Annotated[
        Path | None, typer.Option(help="Output file.", show_default="stdout; for optuna, study.db in the run folder")
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
            study = export_study(run, out)
        print_text(f"{study.database}; to view it in a browser (pip install optuna-dashboard):")
        print_text(f"  {study.dashboard_command}")
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
) -> None:
    """Write report.html into each RUN: one file for any browser, without a network."""
    from armwright.page.page import write_report

    for run in runs:
        with activity(f"writing the page of {run}"):
            written = write_report(run)
        print_text(str(written))


def live(
    run: RunFolder,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any other than the default opens the page to a network.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0: any free port.")] = 0,
    follow: Annotated[bool, typer.Option("--follow", hidden=True)] = False,
) -> None:
    """Serve the live page of RUN to browsers on this machine until Ctrl-C."""
    from armwright.page.live_server import serve
    from armwright.runs.folder import read_config

    if not follow:
        read_config(run)  # report a folder without a run at once
    serve(run, print_text, host, port, sys.stdin.buffer if follow else None)


def prompt(
    task: Annotated[str | None, typer.Argument(metavar="TASK", help="A built-in task, or a YAML file.")] = None,
    after: Annotated[
        Path | None,
        typer.Option(help="Print the prompt for the next proposal of this run.", show_default="of a new run"),
    ] = None,
    number: Annotated[
        int | None, typer.Option(help="With --after: print the prompt of this trial as it was sent.")
    ] = None,
    space: SpaceFile = None,
    evaluator: EvaluatorName = None,
    prompt: Annotated[
        str | None,
        typer.Option(help="Prompt: plus, minus, full, or a template file.", show_default="the run's, else plus"),
    ] = None,
    memory: Annotated[
        str | None, typer.Option(help="Memory: none, own or chat.", show_default="the run's, else none")
    ] = None,
    model_options: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="answer, proposals and others, in a YAML file or in place, such as '{proposals: 2}'.",
            show_default="the run's",
        ),
    ] = None,
    n_init: Annotated[int | None, typer.Option(help="Random trials of the new run.", show_default="10")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the new run.", show_default="0")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the answer's JSON schema instead.")] = False,
    template: Annotated[
        bool, typer.Option("--template", help="Print the template of --prompt instead, as a basis for a custom one.")
    ] = False,
    variables: Annotated[bool, typer.Option("--variables", help="Print the variables of templates instead.")] = False,
) -> None:
    """Print exactly what would be sent to a model for TASK, or what a custom prompt needs."""
    from armwright.llm.configuration import load_model_options
    from armwright.llm.prompt import whole_template
    from armwright.llm.prompt_values import VARIABLES
    from armwright.spaces.design_space import load_space
    from armwright.study.prompt_preview import preview, preview_after
    from armwright.tasks.catalogue import load_task

    if variables:
        print_text("\n".join(f"{name}: {description}" for name, description in VARIABLES.items()))
        return
    if template:
        print_text(whole_template(prompt or "plus"), end="")
        return
    options = load_model_options(model_options, prompt=prompt, memory=memory)
    if after is None:
        if task is None:
            raise SettingsError("expected a TASK, --after RUN, --template or --variables")
        if number is not None:
            raise SettingsError(f"--number {number} needs --after RUN")
        n_init = 10 if n_init is None else n_init
        shown = preview(load_problem(task, space, evaluator=evaluator), options, n_init=n_init, seed=seed or 0)
    else:
        for option, value in (("--n-init", n_init), ("--seed", seed), ("--evaluator", evaluator)):
            if value is not None:
                raise SettingsError(f"{option} {value} is for a new run; {after} has its own")
        shown = preview_after(
            after,
            options,
            task=None if task is None else load_task(task),
            space=None if space is None else load_space(space),
            number=number,
        )
    if schema:
        print_json(shown.schema)
        return
    print_text(shown.prompt, end="")
    note = f"; {shown.note}" if shown.note else ""
    print_error(f"about {shown.tokens:,} tokens; for trial {shown.number}{note}")


def doctor(
    model: ModelName = None,
    model_options: ModelOptionsFile = None,
    call: Annotated[bool, typer.Option("--call", help="Make one small call to the configured model.")] = False,
) -> None:
    """Show what is installed and which models are configured.

    Nothing is sent unless --call is given.
    """
    from armwright.cli.doctor import WRONG, examine, try_model
    from armwright.llm.configuration import load_model_options

    console = open_console()
    options = load_model_options(model_options, model=model)
    wrong = False
    for finding in examine(options):
        console.print(f"{finding.mark} {finding.subject}: {finding.message}")
        wrong = wrong or finding.mark == WRONG
    if wrong:
        sys.exit(FailureError.exit_code)
    if call:
        console.print(try_model(options))
