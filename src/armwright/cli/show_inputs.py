"""Print tasks, actuators and drafts."""

import shlex
import textwrap
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from armwright.cli.streams import format_point, plain_table
from armwright.experiments.baselines import Baseline, baselines, baselines_of
from armwright.llm.draft import Draft
from armwright.problem.constraints import cycle_constraints
from armwright.robot.actuators import UNITS, ActuatorRecord, catalogue_sources, value_of
from armwright.tasks.payload import Payload
from armwright.tasks.targets import describe_targets
from armwright.tasks.task import Task as DesignTask


def show_tasks(console: Console, tasks: Sequence[DesignTask]) -> None:
    """Print a table with a line per task."""
    methods = list(dict.fromkeys(baseline.method for baseline in baselines()))
    numbers = ("targets", *methods)
    table = plain_table("task", *numbers, "", right=numbers)
    table.columns[0].no_wrap = True
    for task in tasks:
        shares = {baseline.method: f"{100 * baseline.share:.0f} %" for baseline in baselines_of(task.name)}
        shown = (shares.get(method, "") for method in methods)
        table.add_row(task.name, str(len(task.targets)), *shown, Text(task.description))
    console.print(table)
    console.print(
        f"\n{' and '.join(methods)}: share of the best known hypervolume after 200 counted trials (mean of "
        f"{baselines()[0].runs} runs).\narmwright tasks NAME describes one task; random-N is one of a seeded family."
    )


def show_actuators(console: Console, records: Sequence[ActuatorRecord]) -> None:
    """Print the catalogue; torques and prices that a data sheet lacks are empty."""
    heads = ("V", "g", "stall N m", "rated N m", "peak N m", "rad/s", "USD")
    table = plain_table("actuator", "maker", *heads, "source", right=heads)
    table.columns[0].no_wrap = table.columns[1].no_wrap = True
    table.columns[-1].overflow = "fold"
    for record in records:
        numbers = (record.voltage, 1e3 * record.mass, record.stall_torque, record.rated_torque, record.peak_torque)
        shown = ("" if n is None else f"{n:.4g}" for n in (*numbers, record.speed, record.price))
        table.add_row(record.name, Text(record.maker), *shown, Text(record.source))
    console.print(table)
    n_values = sum(value_of(record.completed(), name) is not None for record in records for name in UNITS)
    n_assumed = sum(len(record.assumed) for record in records)
    console.print(
        f"\n{n_values} values of {len(records)} actuators, {n_assumed} of them assumed: estimates, or defaults of the "
        "kind of actuator.\narmwright actuators NAME lists the values of one with their sources."
    )


def show_actuator(console: Console, record: ActuatorRecord) -> None:
    """Print the values of an actuator of the catalogue with their sources."""
    completed, sources = record.completed(), catalogue_sources()[record.name]
    console.print(Text(record.name, style="bold") + Text(f": {record.kind} by {record.maker}"))
    console.print(Text(f"page: {record.source}\nnote: {record.note}"))
    table = plain_table("", "value", "", "source", right=("value",))
    table.columns[0].no_wrap = table.columns[2].no_wrap = True
    for name, unit in UNITS.items():
        value = value_of(completed, name)
        if value is None:
            continue
        found = sources.get(name)
        shown = "page, or as the note says" if found is None else f"{found.address} ({found.statement})"
        if name in record.assumed:
            shown = f"assumed: estimate from {shown}" if found else f"assumed: default of a {record.kind}"
        table.add_row(name, f"{value:.4g}", unit, Text(shown))
    console.print(table)


def show_task(
    console: Console,
    task: DesignTask,
    best_known: float | None = None,
    stored: Sequence[Baseline] = (),
    has_drives: bool = False,
) -> None:
    """Print a task.

    Args:
        console: The console.
        task: The task.
        best_known: Its best known hypervolume, if any.
        stored: Its baselines.
        has_drives: Whether the torques and speeds of the joints are limited, which a cycle turns into constraints.
    """
    reference = task.reference_point
    console.print(Text(task.name, style="bold") + Text(f": {task.description}"))
    console.print(f"  {len(task.targets)} targets [m]: " + " ".join(format_point(target) for target in task.targets))
    for line in describe_targets(task.target_specs):
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
        ("constraints of the cycle", ", ".join(cycle_constraints(task, has_drives))),
        *(("workspace", region.describe()) for region in task.workspace),
        ("reference point", "chosen from the first random trials" if reference is None else format_point(reference)),
        ("provenance", task.provenance),
        ("best known hypervolume", "" if best_known is None else f"{best_known:.2f}"),
    ):
        if value:
            console.print(f"  {name}: {value}")
    for baseline in stored:
        console.print(
            f"  {baseline.method}, {baseline.runs} runs of 200 counted trials: E_hv {baseline.e_hv:.2f} (σ_hv "
            f"{baseline.sigma_hv:.2f}), final {baseline.final:.2f}, {baseline.share:.1%} of the best known"
        )


def _describe_payload(task: DesignTask) -> str:
    """Return the payload on one line; empty if there is none."""
    if isinstance(task.payload, Payload):
        return task.payload.describe()
    return ", ".join(f"{kg:g}" for kg in np.atleast_1d(task.payload)) + " kg" if task.payloads.any() else ""


def show_draft(console: Console, draft: Draft) -> None:
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
    console.print(f"  armwright tasks {shlex.quote(str(draft.files[0]))}\n  {draft.command}")
