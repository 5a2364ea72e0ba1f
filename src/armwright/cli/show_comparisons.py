"""Print experiments, comparisons of methods, and existing arms next to designs."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from armwright.cli.notes import payload_note
from armwright.cli.streams import list_files
from armwright.cli.tables import Column, Table, numbers, print_table
from armwright.existing.compare_arms import ArmComparison, ComparedArm
from armwright.experiments.cells import Cell, Skipped
from armwright.experiments.compare_runs import Comparison
from armwright.experiments.tables import markdown, remarks_on, sections
from armwright.extras import install_command, missing_packages
from armwright.llm.servers import describe_server
from armwright.problem.objectives import TORQUE_SCALE
from armwright.robot.mounting import Mounting
from armwright.sheet.record import NOT_MODELLED
from armwright.study.workers.cluster import Workers
from armwright.tasks.moments import MAX_MASS
from armwright.text import rounded

if TYPE_CHECKING:
    from armwright.experiments.runner import CellOutcome


def show_plan(
    console: Console, due: Sequence[Cell], finished: int, skipped: Sequence[Skipped], workers: Workers | None
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
        proposals = sum(-(-cell.n_total // cell.plan.n_step) for cell in with_model)
        asked = {
            f"{options.model}{describe_server(options)}" for cell in with_model for options in [cell.plan.model_options]
        }
        models = "; ".join(sorted(asked))
        console.print(f"{len(with_model)} of them ask {models} for about {proposals:,} proposals in total")


def notes_on_cells(skipped: Sequence[Skipped], failed: "Sequence[CellOutcome]") -> list[str]:
    """Return a line for each method and reason of skipped cells, and one for each failure."""
    reasons = Counter((one.cell.plan.label, one.reason) for one in skipped)
    notes = [
        f"skipped: {label}, {count} {'cell' if count == 1 else 'cells'}: {reason}"
        for (label, reason), count in reasons.items()
    ]
    return notes + [f"FAILED: {outcome.cell.description}: {outcome.fault}" for outcome in failed]


def show_outcome(console: Console, outcome: "CellOutcome", number: int, of: int) -> None:
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


def show_comparison(
    console: Console,
    comparison: Comparison,
    title: str,
    notes: Sequence[str] = (),
) -> None:
    """Print a comparison: in a terminal its tables as wide as that, elsewhere Markdown."""
    if not console.is_terminal:
        console.print(markdown(comparison, title, notes), end="")
        return
    console.print(title)
    for section in sections(comparison):
        columns = [Column(head, rank=max(0, i - 1)) for i, head in enumerate(section.head)]
        console.print(f"\n{section.title}: {section.caption}")
        print_table(console, Table(columns, section.rows, "--json and table.md have all"))
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
    others = [o for o in objectives if o.name not in _ARM_COLUMNS and o.name != "mass"]
    title = "; ".join(filter(None, (f"Arms on {comparison.problem.task.name}", payload_note(comparison.problem.task))))
    shown = [*comparison.arms, *comparison.designs]
    measures = [name for name in _ARM_COLUMNS if any(arm.value(name) is not None for arm in shown)]
    minimised = [objective.name for objective in objectives]
    columns = (
        Column("arm", least=12),
        *numbers("joints", rank=1),
        *numbers("reach\nm", "mass\nkg", "payload\nkg"),
        *(Column(_ARM_COLUMNS[name], True, rank=0 if name in minimised else 3) for name in measures),
        *numbers(*(f"{o.label.lower()}\n{o.unit}" for o in others)),
    )
    rows: list[list[str]] = []
    for arm in shown:
        values = dict(zip((objective.name for objective in objectives), arm.values, strict=True))
        known = [*(arm.value(name) for name in measures), *(values[objective.name] for objective in others)]
        reach = f"{arm.value('reach'):.2f}"
        rows.append([arm.name, str(arm.joints), reach, rounded(arm.value("mass")), _payload(arm), *map(rounded, known)])
    print_table(console, Table(columns, rows, "--json and --csv print all", title=title, gap=1))
    console.print(
        f"torque = {TORQUE_SCALE:g} x the sum over the targets of |joint torques|, by each arm's own masses; torque "
        "util. = the largest share of a joint's effort limit at rest, and payload = what is held at the whole reach, "
        f"both with a safety factor of {space.safety_factor:g}"
    )
    if comparison.designs and space.is_toy:
        console.print(f"the designs have toy masses ({space.mass_note}); torques compare only with real ones (`mass:`)")
    _show_prices(console, comparison)
    if comparison.places:
        within = " x ".join(f"[{low:g}, {high:g}]" for low, high in (space.origin_x, space.origin_y, space.origin_z))
        console.print(
            f"bases: {comparison.places:,} places tried for each arm in {within} m, by errors, constraints and torque; "
            "--base x,y,z fixes it"
        )
    names = ", ".join(objective.name for objective in objectives)
    for arm in comparison.arms:
        note = ""
        if arm.violated:
            note = f"; violates {', '.join(arm.violated)}"
        elif comparison.run is not None:
            note = f"; {_describe_dominance(arm, comparison.front)} ({names})"
        console.print(f"{arm.name}: {Mounting(arm.base, arm.yaw).description}{note}")
        for line in arm.notes:
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
            **{name: arm.value(name) for name in ("reach", "mass", "price", "payload_at_full_reach")},
            **dict(zip(("base_x", "base_y", "base_z"), arm.base, strict=True)),
            "base_yaw": arm.yaw,
            **{name: arm.value(name) for name in _ARM_COLUMNS},
            **dict(zip(names, arm.values, strict=True)),
            "dominates": arm.dominates,
            "dominated_by": arm.dominated_by,
            "violated": "; ".join(arm.violated),
        }


def _show_prices(console: Console, comparison: ArmComparison) -> None:
    """Print the known prices, and what neither price nor mass of designs include."""
    priced = [arm for arm in (*comparison.arms, *comparison.designs) if arm.value("price") is not None]
    if priced:
        console.print("prices: " + ", ".join(f"{arm.name} {arm.facts['price'].text}" for arm in priced))
    if comparison.designs:
        console.print(f"masses and prices of designs do not include {NOT_MODELLED}")


_ARM_COLUMNS = {
    "position_error": "error\nm",
    "torque": "torque",
    "worst_error": "worst\nm",
    "unreached_targets": "targets\nunreached",
    "peak_torque": "peak\nN m",
    "torque_utilisation": "torque\nutil.",
    "deflection": "deflection\nm",
    "backlash_error": "backlash\nm",
    "cycle_time": "cycle\ns",
}


def _payload(arm: ComparedArm) -> str:
    held = arm.value("payload_at_full_reach")
    return "any" if held is not None and held >= MAX_MASS else rounded(held)


def _describe_dominance(arm: ComparedArm, front: int) -> str:
    if arm.dominates is None:
        return "not comparable with the front"
    designs = f"the {front} designs" if front > 1 else "the one design"
    return f"dominates {arm.dominates} of {designs} of the front, dominated by {arm.dominated_by}"
