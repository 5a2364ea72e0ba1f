"""Print designs that were picked: each with all that is known of it, or many in a table."""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import to_jsonable_python
from rich.console import Console

from armwright.cli.show_results import format_value, links_of
from armwright.cli.streams import format_point, print_command, print_named
from armwright.cli.tables import Column, print_table
from armwright.problem.arm_quantities import TORQUE_SCALE, torque
from armwright.problem.assumptions import assumed_values, count_assumed
from armwright.problem.facts import describe_supply
from armwright.problem.objective import Objective
from armwright.problem.objectives import QUANTITIES
from armwright.proof.cycle_faults import describe_path
from armwright.proof.design_record import DesignRecord, facts_by_number
from armwright.proof.selection import quantities_of_front
from armwright.runs.history import FrontMember, History, source_label
from armwright.spaces.custom_parameters import describe_custom
from armwright.spaces.parameters import CategoricalParameter

Records = Mapping[int, DesignRecord]


def picked_rows(
    history: History,
    picked: Sequence[FrontMember],
    names: Sequence[str],
    records: Records,
    survival: Mapping[int, Mapping[str, Any]] | None = None,
) -> Iterator[dict[str, Any]]:
    """Yield the chosen designs as rows of CSV: parameters, quantities of the run, and those of these names.

    With the survival by number, for JSON, also the types of the joints, the worst along the cycle, and the survival.
    """
    quantities = quantities_of_front(history, names, facts_by_number(records))
    categorical = [p.name for p in history.problem.space.parameters if isinstance(p, CategoricalParameter)]
    for member in picked:
        number, choices = member.number, {name: member.design.params.get(name) for name in categorical}
        row = {"number": number, "source": member.source, **choices, **quantities[number]}
        if survival is not None:
            path = to_jsonable_python(records[number].path)
            parts = {"joints": member.design.joints, "path": path, "survival": survival.get(number)}
            row |= {name: part for name, part in parts.items() if part is not None}
        yield row


def show_picked_table(
    console: Console, history: History, picked: Sequence[FrontMember], names: Sequence[str], records: Records
) -> None:
    """Print the chosen designs in a table: their objectives, and the quantities of these names."""
    quantities = quantities_of_front(history, names, facts_by_number(records))
    minimised = [objective.name for objective in history.problem.objectives]
    further = [name for name in dict.fromkeys(names) if name not in minimised]
    units = {one.name: one.unit_in_brackets for one in (*QUANTITIES.values(), *history.problem.objectives)}

    def quantity(name: str, write: Callable[[float], str]) -> Column:
        head = f"{name.replace('_', ' ')}{units[name]}" if name in units else name
        return Column(head, lambda member: quantities[member.number][name], write)

    motors = Column("motors", lambda member: ", ".join(member.design.motors), rank=5, least=12)
    columns = (
        Column("#", "number", str), Column("source", lambda member: source_label(member.source), rank=3),
        *(quantity(name, format_value) for name in minimised), *(quantity(name, "{:.4g}".format) for name in further),
        Column("types", "design.joints", rank=1), Column("links [m]", links_of, rank=4),
        *([motors] if any(member.design.motors for member in picked) else []),
    )  # fmt: skip
    _show_count(console, history, picked)
    print_table(console, columns, picked)


def _show_count(console: Console, history: History, picked: Sequence[FrontMember]) -> None:
    console.print(f"{len(picked)} of the front's {len(history.front)} designs meet the conditions")


def show_picked(
    console: Console,
    run: Path,
    history: History,
    picked: Sequence[FrontMember],
    records: Records,
    survival: Mapping[int, Mapping[str, Any]],
    most: int,
) -> None:
    """Print the chosen designs and the command that exports the first.

    Args:
        console: The console.
        run: The run folder.
        history: Its trials.
        picked: The chosen designs.
        records: Records of the designs by number.
        survival: Records of their survival by number.
        most: Number of designs to print.
    """
    _show_count(console, history, picked)
    for member in picked[:most]:
        values = ", ".join(map(_format_objective, history.problem.objectives, member.values))
        links = ", ".join(f"{length:.3f}" for length in member.design.links)
        print_named(console, f"#{member.number}", f" ({source_label(member.source)}): {values}")
        motors = f", motors {', '.join(member.design.motors)}" if member.design.motors else ""
        tubes = f", tubes {', '.join(member.design.tubes)}" if member.design.tubes else ""
        base = format_point([round(value, 3) for value in member.design.origin])
        console.print(f"  joints {member.design.joints}, links {links} m, base {base} m{motors}{tubes}")
        if custom := describe_custom(history.problem.space.custom, member.design.params):
            console.print(f"  {custom}")
        record = records[member.number]
        if along := describe_path(record.path):
            console.print(f"  worst along its cycle: {along}")
        if supply := describe_supply(record.facts):
            console.print(f"  supply along its cycle: {supply}")
        if assumed := assumed_values(history.problem, [member.arm]):
            console.print(f"  assumed values of actuators: {count_assumed(assumed)} (listed in its design.json)")
        if member.number in survival:
            found = survival[member.number]
            console.print(f"  {found['verdict']}")
            if found["assumed"] is not None:
                console.print(f"  assumed values halved or doubled, at worst {found['assumed']['text']}")
    export = f"armwright export {shlex.quote(str(run))} --design {picked[0].number}"
    print_command(console, f"{export} --format urdf | mjcf | ros2_control")


def _format_objective(objective: Objective, value: float) -> str:
    if objective == torque:  # scaled, as in the paper
        return f"torque {value:.4g} = {TORQUE_SCALE:g} x {value / TORQUE_SCALE:.4g} N m"
    return f"{objective.label.lower()} {value:.4g} {objective.unit}"
