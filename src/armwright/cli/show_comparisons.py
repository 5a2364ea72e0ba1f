"""Print experiments, comparisons of methods, and existing arms next to designs."""

from collections import Counter
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

from rich.console import Console

from armwright.cli.notes import payload_note
from armwright.cli.streams import list_files
from armwright.cli.tables import Column, print_table
from armwright.existing.compare_arms import ArmComparison, ComparedArm
from armwright.experiments.cells import Cell, CellOutcome
from armwright.experiments.compare_runs import Comparison
from armwright.experiments.tables import markdown, remarks_on, sections
from armwright.extras import install_command, missing_packages
from armwright.llm.servers import describe_server
from armwright.problem.facts import ASKED
from armwright.problem.objective import Objective
from armwright.robot.mounting import Mounting
from armwright.sheet.record import NOT_MODELLED
from armwright.study.workers.cluster import Workers
from armwright.text import rounded


def show_plan(
    console: Console, due: Sequence[Cell], finished: int, skipped: Sequence[Cell], workers: Workers | None
) -> None:
    """Print what an experiment is about to run."""
    where = "one after another" if workers is None else f"on {workers.description}"
    parts = [f"{len(due)} to run {where}" if due else "nothing to run", f"{finished} finished before"]
    console.print(f"{len(due) + finished + len(skipped)} cells: {', '.join(parts)}, {len(skipped)} skipped")
    if len(due) > 1 and missing_packages("distributed"):
        console.print(f"several at a time: {install_command('distributed')}")
    for note in notes_on_cells(skipped, ()):
        console.print(note)
    with_model = [cell for cell in due if cell.plan.needs_a_model and cell.replay is None]
    if with_model:
        proposals = sum(-(-cell.experiment.n_total // cell.plan.n_step) for cell in with_model)
        asked = {
            f"{options.model}{describe_server(options)}" for cell in with_model for options in [cell.plan.model_options]
        }
        models = "; ".join(sorted(asked))
        console.print(f"{len(with_model)} of them ask {models} for about {proposals:,} proposals in total")


def notes_on_cells(skipped: Sequence[Cell], failed: Sequence[CellOutcome]) -> list[str]:
    """Return a line for each method and reason of skipped cells, and one for each failure."""
    reasons = Counter((one.plan.label, one.reason) for one in skipped)
    notes = [
        f"skipped: {label}, {count} {'cell' if count == 1 else 'cells'}: {reason}"
        for (label, reason), count in reasons.items()
    ]
    return notes + [f"FAILED: {outcome.cell.description}: {outcome.fault}" for outcome in failed]


def show_outcome(console: Console, outcome: CellOutcome, number: int, of: int) -> None:
    """Print the outcome of a cell."""
    if outcome.fault:
        console.print(f"[{number}/{of}] FAILED: {outcome.cell.description}: {outcome.fault}")
    else:
        assert outcome.hypervolume is not None
        console.print(
            f"[{number}/{of}] {outcome.cell.description}: "
            f"hypervolume {outcome.hypervolume:.3f}, {outcome.seconds:.1f} s"
        )
    console.file.flush()


def show_comparison(console: Console, comparison: Comparison, title: str, notes: Sequence[str] = ()) -> None:
    """Print a comparison: in a terminal its tables as wide as that, elsewhere Markdown."""
    if not console.is_terminal:
        console.print(markdown(comparison, title, notes), end="")
        return
    console.print(title)
    for section in sections(comparison):
        columns = [Column(head, itemgetter(i), rank=max(0, i - 1)) for i, head in enumerate(section.head)]
        console.print(f"\n{section.title}: {section.caption}")
        print_table(console, columns, section.rows, "--json and table.md have all")
    for note in (*remarks_on(comparison), *notes):
        console.print(f"- {note}")


def show_files(console: Console, tables: Sequence[Path], figures: Sequence[Path]) -> None:
    """Print the paths of tables and figures."""
    console.print(list_files("tables", tables))
    if figures:
        console.print(list_files("figures", figures))


def show_arms(console: Console, comparison: ArmComparison, drawn: Sequence[Path]) -> None:
    """Print existing arms next to designs, with the base of each arm."""
    objectives, space = comparison.problem.objectives, comparison.problem.space
    shown = [*comparison.arms, *comparison.designs]
    names = [objective.name for objective in objectives]
    task = comparison.problem.task
    for arm in comparison.arms:
        console.print(f"{arm.name}: {arm.notes[0]}")
    console.print("; ".join(filter(None, (f"Arms on {task.name}", payload_note(task)))))
    known = [name for name in ASKED if name not in names and any(arm.value(name) is not None for arm in shown)]
    columns = [
        Column("arm", "name", least=12),
        Column("joints", "joints", str, rank=1),
        *(_objective_column(objective, i) for i, objective in enumerate(objectives)),
        *(_fact_column(shown[0].facts[name].label, name, rank) for rank, name in enumerate(known, start=2)),
    ]
    print_table(console, columns, shown)
    if comparison.designs and space.is_toy:
        console.print(f"the designs have toy masses ({space.mass_note}); torques compare only with real ones (`mass:`)")
    console.print(f"payloads and utilisations include a safety factor of {space.safety_factor:g}")
    if comparison.designs:
        console.print(f"masses and prices of designs do not include {NOT_MODELLED}")
    if comparison.places:
        within = " x ".join(f"[{low:g}, {high:g}]" for low, high in (space.origin_x, space.origin_y, space.origin_z))
        console.print(
            f"bases: {comparison.places:,} places tried for each arm in {within} m, by errors, constraints and torque; "
            "--base x,y,z fixes it"
        )
    for arm in comparison.arms:
        note = ""
        if arm.violated:
            note = f"; violates {', '.join(arm.violated)}"
        elif comparison.run is not None:
            note = f"; {_describe_dominance(arm, comparison.front)} ({', '.join(names)})"
        console.print(f"{arm.name}: {Mounting(arm.base, arm.yaw).description}{note}")
        for line in arm.notes[1:]:
            console.print(f"  {line}")
    if drawn:
        console.print(f"redrawn: {', '.join(map(str, drawn))}")


def arm_rows(comparison: ArmComparison) -> Iterator[dict[str, Any]]:
    """Yield arms and designs as rows of CSV, in SI units; unknown values are empty."""
    names = [objective.name for objective in comparison.problem.objectives]
    for arm in (*comparison.arms, *comparison.designs):
        yield {
            "name": arm.name,
            "joints": arm.joints,
            **dict(zip(("base_x", "base_y", "base_z"), arm.base, strict=True)),
            "base_yaw": arm.yaw,
            **{name: fact.value for name, fact in arm.facts.items()},
            **dict(zip(names, arm.values, strict=True)),
            "dominates": arm.dominates,
            "dominated_by": arm.dominated_by,
            "violated": "; ".join(arm.violated),
        }


def _objective_column(objective: Objective, index: int) -> Column:
    head = f"{objective.label.lower()}{objective.unit_in_brackets}"
    return Column(head, lambda arm: arm.values[index], rounded)


def _fact_column(label: str, name: str, rank: int) -> Column:
    return Column(label.lower(), lambda arm: "–" if arm.value(name) is None else arm.facts[name].text, str, rank)


def _describe_dominance(arm: ComparedArm, front: int) -> str:
    if arm.dominates is None:
        return "not comparable with the front"
    designs = f"the {front} designs" if front > 1 else "the one design"
    return f"dominates {arm.dominates} of {designs} of the front, dominated by {arm.dominated_by}"
