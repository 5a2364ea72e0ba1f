"""Commands over several runs: experiment, compare, compare-arms."""

import sys
from pathlib import Path

from armwright.cli.options import parse_base, parse_prices, select_workers
from armwright.cli.streams import activity, exit_interrupted, open_console, print_json, print_records, print_text
from armwright.exceptions import FailureError, SettingsError


def experiment(
    name: str,
    *,
    seeds: int | None = None,
    seed: list[int] | None = None,
    method: list[str] | None = None,
    task: list[str] | None = None,
    model: str | None = None,
    model_options: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    print_: bool = False,
    figures: bool = True,
    out: Path | None = None,
    json_: bool = False,
) -> None:
    """Run methods on tasks with several seeds, and compare them.

    The same command resumes; finished runs are kept.

    Parameters:
        name: A built-in experiment (paper, recorded, rules, n-step, samplers, ...), or a YAML file.
        seeds: Number of seeds, from 0, instead of the file's.
        seed: Only this seed (may be repeated).
        method: Only this method of the file (may be repeated).
        task: Only this task of the file (may be repeated).
        workers: Local processes that run the cells; 0: this process. Default: one per core with the extra distributed,
            else 0.
        print_: Print the file of a built-in experiment, and exit.
        out: Folder. Default: experiments/NAME.
    """
    from armwright.cli.notes import can_draw
    from armwright.cli.show_comparisons import notes_on_cells, show_comparison, show_files, show_outcome, show_plan
    from armwright.experiments import plan
    from armwright.experiments import runner as running
    from armwright.experiments.cells import CellOutcome, collect, plan_cells
    from armwright.experiments.tables import write_tables
    from armwright.llm.configuration import load_model_options

    if print_:
        print_text(plan.builtin_text(name), end="")
        return
    console = open_console(json_)
    whole, folder = plan.load_experiment(name)
    chosen = plan.with_model(whole, load_model_options(model_options, model=model))
    if seeds is not None:
        if not 1 <= seeds <= plan.MAX_SEEDS:
            raise SettingsError(f"--seeds: expected a whole number from 1 to {plan.MAX_SEEDS}, got {seeds}")
        chosen = chosen.model_copy(update={"seeds": seeds})
    out = out or Path("experiments") / chosen.name
    cells, skipped = plan_cells(chosen, folder, out, methods=method or (), tasks=task or (), seeds=seed or ())
    due = [cell for cell in cells if not running.is_finished(cell)]
    is_default = workers is None and scheduler is None
    placed = running.default_workers(len(due)) if is_default else select_workers(workers, scheduler)
    show_plan(console, due, len(cells) - len(due), skipped, placed)
    drawing = can_draw(console, figures)
    failed: list[CellOutcome] = []
    try:
        plan.write_plan(chosen, out)
        ended = running.run_cells(due, placed, console.print)
        for number, done in enumerate(ended, start=1):
            show_outcome(console, done, number, len(due))
            failed += [done] if done.fault else []
        found = collect(chosen, cells)
        notes = notes_on_cells(skipped, failed)
        title = f"Experiment {chosen.name}"
        tables = write_tables(out, found, title, notes)
        drawn: list[Path] = []
        if drawing:
            from armwright.pictures.comparison_figures import write_comparison_figures

            console.print("drawing the figures")
            drawn = write_comparison_figures(out, found, *chosen.drawn)
    except KeyboardInterrupt:
        exit_interrupted(console, f"every finished trial is in {out}/")
    if json_:
        counts = {"cells": len(cells), "skipped": len(skipped), "failed": len(failed)}
        print_json({"folder": out, **counts, "tables": tables, "figures": drawn})
    else:
        console.print()
        show_comparison(console, found, title, notes)
        console.print()
        show_files(console, tables, drawn)
    if failed:
        sys.exit(FailureError.exit_code)


def compare(
    folders: list[Path] | None = None,
    *,
    baseline: str | None = None,
    figures: bool = True,
    out: Path | None = None,
    json_: bool = False,
    csv_: bool = False,
) -> None:
    """Compare finished runs by method, task and seed: tables, intervals, tests.

    Parameters:
        folders: Run folders, or folders that contain them. Default: runs.
        baseline: The method that the others are compared with. Default: of the first run.
        out: Folder for tables and figures. Default: none are written.
    """
    from armwright.cli.notes import can_draw
    from armwright.cli.show_comparisons import show_comparison, show_files
    from armwright.experiments.compare_runs import compare_summaries
    from armwright.experiments.run_record import read_finished_runs
    from armwright.experiments.tables import tables, write_tables

    console = open_console(json_ or csv_)
    places = folders or [Path("runs")]
    with activity("comparing the runs"):
        finished, unfinished = read_finished_runs(places)
        comparison = compare_summaries(finished, baseline)
    notes = [f"{folder} is not finished and is left out" for folder in unfinished]
    title = "Comparison of runs"
    found = {table.name: table.records for table in tables(comparison) if table.name}
    if not print_records(json_, csv_, found, found["table"]):
        show_comparison(console, comparison, title, notes)
    if out is not None:
        written = write_tables(out, comparison, title, notes)
        drawn: list[Path] = []
        if can_draw(console, figures):
            from armwright.pictures.comparison_figures import write_comparison_figures

            with activity("drawing the figures"):
                drawn = write_comparison_figures(out, comparison)
        show_files(console, written, drawn)


def compare_arms(
    task: str,
    arms: list[str],
    *,
    run: Path | None = None,
    base: str | None = None,
    tip: str | None = None,
    base_link: str | None = None,
    space: Path | None = None,
    figures: bool = True,
    seed: int = 0,
    price: list[str] | None = None,
    json_: bool = False,
    csv_: bool = False,
) -> None:
    """Evaluate existing arms on TASK, and compare them with the designs of a run.

    Parameters:
        task (TASK): A built-in task (see `armwright tasks`), or a YAML file.
        arms (ARM...): URDF files, or names such as ur5e or panda (robot_descriptions; extra arms).
        run: A run of the task to compare with; its figures then show the arms.
        seed: Seed of the base search.
        price (ARM=USD): Price of an existing arm, such as ur5e=28000 (may be repeated).
    """
    from armwright.cli.notes import can_draw
    from armwright.cli.show_comparisons import arm_rows, show_arms
    from armwright.existing.compare_arms import compare_arms, comparison_record
    from armwright.spaces.design_space import load_space

    with activity(f"evaluating {', '.join(arms)}"):
        compared = compare_arms(
            task,
            arms,
            run,
            space=None if space is None else load_space(space),
            base=parse_base(base),
            tip=tip,
            base_link=base_link,
            seed=seed,
            prices=parse_prices(price or ()),
        )
    drawn: list[Path] = []
    if run is not None and figures:
        from armwright.page.page import write_report

        drawing = can_draw(open_console(json_ or csv_))
        with activity("drawing the page and the figures" if drawing else "writing the page"):
            drawn = [write_report(run)]
            if drawing:
                from armwright.pictures.figures import write_figures

                drawn += [path for path in write_figures(run) if path.stem == "front"]
    if not print_records(json_, csv_, comparison_record(compared), arm_rows(compared)):
        show_arms(open_console(), compared, drawn)
