"""Commands that search designs: design, optimize."""

import time
from pathlib import Path
from typing import Annotated

import typer

from armwright.cli.activity import activity
from armwright.cli.options import (
    EVALUATION,
    OUTPUT,
    SEARCH,
    AllowFailures,
    DeviceName,
    EvaluationTimeout,
    EvaluatorName,
    Figures,
    MaxCost,
    MemoryName,
    ModelName,
    ModelOptionsFile,
    Objectives,
    PromptName,
    Robust,
    Scheduler,
    Seed,
    SpaceFile,
    SummaryJson,
    TaskName,
    load_problem,
    select_workers,
)
from armwright.cli.signals import interruptible
from armwright.cli.streams import exit_interrupted, open_console, print_command, print_json, repeat_command
from armwright.exceptions import AnswerPendingError, SettingsError, StoppedError


def design(
    task: TaskName,
    budget: Annotated[
        str | None,
        typer.Option(
            help="Wall-clock time of the command: 60s, 5min, 1h, or a number of seconds. Compiling kernels in a first "
            "run does not count.",
            show_default="30s; no limit with --evaluations",
        ),
    ] = None,
    evaluations: Annotated[
        int | None, typer.Option(help="Evaluations of the search; with --budget, whichever ends first.")
    ] = None,
    space: SpaceFile = None,
    objectives: Objectives = None,
    from_: Annotated[
        Path | None, typer.Option("--from", help="Use all designs of this run as initial designs.")
    ] = None,
    proposer: Annotated[
        str | None, typer.Option(help="Proposer of the initial designs: rules, or a configured model (llm).")
    ] = None,
    robust: Robust = False,
    device: DeviceName = "auto",
    figures: Figures = True,
    stall: Annotated[bool, typer.Option("--stall/--no-stall", help="Stop early if the hypervolume stalls.")] = True,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="Run folder.", show_default="runs/TASK-design-seedSEED")] = None,
    json_: SummaryJson = False,
) -> None:
    """Find the whole Pareto front of TASK by direct search in batches.

    The same command with a larger --budget or --evaluations continues the search.
    """
    started = time.monotonic()
    from armwright.cli.check import check_before_search, check_files
    from armwright.cli.notes import can_draw, space_note
    from armwright.cli.progress import announce_compilation, search_progress
    from armwright.cli.show_results import show_search
    from armwright.extras import naming_extras
    from armwright.proposers.factory import choose_proposer
    from armwright.study.front.front_run import find_front
    from armwright.study.front.search_budget import SearchBudget
    from armwright.study.front.time_plan import TimePlan

    if from_ is not None and proposer is not None:
        raise SettingsError("--from and --proposer both set the initial designs; use one of them")
    console = open_console(json_)
    announce_compilation(console)
    drawing = can_draw(console, figures)
    plan = TimePlan(SearchBudget.of(budget, evaluations), drawing=drawing, started=started)
    problem = load_problem(task, space, robust, device, many=True, objectives=objectives)
    if space is None and (note := space_note(problem)):
        console.print(note)
    with naming_extras(f"--proposer {proposer}"):
        choice = None if proposer is None else choose_proposer(proposer)
    if choice is not None:
        if choice.proposer is None:
            raise SettingsError(f"--proposer {proposer} proposes no initial designs; leave it out")
        console.print(choice.reason)
    folder = out or Path("runs") / f"{problem.task.name}-design-seed{seed}"
    check_before_search(console, problem, check_files(task, space), folder)
    try:
        with interruptible(), search_progress(console) as watch:
            run = find_front(
                problem,
                budget=plan,
                seed=seed,
                initial_designs=from_ if choice is None else choice.proposer,
                stop_at_stall=stall,
                out=folder,
                watch=watch,
            )
        drawn = _draw(folder, drawing) if figures else []
    except KeyboardInterrupt:
        exit_interrupted(console, f"the search is saved in {folder}/")
    if json_:
        print_json({"folder": folder, **run.summary})
        return
    if run.resumed:
        search = run.summary["search"]
        option = "a larger --budget or --evaluations" if search["ended_by"] == "budget" else "--no-stall"
        console.print(
            f"resumed at {run.resumed:,} evaluations"
            if search["evaluations"] > run.resumed
            else f"{folder}/ is finished; nothing was computed again. Use {option} to continue."
        )
    show_search(console, run, drawn)


def optimize(
    task: TaskName,
    space: SpaceFile = None,
    objectives: Objectives = None,
    evaluator: EvaluatorName = None,
    robust: Robust = False,
    proposer: Annotated[
        str,
        typer.Option(
            help="Proposer of every n-step-th design: auto (a configured model, else rules), none, rules, llm, "
            "replay:RUN (a recorded run), manual:DIR (a person, by files).",
            rich_help_panel=SEARCH,
        ),
    ] = "auto",
    sampler: Annotated[
        str,
        typer.Option(
            help="Black-box sampler: auto (surrogate with an evaluator, else tpe), surrogate, tpe, tpe-multivariate, "
            "nsga2, gp (needs the extra gp) or random.",
            rich_help_panel=SEARCH,
        ),
    ] = "auto",
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
    screen: Annotated[
        bool,
        typer.Option(
            "--screen/--no-screen",
            help="Skip proposals of which the sampler surrogate expects little.",
            rich_help_panel=SEARCH,
        ),
    ] = True,
    seed: Seed = 0,
    model: ModelName = None,
    prompt: PromptName = None,
    memory: MemoryName = None,
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
    evaluation_timeout: EvaluationTimeout = None,
    allow_failures: AllowFailures = False,
    out: Annotated[
        Path | None, typer.Option(help="Run folder.", show_default="runs/TASK-seedSEED", rich_help_panel=OUTPUT)
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
    """Search designs for TASK by black-box trials and proposals.

    The same command resumes or shows the run; a larger --n-total extends it.
    """
    from armwright.cli.check import check_before_search, check_files
    from armwright.cli.notes import can_draw, design_note, space_note
    from armwright.cli.progress import announce_compilation, study_progress
    from armwright.cli.show_results import show_result
    from armwright.llm.configuration import load_model_options
    from armwright.proposers.factory import choose_proposer
    from armwright.spaces.design_file import read_design

    console = open_console(json_)
    announce_compilation(console)
    problem = load_problem(task, space, robust, device, objectives=objectives, evaluator=evaluator)
    if space is None and (note := space_note(problem)):
        console.print(note)
    initial_designs = [read_design(file, problem.space) for file in initial_design or ()]
    given = load_model_options(model_options, model=model, prompt=prompt, memory=memory, max_cost=max_cost)
    choice = choose_proposer(proposer, given)
    from armwright.study.study import optimize as run_study  # the extra `llm`, if it is missing, was named

    drawing = can_draw(console, figures)
    folder = out or Path("runs") / f"{problem.task.name}-seed{seed}"
    console.print(choice.reason)
    is_method_chosen = proposer != "auto" or model is not None or sampler != "auto"
    if not is_method_chosen and not folder.exists() and (note := design_note(problem, task, space)):
        console.print(note)
    check_before_search(console, problem, check_files(task, space), folder)
    if live:
        from armwright.page.live_server import start_server

        console.print(f"live: {start_server(folder)}")
    try:
        with interruptible(), study_progress(console) as watch:
            run = run_study(
                problem,
                proposer=choice.proposer or "none",
                sampler=sampler,
                n_init=n_init,
                n_step=n_step,
                n_total=n_total,
                in_flight=choice.options.in_flight,
                initial_designs=initial_designs,
                screen=screen,
                on_model_failure=choice.options.on_failure,
                workers=select_workers(workers, scheduler),
                evaluation_timeout=evaluation_timeout,
                allow_failures=allow_failures,
                seed=seed,
                out=folder,
                watch=watch,
            )
        finished_before = run.resumed == len(run.trials)
        if figures and not finished_before:
            console.print("drawing the page and the figures")
        drawn = _draw(folder, drawing) if figures else []
    except (KeyboardInterrupt, StoppedError):
        exit_interrupted(console, f"every finished trial is in {folder}/" if folder.exists() else "nothing was started")
    except AnswerPendingError as pending:
        if pending.refusal:
            console.print(f"answer rejected: {pending.refusal}")
        console.print(f"{pending.question} waits for your answer in {pending.answer}; then resume with:")
        print_command(console, repeat_command())
        if json_:
            files = {"folder": folder, "question": pending.question, "answer": pending.answer}
            print_json({**files, "refusal": pending.refusal})
        return
    if json_:
        print_json({"folder": folder, **run.summary})
    else:
        if finished_before:
            console.print(f"{folder}/ is finished; nothing was computed again. A larger --n-total extends it.")
        elif run.resumed:
            console.print(f"resumed at trial {run.resumed} of {len(run.trials)}")
        show_result(console, run, drawn)
    if all(trial.failure is not None for trial in run.trials):
        raise typer.Exit(1)


def _draw(folder: Path, drawing: bool) -> list[Path]:
    """Return the figures of a finished run; make the page, and if `drawing` the figures, if they are missing."""
    from armwright.page.page import write_report
    from armwright.proof.results import FIGURES, REPORT
    from armwright.runs.folder import RunFolder

    with activity("drawing the page and the figures"), RunFolder(folder):
        existing = sorted((folder / FIGURES).glob("*.png"))
        if not (folder / REPORT).is_file():
            write_report(folder)
        if existing or not drawing:
            return existing
        from armwright.pictures.figures import write_figures

        return write_figures(folder)
