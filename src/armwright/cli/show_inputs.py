"""Print tasks, actuators and drafts."""

import math
import shlex
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from armwright.arrays import Array
from armwright.cli.streams import format_point, print_command, print_named
from armwright.cli.tables import NO_BREAK, Column, print_table
from armwright.problem.checks.reach import distance_to_bases
from armwright.problem.constraints import implied_constraints
from armwright.problem.problem import Problem
from armwright.proof.front_gap import best_known_hypervolume
from armwright.robot.actuators import UNITS, ActuatorRecord, catalogue_sources
from armwright.robot.motor_body import ActuatorShape
from armwright.tasks.payload import Payload
from armwright.tasks.targets import AXIS, Target, TargetArrays, describe_targets
from armwright.tasks.task import Task as DesignTask
from armwright.text import decimals, rounded

if TYPE_CHECKING:
    from armwright.llm.draft import Draft

MAX_ROWS = 40  # of a table of targets
FOUR = partial(rounded, digits=4)


def task_rows(tasks: Sequence[DesignTask]) -> Iterator[dict[str, Any]]:
    """Yield tasks as rows of tables."""
    for task in tasks:
        best = best_known_hypervolume(task)
        yield {"name": task.name, "targets": len(task.targets), "best_known": best, "description": task.description}


def show_tasks(console: Console, tasks: Sequence[DesignTask]) -> None:
    """Print a table with a line per task."""
    columns = (
        Column("task", "name"), Column("targets", "targets", str), Column("best known", "best_known", decimals),
        Column("", "description", rank=1, least=24),
    )  # fmt: skip
    print_table(console, columns, task_rows(tasks))
    console.print("\nbest known: the hypervolume of the best known front. armwright tasks NAME describes one task;")
    console.print("random-N is one of a seeded family.")


def actuator_rows(records: Sequence[ActuatorRecord]) -> Iterator[dict[str, Any]]:
    """Yield actuators as rows of CSV, with the defaults of their kind and the names of what is assumed."""
    for record in records:
        assumed = {"estimates": " ".join(record.estimates), "assumed": " ".join(record.assumed)}
        yield record.completed().model_dump() | assumed


def show_actuators(console: Console, records: Sequence[ActuatorRecord]) -> None:
    """Print the catalogue."""
    torque = f"N{NO_BREAK}m"
    columns = (
        Column("actuator", "name"), Column("maker", "maker", rank=3, least=8), Column("V", "voltage", FOUR),
        Column("kg", "mass", FOUR), Column(f"stall {torque}", "stall_torque", FOUR, rank=2),
        Column(f"rated {torque}", "rated_torque", FOUR, rank=1), Column(f"peak {torque}", "peak_torque", FOUR),
        Column("rad/s", "speed", FOUR), Column("USD", "price", FOUR),
        Column("source", "source", rank=4, least=24),
    )  # fmt: skip
    print_table(console, columns, records)
    console.print("\narmwright actuators NAME lists the values of one with their sources.")


def show_actuator(console: Console, record: ActuatorRecord) -> None:
    """Print the values of an actuator of the catalogue with their sources."""
    completed, sources = record.completed(), catalogue_sources()[record.name]

    def source_of(name: str) -> str:
        found = sources.get(name)
        stated = "page, or as the note says" if found is None else f"{found.address} ({found.statement})"
        if name not in record.assumed:
            return stated
        return f"assumed: estimate from {stated}" if found else f"assumed: default of a {record.kind}"

    print_named(console, record.name, f": {record.kind} by {record.maker}")
    console.print(f"page: {record.source}", soft_wrap=True)  # an address stays whole
    console.print(f"note: {record.note}")
    columns = (
        Column("", str), Column("value", partial(getattr, completed), FOUR),
        Column("", lambda name: UNITS[name]), Column("source", source_of, rank=1, least=24),
    )  # fmt: skip
    print_table(console, columns, [name for name in UNITS if getattr(completed, name) is not None])
    for volts, torque, speed in record.at_voltages:
        console.print(f"at {volts:g} V: {torque:g} N m at rest, {speed:.4g} rad/s without load")
    if record.body_shape is not None:
        console.print(f"body: {_describe_body(record, record.body_shape)}")


def _describe_body(record: ActuatorRecord, body: ActuatorShape) -> str:
    across = f"{1e3 * body.long:g} mm" if body.shape == "cylinder" else f"{1e3 * body.long:g} x {1e3 * body.short:g} mm"
    assumed = [name for name in ("shape", "shaft_edge") if getattr(record, name) is None]
    note = f"; assumed: {', '.join(assumed)}" if assumed else ""
    return f"a {body.shape}, {1e3 * body.length:g} mm along its shaft, {across} across{note}"


def show_task(
    console: Console, task: DesignTask, best_known: float | None = None, problem: Problem | None = None
) -> None:
    """Print a task, with its best known hypervolume; of a problem, the implied constraints and not the targets."""
    has_drives, has_bodies = (problem.has_drives, problem.space.has_bodies) if problem else (False, False)
    reference = task.reference_point
    print_named(console, task.name, f": {task.description}" if task.description else "")
    if problem is None:
        points = " ".join(format_point(point) for point in task.target_positions.tolist())
        console.print(f"  {len(task.targets)} targets [m]: {points}")
        for line in describe_targets(task.targets):
            console.print(f"  {line}")
    if task.restarts:
        console.print(f"  {task.restarts + 1} initial postures of the inverse kinematics per target")
    for name, value in (
        ("objectives", ", ".join(task.objectives or ())),
        ("constraints", ", ".join(task.constraints)),
        ("tool", task.tool.describe()),
        ("payload", _describe_payload(task)),
        ("evaluated by the worst case, also", task.cases_description),
        *(("obstacle", obstacle.describe()) for obstacle in task.obstacles),
        ("cycle", task.cycle_description),
        ("durations", task.cycle.describe_times() if task.cycle else ""),
        (
            "constraints of the cycle" if task.cycle else "constraints of the solid bodies",
            ", ".join(implied_constraints(task, has_drives, has_bodies)),
        ),
        *(("workspace", region.describe()) for region in task.workspace),
        ("reference point", "found by the search" if reference is None else format_point(reference)),
        ("provenance", task.provenance),
        ("best known hypervolume", "" if best_known is None else f"{best_known:.2f}"),
    ):
        if value:
            console.print(f"  {name}: {value}")


def show_target_table(console: Console, problem: Problem) -> None:
    """Print a table of the targets of a task and their distances from the bases that a space allows."""
    task, arrays, points = problem.task, problem.task.target_arrays, problem.task.target_positions
    distances = distance_to_bases(problem.space, points)

    def column(head: str, values: Array, rank: int = 0) -> Column:
        return Column(head, lambda i: float(values[i]), FOUR, rank)

    columns = (
        Column("target", task.target_names.__getitem__, least=12),
        *(column(f"{axis} [m]", points[:, k]) for k, axis in enumerate("xyz")),
        column("tolerance [mm]", 1e3 * arrays.tolerance), column("payload [kg]", task.payloads, rank=1),
        column(f"nearest{NO_BREAK}base [m]", distances),
        Column("tool direction", lambda i: _tool_direction(arrays, i), rank=2, least=14),
        Column("may touch", partial(_surfaces, task, task.tip_rules.allowed), rank=2, least=10),
    )  # fmt: skip
    console.print(f"{len(points)} targets:")
    print_table(console, columns, range(min(MAX_ROWS, len(points))), "--json prints all")
    if len(points) > MAX_ROWS:
        console.print(f"… and {len(points) - MAX_ROWS} more")


def _tool_direction(arrays: TargetArrays, index: int) -> str:
    """Return the direction of the tool at a target, and the target's weight if it has one."""
    parts: list[str] = []
    if arrays.n_angular[index]:
        axes = (2,) if arrays.n_angular[index] == AXIS else (2, 0)
        parts += [
            f"{'xyz'[k]} along {format_point((arrays.rotation[index, :, k].round(3) + 0.0).tolist())}" for k in axes
        ]
        parts.append(f"within {math.degrees(arrays.angle_tolerance[index]):.3g}°")
    parts += [f"weight {arrays.weight[index]:g}"] * bool(arrays.weight[index] != 1.0)
    return ", ".join(parts) or "any"


def _surfaces(task: DesignTask, allowed: Array, index: int) -> str:
    """Return what tool and payload may touch at a target, if they are bodies; allowed: as of `TipRules`."""
    target = task.targets[index]
    on = "on {}" if isinstance(target, Target) and target.on else "on {} (assumed)"
    depths = zip(task.obstacles, allowed[index], strict=True)
    words = (("into {}" if np.isinf(d) else on).format(one.name or one.kind) for one, d in depths if d >= 0.0)
    return ", ".join(words) * bool(task.tip_solids) or "nothing"


def _describe_payload(task: DesignTask) -> str:
    """Return the payload on one line; empty if there is none."""
    if isinstance(task.payload, Payload):
        return task.payload.describe()
    return ", ".join(f"{kg:g}" for kg in np.atleast_1d(task.payload)) + " kg" if task.payloads.any() else ""


def show_draft(console: Console, draft: "Draft") -> None:
    """Print a drafted task and space, the assumptions and the next commands."""
    show_task(console, draft.task)
    if draft.space is None:
        console.print("design space: the default; no space file is needed")
    else:
        console.print("design space, other values are the defaults:")
        console.print(textwrap.indent(draft.space_yaml, "  "), end="")
    console.print(
        "assumed:" if draft.assumptions else f"{draft.by} lists no assumptions; check the files all the more carefully"
    )
    for line in draft.assumptions:
        console.print(f"  - {line}")
    for line in draft.questions:
        console.print(f"  ? {line}")
    usage = draft.usage
    cost = "cost unknown" if usage.cost_usd is None else f"{usage.cost_usd:.4f} USD"
    console.print(
        f"{draft.by}: {usage.calls} {'call' if usage.calls == 1 else 'calls'}, {usage.input_tokens:,} tokens in, "
        f"{usage.output_tokens:,} out, {cost}, {usage.call_seconds:.1f} s"
    )
    console.print(f"wrote {' and '.join(map(str, draft.files))}: a draft. Check and edit the numbers, then run:")
    print_command(console, f"armwright tasks {shlex.quote(str(draft.files[0]))}")
    print_command(console, draft.command)
