"""Commands that show and export what a run holds: pick, export, report, doctor."""

import sys
from pathlib import Path

from armwright.cli.streams import activity, open_console, print_csv, print_json, print_text
from armwright.exceptions import FailureError, SettingsError


def pick(
    run: Path,
    *,
    where: list[str] | None = None,
    by: str | None = None,
    holds: bool = False,
    n: int = 1,
    all_: bool = False,
    json_: bool = False,
    csv_: bool = False,
) -> None:
    """Choose designs of RUN's front by conditions and one quantity; by default, its knee.

    Parameters:
        where: A condition such as "position_error<=0.05" (may be repeated).
        by: The quantity to minimise: torque, mass, link_1, …
        holds: Only designs that hold with a heavier payload, less voltage, and the base or a link 1 mm off.
        n: Number of designs, the best first.
        all_: All designs that meet the conditions, in a table.
    """
    from armwright.cli.show_picked import picked_rows, show_picked, show_picked_table
    from armwright.problem.conditions import read_condition
    from armwright.proof.selection import pick_from, survival_of

    if n < 1:
        raise SettingsError(f"-n {n}: expected a whole number from 1")
    conditions = [read_condition(text) for text in where or ()]
    with activity(f"reading {run}"):
        history, picked, records = pick_from(run, conditions, by, holds)
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
        print_json(list(picked_rows(history, chosen, names, records, survival)))
        return
    show_picked(open_console(), run, history, picked, records, survival, n)


def export(run: Path, *, design: int | None = None, format_: str = "urdf", out: Path | None = None) -> None:
    """Write a design of RUN for a simulator or a workshop.

    Any design of the run can be exported, not only those of the front.

    Parameters:
        design: Number of the design. Default: the knee of the front.
        format_: urdf, ros2_control or mjcf.
        out: Output file. Default: stdout.
    """
    from armwright.proof.export import export_design

    with activity(f"exporting a design of {run}"):
        text = export_design(run, design, format_)
    if out is None:
        print_text(text, end="")
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")


def report(runs: list[Path]) -> None:
    """Write report.html into each RUN: one file for any browser, without a network.

    Parameters:
        runs (RUN...): Run folders.
    """
    from armwright.page.page import write_report

    for run in runs:
        with activity(f"writing the page of {run}"):
            written = write_report(run)
        print_text(str(written))


def doctor(*, model: str | None = None, model_options: str | None = None) -> None:
    """Show what is installed and which models are configured; nothing is sent."""
    from armwright.cli.doctor import WRONG, examine
    from armwright.llm.configuration import load_model_options

    console = open_console()
    options = load_model_options(model_options, model=model)
    marks: set[str] = set()
    for mark, finding in examine(options):
        console.print(f"{mark} {finding}")
        marks.add(mark)
    if WRONG in marks:
        sys.exit(FailureError.exit_code)
