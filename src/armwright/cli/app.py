"""The command line: parses, calls, prints. Heavy imports wait until a command needs them."""

import os
import shlex
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import asdict
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from armwright.exceptions import (
    AnswerPendingError,
    ArmwrightError,
    FailureError,
    SettingsError,
    StoppedError,
    TaskError,
)

if TYPE_CHECKING:
    from armwright.problem.problem import Problem
    from armwright.study.cluster import Workers

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Which robot arm should I build for this task? Searches base position, joint types and link lengths "
    "for small position error and small joint torque, and returns the Pareto set with a URDF for each arm.",
)
INTERRUPTED = 130  # the shell's word for Ctrl-C


def main() -> NoReturn:
    """The entry point: what we raise on purpose becomes one line and an exit code."""
    _open_what_is_closed()
    for number in _ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as a shell sets it for what runs in its background
            signal.signal(number, _end)
    sys.unraisablehook = _heed
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without "³" still shows the rest
    try:
        app()
    except ArmwrightError as error:
        for note in getattr(error, "__notes__", ()):  # the traceback of an evaluator's code
            print(note, file=sys.stderr)
        print(f"armwright: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except OSError as fault:
        with suppress(OSError):  # stderr may be gone as well
            print(f"armwright: {_words(fault)}", file=sys.stderr, flush=True)
        for number in (1, 2):  # what they still hold cannot be written either
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    sys.exit(0)


def _words(fault: OSError) -> str:
    if isinstance(fault, BrokenPipeError):
        return "nobody reads the output any more; the same command goes on with a run"
    return f"{fault.strerror or fault}: {fault.filename or 'the output'}"


def _open_what_is_closed() -> None:
    """So that no file of a run takes the number of stdout or stderr, where others write what they have to say."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free


_ENDING = (signal.SIGINT, signal.SIGTERM)


def _end(*_: object) -> None:
    """Ctrl-C, or SIGTERM, ends a command in order; a second one ends it at once, as kill -9 may at any moment."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt


def _heed(unraisable: "sys.UnraisableHookArgs") -> None:
    """A wish to end that fell into a moment when Python drops what is raised (a finaliser, a callback) comes again."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    for number in _ENDING:
        signal.signal(number, _end)
    again = threading.Timer(0.01, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
    again.daemon = True
    again.start()


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(version("armwright"))
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Options of armwright itself."""


# Groups of options, as `--help` shows them.
TASK, SEARCH, MODEL = "Task", "Search", "Language model"
EVALUATION, OUTPUT = "Evaluation", "Output"

# Options that several commands share.
TaskName = Annotated[str, typer.Argument(help="A built-in task (see `armwright tasks`) or a YAML file.")]
SpaceFile = Annotated[
    Path | None, typer.Option(help="Design space as a YAML file; without it, the paper's.", rich_help_panel=TASK)
]
Objectives = Annotated[
    str | None,
    typer.Option(
        help="Objectives to minimise instead of the task's: names with commas, see docs/method.md, 3.",
        rich_help_panel=TASK,
    ),
]
EvaluatorName = Annotated[
    str | None,
    typer.Option(
        help="A custom Python function that evaluates arms, FILE.py:FUNCTION or MODULE:FUNCTION; its code is run.",
        rich_help_panel=TASK,
    ),
]
Robust = Annotated[
    bool,
    typer.Option(
        "--robust", help="Count a design by its worst case with the base or a link 1 mm off.", rich_help_panel=TASK
    ),
]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", rich_help_panel=SEARCH)]
ModelName = Annotated[
    str | None, typer.Option(help="Language model, such as openai-chat:gpt-4o.", rich_help_panel=MODEL)
]
PromptName = Annotated[
    str | None,
    typer.Option(
        help="Prompt: plus (with analysis instructions), minus, or a template file.",
        show_default="plus",
        rich_help_panel=MODEL,
    ),
]
MaxCost = Annotated[float | None, typer.Option(help="Stop asking the model after so many USD.", rich_help_panel=MODEL)]
ModelOptionsFile = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="All other settings of the model (base_url, temperature, in_flight, ...): a YAML file, or a mapping in "
        "place such as '{temperature: 0}'; see docs/language-models.md.",
        rich_help_panel=MODEL,
    ),
]
DeviceName = Annotated[str, typer.Option(help="Evaluate arms on: auto, cpu or cuda.", rich_help_panel=EVALUATION)]
Figures = Annotated[
    bool,
    typer.Option(
        "--figures/--no-figures",
        help="Make the page (report.html) and the figures of a finished run.",
        rich_help_panel=OUTPUT,
    ),
]
SummaryJson = Annotated[bool, typer.Option("--json", help="Print only summary.json to stdout.", rich_help_panel=OUTPUT)]
Json = Annotated[bool, typer.Option("--json", help="Print as JSON.", rich_help_panel=OUTPUT)]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Use the Dask cluster at this address (tcp://HOST:PORT); --workers then limits tasks in flight.",
        rich_help_panel=EVALUATION,
    ),
]


@app.command()
def optimize(
    task: TaskName,
    space: SpaceFile = None,
    objectives: Objectives = None,
    evaluator: EvaluatorName = None,
    robust: Robust = False,
    proposer: Annotated[
        str,
        typer.Option(
            help="Who proposes every n-step-th design: auto (a configured model, else rules), none, rules, llm, "
            "replay:RUN (a recorded run again), manual:DIR (you, by files).",
            rich_help_panel=SEARCH,
        ),
    ] = "auto",
    sampler: Annotated[
        str,
        typer.Option(
            help="Black-box sampler: tpe, tpe-multivariate, nsga2, gp (needs the extra gp) or random.",
            rich_help_panel=SEARCH,
        ),
    ] = "tpe",
    n_total: Annotated[int, typer.Option(help="Counted trials.", rich_help_panel=SEARCH)] = 200,
    n_init: Annotated[int, typer.Option(help="Random trials before the counted ones.", rich_help_panel=SEARCH)] = 10,
    n_step: Annotated[
        int, typer.Option(help="Trials in a block; the first is the proposer's.", rich_help_panel=SEARCH)
    ] = 10,
    initial_design: Annotated[
        list[Path] | None,
        typer.Option(
            help="An initial design, such as designs/0042/design.json of a run (may be repeated).",
            rich_help_panel=SEARCH,
        ),
    ] = None,
    refine_every: Annotated[
        int | None,
        typer.Option(
            help="After so many counted trials, one refines a design of the front by 1000 evaluations.",
            rich_help_panel=SEARCH,
        ),
    ] = None,
    seed: Seed = 0,
    model: ModelName = None,
    prompt: PromptName = None,
    max_cost: MaxCost = None,
    model_options: ModelOptionsFile = None,
    device: DeviceName = "auto",
    workers: Annotated[
        int,
        typer.Option(
            help="Local processes that evaluate designs; 0: this process (extra distributed).",
            rich_help_panel=EVALUATION,
        ),
    ] = 0,
    scheduler: Scheduler = None,
    out: Annotated[
        Path | None, typer.Option(help="Run folder; without it, runs/TASK-seedSEED.", rich_help_panel=OUTPUT)
    ] = None,
    figures: Figures = True,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Serve the page of the run on 127.0.0.1 while it runs (extra live).", rich_help_panel=OUTPUT
        ),
    ] = False,
    json_: SummaryJson = False,
) -> None:
    """Search designs for TASK. The same command again resumes or shows the run; a larger --n-total extends it."""
    from armwright.cli import console as view
    from armwright.llm.configuration import load_model_options
    from armwright.proposers.factory import choose_proposer
    from armwright.spaces.design_file import read_design
    from armwright.study.study import optimize as run_study

    words = view.stderr_console() if json_ else view.stdout_console()
    problem = _problem(task, space, robust, device, objectives=objectives, evaluator=evaluator)
    initial_designs = [read_design(file, problem.space) for file in initial_design or ()]
    choice = choose_proposer(proposer, load_model_options(model_options, model=model, prompt=prompt, max_cost=max_cost))
    folder = out or Path("runs") / f"{problem.task.name}-seed{seed}"
    words.print(choice.reason)
    if live:
        from armwright.report.live_server import begin_server

        words.print(f"live: {begin_server(folder)}")
    try:
        with view.watching(words) as watch:
            run = run_study(
                problem,
                proposer=choice.proposer or "none",
                sampler=sampler,
                n_init=n_init,
                n_step=n_step,
                n_total=n_total,
                in_flight=choice.options.in_flight,
                refine_every=refine_every,
                initial_designs=initial_designs,
                on_model_failure=choice.options.on_failure,
                workers=_workers(workers, scheduler),
                seed=seed,
                out=folder,
                watch=watch,
            )
        finished_before = run.resumed == len(run.trials)
        if figures and not finished_before:
            words.print("drawing the page and the figures")
        drawn = _figures(folder) if figures else []
    except (KeyboardInterrupt, StoppedError):
        kept = f"every finished trial is in {folder}/" if folder.exists() else "nothing was begun"
        words.print(f"\nstopped; {kept}. Go on with:\n  {_same_command()}")
        sys.exit(INTERRUPTED)
    except AnswerPendingError as pending:
        if pending.refusal:
            words.print(f"the answer was refused: {pending.refusal}")
        words.print(
            f"{pending.question} waits for your answer in {pending.answer}; then go on with:\n  {_same_command()}"
        )
        if json_:
            where = {"folder": str(folder), "question": str(pending.question), "answer": str(pending.answer)}
            _print_json({**where, "refusal": pending.refusal})
        return
    if json_:
        _print_json({"folder": str(folder), **run.summary})
        return
    if finished_before:
        words.print(f"{folder}/ is finished; nothing was computed again. A larger --n-total extends it.")
    elif run.resumed:
        words.print(f"resumed at trial {run.resumed} of {len(run.trials)}")
    view.show_result(words, run, drawn)


@app.command(name="prompt")
def prompt_(
    task: Annotated[str | None, typer.Argument(help="A built-in task, or a YAML file.")] = None,
    after: Annotated[
        Path | None,
        typer.Option(help="The prompt for the next proposal of this run, asked as it asks; without it, of a new run."),
    ] = None,
    number: Annotated[
        int | None, typer.Option(help="With --after: the prompt for this trial of the run, as it was then.")
    ] = None,
    space: SpaceFile = None,
    prompt: Annotated[
        str | None, typer.Option(help="Prompt: plus, minus, or a template file.", show_default="the run's, else plus")
    ] = None,
    model_options: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="memory, answer and proposals, in a YAML file or in place, such as '{memory: own}'.",
            show_default="the run's",
        ),
    ] = None,
    n_init: Annotated[int | None, typer.Option(help="Random trials of the new run.", show_default="10")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the new run.", show_default="0")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the answer's JSON schema instead.")] = False,
    template: Annotated[
        bool, typer.Option("--template", help="Print the template of --prompt instead, to make your own from.")
    ] = False,
    variables: Annotated[bool, typer.Option("--variables", help="Print what a template may use instead.")] = False,
) -> None:
    """Print exactly what would be sent to a model for TASK, or how to write a prompt of your own."""
    from armwright.llm.configuration import load_model_options
    from armwright.llm.prompt import whole_template
    from armwright.llm.prompt_values import VARIABLES
    from armwright.spaces.design_space import load_space
    from armwright.study.prompt_preview import preview, preview_after
    from armwright.tasks.catalogue import load_task

    if variables:
        print("\n".join(f"{name}: {words}" for name, words in VARIABLES.items()))
        return
    if template:
        print(whole_template(prompt or "plus"), end="")
        return
    options = load_model_options(model_options, prompt=prompt)
    if after is None:
        if task is None:
            raise SettingsError("armwright prompt needs a TASK (or --after RUN, --template, or --variables)")
        if number is not None:
            raise SettingsError(f"--number {number} goes with --after RUN")
        n_init = 10 if n_init is None else n_init
        shown = preview(_problem(task, space), options, n_init=n_init, seed=seed or 0)
    else:
        for option, value in (("--n-init", n_init), ("--seed", seed)):
            if value is not None:
                raise SettingsError(f"{option} {value} goes with a new run; {after} has its own")
        shown = preview_after(
            after,
            options,
            task=None if task is None else load_task(task),
            space=None if space is None else load_space(space),
            number=number,
        )
    if schema:
        _print_json(shown.schema)
        return
    print(shown.prompt, end="")
    note = f"; {shown.note}" if shown.note else ""
    print(f"about {shown.tokens:,} tokens; for trial {shown.number}{note}", file=sys.stderr)


@app.command()
def front(
    task: TaskName,
    budget: Annotated[
        str, typer.Option(help="What the search may spend: a time (5s, 2min, 1h), or evaluations (100000, 1e6).")
    ] = "5s",
    space: SpaceFile = None,
    objectives: Objectives = None,
    from_: Annotated[
        Path | None, typer.Option("--from", help="A run folder, all of whose designs the search begins with.")
    ] = None,
    proposer: Annotated[
        str | None, typer.Option(help="Who gives the first designs: rules, or a configured model (llm).")
    ] = None,
    robust: Robust = False,
    device: DeviceName = "auto",
    figures: Figures = True,
    stall: Annotated[
        bool, typer.Option("--stall/--no-stall", help="End early when the hypervolume hardly grows any more.")
    ] = True,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="Run folder; without it, runs/TASK-front-seedSEED.")] = None,
    json_: SummaryJson = False,
) -> None:
    """Find the whole front of TASK in seconds, by a search over designs in batches. A larger --budget goes on."""
    from armwright.cli import console as view
    from armwright.proposers.factory import choose_proposer
    from armwright.study.front_run import find_front

    if from_ is not None and proposer is not None:
        raise SettingsError("--from and --proposer both give the first designs; choose one")
    words = view.stderr_console() if json_ else view.stdout_console()
    problem = _problem(task, space, robust, device, many=True, objectives=objectives)
    initial_designs = from_
    if proposer is not None:
        choice = choose_proposer(proposer)
        if choice.proposer is None:
            raise SettingsError(f"--proposer {proposer} gives no designs to begin with; leave it out")
        words.print(choice.reason)
        initial_designs = choice.proposer
    folder = out or Path("runs") / f"{problem.task.name}-front-seed{seed}"
    try:
        with view.searching(words) as watch:
            run = find_front(
                problem,
                budget=budget,
                seed=seed,
                initial_designs=initial_designs,
                stop_at_stall=stall,
                out=folder,
                watch=watch,
            )
        drawn = _figures(folder) if figures else []
    except KeyboardInterrupt:
        words.print(f"\nstopped; the search is kept in {folder}/. Go on with:\n  {_same_command()}")
        sys.exit(INTERRUPTED)
    if json_:
        _print_json({"folder": str(folder), **run.summary})
        return
    if run.resumed:
        went_on = run.summary["search"]["evaluations"] > run.resumed
        more = "a larger --budget goes on" if run.summary["search"]["ended_by"] == "budget" else "--no-stall goes on"
        words.print(
            f"went on from {run.resumed:,} evaluations" if went_on else f"finished before; nothing was computed: {more}"
        )
    view.show_search(words, run, drawn)


@app.command()
def experiment(
    name: Annotated[str, typer.Argument(help="A built-in experiment (paper, rules, suite), or a YAML file.")],
    seeds: Annotated[int | None, typer.Option(help="So many seeds, from 0 on, instead of the file's.")] = None,
    method: Annotated[list[str] | None, typer.Option(help="Only this method of the file (may be repeated).")] = None,
    task: Annotated[list[str] | None, typer.Option(help="Only this task of the file (may be repeated).")] = None,
    model: ModelName = None,
    model_options: ModelOptionsFile = None,
    replay: Annotated[
        Path | None, typer.Option(help="Folder of an earlier experiment, whose recorded calls stand for the model.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Local processes that run the cells; 0: this process.",
            show_default="one per core with the extra distributed, else 0",
        ),
    ] = None,
    scheduler: Scheduler = None,
    print_commands: Annotated[
        bool, typer.Option("--print-commands", help="Print one command for each cell that is to be run, and end.")
    ] = False,
    print_: Annotated[bool, typer.Option("--print", help="Print the file of a built-in experiment, and end.")] = False,
    figures: Figures = True,
    out: Annotated[Path | None, typer.Option(help="Folder; without it, experiments/NAME.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print a summary as JSON alone to stdout.")] = False,
) -> None:
    """Run methods on tasks with seeds, and compare them. The same command again goes on; finished runs stay."""
    from armwright.cli import console as view
    from armwright.experiments import outcome, plan
    from armwright.experiments import runner as running
    from armwright.experiments.cells import plan_cells
    from armwright.llm.configuration import load_model_options
    from armwright.report.experiment import write_experiment_figures, write_experiment_tables

    if print_:
        print(plan.builtin_text(name), end="")
        return
    words = view.stderr_console() if json_ or print_commands else view.stdout_console()
    whole, beside = plan.load_experiment(name)
    chosen = plan.with_model(
        plan.with_seeds(plan.with_only(whole, method or (), task or ()), seeds),
        load_model_options(model_options, model=model),
    )
    out = out or Path("experiments") / chosen.name
    cells, skipped = plan_cells(chosen, beside, out, replay)
    before = [done for cell in cells if (done := running.finished_before(cell)) is not None]
    finished = {done.cell for done in before}
    due = [cell for cell in cells if cell not in finished]
    default = workers is None and scheduler is None
    placed = running.default_workers(len(due)) if default else _workers(workers, scheduler)
    view.show_plan(words, due, len(before), skipped, placed)
    if print_commands:
        print("\n".join(cell.command for cell in due))
        return
    failed: list[running.CellOutcome] = []
    try:
        outcome.write_plan(chosen, out)
        ended = running.run_cells(due, placed, words.print)
        for number, done in enumerate(ended, start=1):
            view.show_outcome(words, done, number, len(due))
            failed += [done] if done.fault else []
        found = outcome.collect(chosen, cells)
        tables = write_experiment_tables(out, chosen, found, view.notes_on_cells(skipped, failed))
        if figures:
            words.print("drawing the figures")
        drawn = write_experiment_figures(out, chosen, found) if figures else []
    except KeyboardInterrupt:
        words.print(f"\nstopped; every finished trial is in {out}/. Go on with:\n  {_same_command()}")
        sys.exit(INTERRUPTED)
    if json_:
        record = {"folder": str(out), "cells": len(cells), "skipped": len(skipped), "failed": len(failed)}
        _print_json({**record, "tables": [str(path) for path in tables], "figures": [str(path) for path in drawn]})
    else:
        view.show_comparison(words, tables, drawn)
    if failed:
        sys.exit(FailureError.exit_code)


@app.command()
def compare(
    places: Annotated[list[Path], typer.Argument(help="Run folders, or folders with such below.")],
    baseline: Annotated[
        str | None, typer.Option(help="The method that the others are compared with.", show_default="of the first run")
    ] = None,
    figures: Figures = True,
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables and figures; without it, none are written.")
    ] = None,
) -> None:
    """Compare finished runs by method, task and seed: tables, intervals, tests."""
    from armwright.cli import console as view
    from armwright.experiments.compare_runs import compare_summaries
    from armwright.experiments.run_list import read_finished_runs
    from armwright.report.tables import markdown, write_tables

    words = view.stdout_console()
    finished, unfinished = read_finished_runs(places)
    notes = [f"{folder} is not finished, and left out" for folder in unfinished]
    comparison = compare_summaries(finished, baseline)
    title = "Runs compared"
    words.print(markdown(comparison, title, notes=notes), end="")
    if out is not None:
        tables = write_tables(out, comparison, title, notes=notes)
        drawn: list[Path] = []
        if figures:
            from armwright.report.comparison_figures import write_comparison_figures

            drawn = write_comparison_figures(out, comparison)
        view.show_files(words, tables, drawn)


@app.command(name="compare-arms")
def compare_arms_(
    task: TaskName,
    arms: Annotated[
        list[str],
        typer.Argument(
            metavar="ARM...", help="URDF files, or names such as ur5e or panda (robot_descriptions; extra arms)."
        ),
    ],
    run: Annotated[
        Path | None, typer.Option(help="A run of the task: its designs beside the arms, which its figures then show.")
    ] = None,
    base: Annotated[
        str | None, typer.Option(help="Where the base links stand, x,y,z in metres; without it, it is searched.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(help="The link of the URDFs that is to reach the targets.", show_default="the last one"),
    ] = None,
    base_link: Annotated[
        str | None, typer.Option(help="The link of the URDFs that stands at the base.", show_default="the root")
    ] = None,
    space: SpaceFile = None,
    figures: Figures = True,
    seed: Annotated[int, typer.Option(help="Seed of the search for the base.")] = 0,
    json_: Json = False,
) -> None:
    """Buy or build: evaluate arms that exist on TASK, beside the designs of a run."""
    from armwright.cli import console as view
    from armwright.experiments.compare_arms import compare_arms, comparison_record
    from armwright.spaces.design_space import load_space

    compared = compare_arms(
        task,
        arms,
        run,
        space=None if space is None else load_space(space),
        base=None if base is None else _point(base),
        tip=tip,
        base_link=base_link,
        seed=seed,
    )
    drawn: list[Path] = []
    if run is not None and figures:
        from armwright.report.figures import write_figures
        from armwright.report.page import write_report

        drawn = [write_report(run), *(path for path in write_figures(run) if path.stem == "front")]
    if json_:
        _print_json(comparison_record(compared))
    else:
        view.show_arms(view.stdout_console(), compared, drawn)


def _point(words: str) -> tuple[float, float, float]:
    """`0.1,0,0.3` as a point."""
    try:
        x, y, z = (float(part) for part in words.split(","))
    except ValueError:
        raise SettingsError(f'--base "{words}": three numbers with commas are needed, such as 0,0,0.5 [m]') from None
    return x, y, z


@app.command()
def runs(
    places: Annotated[list[Path] | None, typer.Argument(help="Folders to look in.", show_default="runs")] = None,
    json_: Json = False,
) -> None:
    """List the runs that lie in a folder, and how far each has come."""
    from armwright.cli import console as view
    from armwright.experiments.run_list import find_runs, list_runs

    listed = list_runs(find_runs(places or [Path("runs")]))
    if json_:
        _print_json(listed)
    else:
        view.show_runs(view.stdout_console(), listed)


@app.command(name="pick")
def pick_(
    run: Annotated[Path, typer.Argument(help="A run folder.")],
    where: Annotated[
        list[str] | None, typer.Option(help='A condition such as "position_error<=0.05" (may be repeated).')
    ] = None,
    by: Annotated[str | None, typer.Option(help="The number that should be small: torque, mass, link_1, …")] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="Of the objectives, each as a share of its reference point: position_error=2,torque=1."),
    ] = None,
    robust: Annotated[bool, typer.Option("--robust", help="Only designs that hold when built 1 mm off.")] = False,
    most: Annotated[int, typer.Option("-n", help="So many designs, the best first.")] = 1,
    json_: Json = False,
) -> None:
    """Choose a design of RUN's front: by conditions, by one number or weights; else the knee of the front."""
    from armwright.cli import console as view
    from armwright.runs.selection import numbers_of, pick_from, read_condition, read_weights

    if most < 1:
        raise SettingsError(f"-n {most}: a whole number from 1 is needed")
    conditions = [read_condition(words) for words in where or ()]
    weighed = None if weights is None else read_weights(weights)
    history, picked = pick_from(run, conditions, by, weighed, robust)
    if json_:
        _print_json(
            [
                {"number": m.number, "source": m.source, "joints": m.design.joints, **numbers_of(history, m)}
                for m in picked[:most]
            ]
        )
        return
    view.show_picked(view.stdout_console(), run, history, picked, most)


@app.command()
def export(
    run: Annotated[Path, typer.Argument(help="A run folder.")],
    design: Annotated[int | None, typer.Option(help="Its number; without it, the knee of the front.")] = None,
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="urdf, xacro, srdf, ros2_control, sdf, mjcf, sheet (Markdown) or sheet-csv; "
            "optuna: the whole run as a study.",
        ),
    ] = "urdf",
    out: Annotated[
        Path | None, typer.Option(help="File; without it, to stdout; for optuna, study.db in the run folder.")
    ] = None,
) -> None:
    """Write one design of RUN for a simulator or a workshop, or all of RUN for Optuna.

    Any design of the run, not only those of the front.
    """
    from armwright.runs.export import OPTUNA, export_design

    if format_ == OPTUNA:
        from armwright.runs.optuna_export import export_study

        if design is not None:
            raise SettingsError(f"--design {design} goes with the other formats; optuna takes the whole run")
        study = export_study(run, out)
        print(f"{study.database}; show it in a browser (pip install optuna-dashboard):\n  {study.dashboard_command}")
        return
    text = export_design(run, design, format_)
    if out is None:
        print(text, end="")
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")],
) -> None:
    """Write report.html into each RUN: one file that shows it in any browser, without a network."""
    from armwright.report.page import write_report

    for run in runs:
        print(write_report(run))


@app.command()
def live(
    run: Annotated[Path, typer.Argument(help="A run folder, of a run that goes on elsewhere or is over.")],
    host: Annotated[
        str, typer.Option(help="Address to listen on; any other than this one opens it to a network.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0: any that is free.")] = 0,
    follow: Annotated[bool, typer.Option("--follow", hidden=True)] = False,
) -> None:
    """Serve the page of RUN to browsers on this machine, live, until Ctrl-C."""
    from armwright.report.live_server import serve
    from armwright.runs.folder import read_config

    if not follow:
        read_config(run)  # a folder that holds no run is said at once
    serve(run, lambda address: print(address, flush=True), host, port, sys.stdin.buffer if follow else None)


@app.command()
def polish(
    run: Annotated[Path, typer.Argument(help="A finished run folder.")],
    evaluations: Annotated[int, typer.Option(help="Evaluations for each design of the front.")] = 1000,
    json_: SummaryJson = False,
) -> None:
    """Tune the lengths and the base of RUN's Pareto designs, and add what became better to the run."""
    from armwright.cli import console as view
    from armwright.study.refine_run import refine_run

    polished = refine_run(run, evaluations)
    _figures(run)
    if json_:
        _print_json({"folder": str(run), **polished.summary})
        return
    view.show_polish(view.stdout_console(), polished)


@app.command()
def verify(
    run: Annotated[Path, typer.Argument(help="A finished run folder.")],
    json_: SummaryJson = False,
) -> None:
    """Compute RUN's Pareto designs again, exactly and a little off, and mark each robust or sensitive."""
    from armwright.cli import console as view
    from armwright.report.page import write_report
    from armwright.runs.results import REPORT, verify_run

    history, summary = verify_run(run)
    if (run / REPORT).is_file():
        write_report(run)
    if json_:
        _print_json({"folder": str(run), **summary})
        return
    view.show_front(view.stdout_console(), history, summary)


@app.command()
def doctor(
    model: ModelName = None,
    model_options: ModelOptionsFile = None,
    call: Annotated[bool, typer.Option("--call", help="Make one tiny call to the configured model.")] = False,
) -> None:
    """Say what is installed and which models are configured; nothing is sent unless --call is given."""
    from armwright.cli import console as view
    from armwright.cli.doctor import WRONG, examine, try_model
    from armwright.llm.configuration import load_model_options

    words = view.stdout_console()
    options = load_model_options(model_options, model=model)
    wrong = False
    for finding in examine(options):
        words.print(f"{finding.mark} {finding.subject}: {finding.words}")
        wrong = wrong or finding.mark == WRONG
    if wrong:
        sys.exit(FailureError.exit_code)
    if call:
        words.print(try_model(options))


@app.command()
def tasks(
    names: Annotated[
        list[str] | None, typer.Argument(help="Tell all of these tasks (built-in, random-N, files).")
    ] = None,
    json_: Json = False,
) -> None:
    """List the built-in tasks; with names, tell their points and where they come from."""
    from armwright.cli import console as view
    from armwright.experiments.baselines import baselines_of
    from armwright.runs.best_known import best_known_hypervolume
    from armwright.tasks.catalogue import builtin_tasks, load_task

    told = [load_task(name) for name in names] if names else list(builtin_tasks().values())
    known = {task.name: best_known_hypervolume(task) for task in told} if names or json_ else {}
    stored = {name: baselines_of(name) if known[name] is not None else [] for name in known}
    if json_:
        _print_json(
            [
                task.model_dump(mode="json")
                | {"best_known_hypervolume": known[task.name], "baselines": [asdict(b) for b in stored[task.name]]}
                for task in told
            ]
        )
        return
    words = view.stdout_console()
    if not names:
        view.show_tasks(words, told)
    for task in told if names else ():
        view.show_task(words, task, known[task.name], stored[task.name])


@app.command()
def actuators(json_: Json = False) -> None:
    """List the actuators of the catalogue, which a space file may name."""
    from armwright.cli import console as view
    from armwright.robot.actuators import catalogue

    records = list(catalogue().values())
    if json_:
        _print_json([record.model_dump(exclude_none=True) for record in records])
    else:
        view.show_actuators(view.stdout_console(), records)


@app.command()
def draft(
    words: Annotated[list[str], typer.Argument(metavar="WORDS...", help="What the arm has to do, in any language.")],
    model: ModelName = None,
    max_cost: MaxCost = None,
    model_options: ModelOptionsFile = None,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("."),
    force: Annotated[bool, typer.Option("--force", help="Replace files of the same name.")] = False,
    print_prompt: Annotated[
        bool, typer.Option("--print-prompt", help="Print exactly what would be sent, and end.")
    ] = False,
    json_: Annotated[bool, typer.Option("--json", help="Print what came of it as JSON alone to stdout.")] = False,
) -> None:
    """Have a language model draft a task file, and a space file where one is needed, from WORDS. Nothing is run."""
    from armwright.cli import console as view
    from armwright.llm.configuration import load_model_options
    from armwright.llm.draft import Drafter, drafting_model
    from armwright.llm.draft_prompt import draft_prompt

    said = " ".join(words)
    if print_prompt:
        print(draft_prompt(said), end="")
        return
    console = view.stderr_console() if json_ else view.stdout_console()
    options = load_model_options(model_options, model=model, max_cost=max_cost)
    drafter = Drafter(drafting_model(options), out, force)
    console.print(drafter.forecast(said))
    try:
        drafted = drafter.draft(said)
    except KeyboardInterrupt:
        console.print("\nstopped; no task was written")
        sys.exit(INTERRUPTED)
    if json_:
        _print_json(drafted.record())
        return
    view.show_draft(console, drafted)


@app.command()
def init(
    file: Annotated[Path, typer.Argument(help="The task file to write, such as my-task.yaml.")],
    points: Annotated[
        Path | None, typer.Option("--from", help="CSV file with x, y, z in its first three columns.")
    ] = None,
    unit: Annotated[str, typer.Option(help="Unit of the CSV file: m or mm.")] = "m",
    offset: Annotated[tuple[float, float, float], typer.Option(help="Added to every point, in metres: X Y Z.")] = (
        0,
        0,
        0,
    ),
) -> None:
    """Write a commented task file to edit."""
    from armwright.tasks.points_file import read_points
    from armwright.tasks.task import Task
    from armwright.tasks.task_template import task_template
    from armwright.yaml_documents import parse_document

    if file.suffix not in (".yaml", ".yml"):
        raise TaskError(f"{file}: a task file ends in .yaml, such as {file.stem}.yaml")
    if os.path.lexists(file):
        raise TaskError(f"{file} exists already; give another name, or delete it first")
    text = task_template(file) if points is None else task_template(file, read_points(points, unit, offset))
    task = parse_document(text, Task, TaskError, str(file))
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as fault:
        raise FailureError(f"cannot write {file}: {fault.strerror or fault}") from fault
    print(
        f"wrote {file} with {len(task.targets)} targets; edit it, then run: armwright optimize {shlex.quote(str(file))}"
    )


def _figures(folder: Path) -> list[Path]:
    """The figures of a finished run, and its page; drawn where they are missing."""
    from armwright.report.figures import write_figures
    from armwright.report.page import write_report
    from armwright.runs.folder import RunFolder
    from armwright.runs.results import FIGURES, REPORT

    with RunFolder(folder):
        there = sorted((folder / FIGURES).glob("*.png"))
        if not (folder / REPORT).is_file():
            write_report(folder)
        return there or write_figures(folder)


def _problem(
    task: str,
    space: Path | None,
    robust: bool = False,
    device: str = "cpu",
    many: bool = False,
    objectives: str | None = None,
    evaluator: str | None = None,
) -> "Problem":
    from armwright.kinematics.devices import resolve_device
    from armwright.problem.evaluators import load_evaluator
    from armwright.problem.objectives import PAPER_OBJECTIVES, named_objectives
    from armwright.problem.problem import Problem
    from armwright.spaces.design_space import load_space, paper_space
    from armwright.spaces.tolerance import TOLERANCE
    from armwright.tasks.catalogue import load_task

    loaded = load_task(task)
    measured = None if evaluator is None else load_evaluator(evaluator)
    names = () if objectives is None else tuple(name.strip() for name in objectives.split(","))
    chosen = ()
    if measured is not None:
        # What the task says of objectives is of others than the evaluator's.
        loaded = loaded.model_copy(update={"objectives": None, "reference_point": None})
        chosen = named_objectives(names, measured.objectives) if names else measured.objectives
    elif objectives is not None and names != (
        loaded.objectives or tuple(o.name for o in PAPER_OBJECTIVES)
    ):  # a reference point is for other ones
        loaded = loaded.model_copy(update={"objectives": names, "reference_point": None})
    return Problem(
        loaded,
        paper_space() if space is None else load_space(space),
        tolerance=TOLERANCE if robust else 0.0,
        device=resolve_device(device, many),
        objectives=chosen,
        evaluator=measured,
    )


def _workers(n_workers: int | None, scheduler: str | None) -> "Workers | None":
    """What --workers and --scheduler stand for; None for this process."""
    from armwright.study.cluster import Workers

    if not n_workers and not scheduler:
        return None
    return Workers(n_workers or None, scheduler)


def _same_command() -> str:
    """The command that was given, for a shell."""
    program, *given = sys.argv
    called = ["python", "-m", "armwright"] if Path(program).name == "__main__.py" else [program]
    return shlex.join([*called, *given])


def _print_json(content: Any) -> None:
    import json

    print(json.dumps(content, indent=2))
