"""Commands that search designs: design, optimize."""

import os
import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from armwright.cli.options import load_problem, select_workers
from armwright.cli.signals import interruptible
from armwright.cli.streams import activity, exit_interrupted, open_console, print_error, print_json, print_text

if TYPE_CHECKING:
    from rich.console import Console

    from armwright.problem.problem import Problem


def design(
    task: str,
    *,
    budget: str | None = None,
    evaluations: int | None = None,
    space: Path | None = None,
    objectives: str | None = None,
    from_: Path | None = None,
    robust: bool = False,
    device: str = "auto",
    figures: bool = True,
    stall: bool = True,
    seed: int = 0,
    out: Path | None = None,
    json_: bool = False,
) -> None:
    """Find the whole Pareto front of TASK by direct search in batches.

    The same command with a larger --budget or --evaluations continues the search.

    Parameters:
        budget: Wall-clock time of the command: 60s, 5min, 1h, or a number of seconds. Compiling kernels in a first run
            does not count. Default: 30s; no limit with --evaluations.
        evaluations: Evaluations of the search; with --budget, whichever ends first.
        from_: Use all designs of this run as initial designs.
        stall: Stop early if the hypervolume stalls.
        out: Run folder. Default: runs/TASK-design-seedSEED.

    Output:
        json_: Print only summary.json to stdout.
    """
    started = time.monotonic()
    from armwright.cli.notes import can_draw
    from armwright.cli.progress import search_progress
    from armwright.cli.show_results import show_result
    from armwright.study.front.front_run import find_front
    from armwright.study.front.search_budget import SearchBudget
    from armwright.study.front.time_plan import TimePlan

    console = open_console(json_)
    drawing = can_draw(console, figures)
    plan = TimePlan(SearchBudget.of(budget, evaluations), drawing=drawing, started=started)
    problem = load_problem(task, space, robust, device, many=True, objectives=objectives)
    folder = out or Path("runs") / f"{problem.task.name}-design-seed{seed}"
    _begin(console, problem, space, folder)
    try:
        with interruptible(), search_progress(console) as watch:
            run = find_front(
                problem, budget=plan, seed=seed, initial_designs=from_, stop_at_stall=stall, out=folder, watch=watch
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
    show_result(console, run, drawn)


def optimize(
    task: str,
    *,
    space: Path | None = None,
    objectives: str | None = None,
    evaluator: str | None = None,
    robust: bool = False,
    proposer: str = "auto",
    sampler: str = "auto",
    n_total: int = 200,
    n_init: int = 10,
    n_step: int = 10,
    initial_design: list[Path] | None = None,
    screen: bool = True,
    seed: int = 0,
    model: str | None = None,
    prompt: str | None = None,
    memory: str | None = None,
    max_cost: float | None = None,
    model_options: str | None = None,
    print_prompt: bool = False,
    device: str = "auto",
    workers: int = 0,
    scheduler: str | None = None,
    evaluation_timeout: float | None = None,
    allow_failures: bool = False,
    out: Path | None = None,
    figures: bool = True,
    json_: bool = False,
) -> None:
    """Search designs for TASK by black-box trials and proposals.

    The same command resumes or shows the run; a larger --n-total extends it.

    Task:
        evaluator: A custom Python function that evaluates arms, FILE.py:FUNCTION or MODULE:FUNCTION; its code is run.

    Search:
        proposer: Proposer of every n-step-th design: auto (a configured model, else rules), none, rules, llm,
            replay:RUN (a recorded run), manual:DIR (a person, by files).
        sampler: Black-box sampler: auto (surrogate with an evaluator, else tpe), surrogate, tpe, tpe-multivariate,
            nsga2, gp (needs the extra gp) or random.
        n_total: Counted trials.
        n_init: Random trials before the counted ones.
        n_step: Trials in a block; the first is the proposer's.
        initial_design: An initial design, such as designs/0042/design.json of a run (may be repeated).
        screen: Skip proposals of which the sampler surrogate expects little.

    Language model:
        prompt: Prompt: plus (with analysis instructions), minus, or full (whole front, mechanics). Default: plus.
        memory: What the model remembers of a run: none (every question is new) or chat (the whole conversation).
            Default: none.
        print_prompt: Print the first prompt that a model would be sent, and exit.

    Evaluation:
        workers: Local processes that evaluate designs; 0: this process (extra distributed).
        evaluation_timeout: End an evaluation by --evaluator after so many seconds; its design is infeasible then.
            Default: no limit.
        allow_failures: Go on if the first five evaluations by --evaluator all fail with the same exception.

    Output:
        out: Run folder. Default: runs/TASK-seedSEED.
        json_: Print only summary.json to stdout.
    """
    from armwright.cli.notes import can_draw, design_note
    from armwright.cli.progress import study_progress
    from armwright.cli.show_results import show_result
    from armwright.llm.configuration import load_model_options
    from armwright.proposers.factory import choose_proposer
    from armwright.spaces.design_file import read_design

    console = open_console(json_)
    given = load_model_options(model_options, model=model, prompt=prompt, memory=memory, max_cost=max_cost)
    problem = load_problem(task, space, robust, device, objectives=objectives, evaluator=evaluator)
    if print_prompt:
        from armwright.llm.prompt import estimated_tokens
        from armwright.study.prompt_preview import first_prompt

        text = first_prompt(problem, given, n_init, n_total, seed)
        print_text(text, end="")
        print_error(f"about {estimated_tokens(text):,} tokens; for trial {n_init}")
        return
    initial_designs = [read_design(file, problem.space) for file in initial_design or ()]
    choice = choose_proposer(proposer, given)
    from armwright.study.study import optimize as run_study  # the extra `llm`, if it is missing, was named

    drawing = can_draw(console, figures)
    folder = out or Path("runs") / f"{problem.task.name}-seed{seed}"
    console.print(choice.reason)
    is_method_chosen = proposer != "auto" or model is not None or sampler != "auto"
    if not is_method_chosen and not folder.exists() and (note := design_note(problem, task, space)):
        console.print(note, soft_wrap=True)  # it holds a command
    _begin(console, problem, space, folder)
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
    except KeyboardInterrupt:
        exit_interrupted(console, f"every finished trial is in {folder}/" if folder.exists() else "nothing was started")
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


def _begin(console: "Console", problem: "Problem", space: Path | None, folder: Path) -> None:
    """Print the task's own space and warnings; stop if no design can serve the task."""
    from armwright.cli.check import check_before_search
    from armwright.cli.notes import space_note
    from armwright.cli.progress import announce_compilation

    announce_compilation(console)
    if space is None and (note := space_note(problem)):
        console.print(note)
    check_before_search(console, problem, folder)


def _draw(folder: Path, drawing: bool) -> list[Path]:
    """Return the figures of a finished run; make the page, and if `drawing` the figures, if they are missing."""
    from armwright.llm.redaction import redacted
    from armwright.page.page import write_report
    from armwright.proof.results import COMMAND, FIGURES, REPORT
    from armwright.runs.folder import RunFolder

    with activity("drawing the page and the figures"), RunFolder(folder) as run:
        existing = sorted((folder / FIGURES).glob("*.png"))
        if not (folder / REPORT).is_file():
            given = [os.fsencode(word).decode(errors="replace") for word in sys.argv[1:]]  # whatever the locale is
            words = [Path(word).name if Path(word).is_absolute() else word for word in given]  # pages are shared
            run.write_text(COMMAND, redacted(shlex.join(["armwright", *words])) + "\n")
            write_report(folder)
        if existing or not drawing:
            return existing
        from armwright.pictures.figures import write_figures

        return write_figures(folder)
