"""Commands before a run: init, edit, check, tasks, actuators, draft."""

import os
import shlex
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from armwright.cli.options import (
    Csv,
    Json,
    MaxCost,
    ModelName,
    ModelOptionsFile,
    Objectives,
    SpaceFile,
    TaskName,
    load_problem,
)
from armwright.cli.signals import INTERRUPTED
from armwright.cli.streams import check_formats, open_console, print_csv, print_json, print_text
from armwright.exceptions import FailureError, TaskError


def init(
    file: Annotated[Path, typer.Argument(help="The task file to write, such as my-task.yaml.")],
    points: Annotated[
        Path | None,
        typer.Option("--from", help="CSV or text file of points, with columns named x, y, z in its header."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of x, y, z: m or mm.", show_default="as in the header, else m")
    ] = None,
    offset: Annotated[tuple[float, float, float], typer.Option(help=r"Offset X Y Z added to every point \[m].")] = (
        0,
        0,
        0,
    ),
) -> None:
    """Write a commented task file to edit."""
    from armwright.files import naming_write_errors
    from armwright.tasks.points_file import read_points
    from armwright.tasks.task import Task
    from armwright.tasks.task_template import task_template
    from armwright.yaml_documents import parse_document

    if file.suffix not in (".yaml", ".yml"):
        raise TaskError(f"{file}: expected a name that ends in .yaml, such as {file.stem}.yaml")
    if os.path.lexists(file):
        raise TaskError(f"{file} already exists; use another name, or delete it first")
    found = None if points is None else read_points(points, unit, offset)
    text = task_template(file) if found is None else task_template(file, found.targets)
    task = parse_document(text, Task, TaskError, str(file))
    with naming_write_errors(file, error=FailureError), file.open("x", encoding="utf-8") as new:
        new.write(text)
    for note in found.notes if found is not None else ():
        print_text(f"note: {points}: {note}")
    print_text(
        f"wrote {file} with {len(task.targets)} targets; edit it, then run: armwright optimize {shlex.quote(str(file))}"
    )


def edit(
    task: Annotated[Path, typer.Argument(metavar="TASK", help="The task file, such as my-task.yaml; it may be new.")],
    space: Annotated[
        Path | None,
        typer.Option(help="The space file.", show_default="TASK's name with -space"),
    ] = None,
    port: Annotated[int, typer.Option(help="Port to listen on; 0: any free port.")] = 0,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Draw TASK and its design space in the browser, check them, and design arms (extra live).

    Ctrl-C ends it, with a search that it has started.
    """
    from armwright.editor.edited_files import EditedFiles
    from armwright.editor.server import serve_editor

    serve_editor(EditedFiles(task, space), print_text, port, open_)


def check(
    task: TaskName,
    space: SpaceFile = None,
    objectives: Objectives = None,
    deep: Annotated[
        bool, typer.Option("--deep", help="Also look for constraints that none of 1,000 random designs satisfies.")
    ] = False,
    picture: Annotated[
        bool, typer.Option("--picture/--no-picture", help="Draw targets, bases, obstacles and the cycle's lines.")
    ] = True,
    out: Annotated[
        Path | None, typer.Option(help="The picture: a PNG, PDF or SVG file.", show_default="NAME-check.png")
    ] = None,
    json_: Json = False,
) -> None:
    """Check TASK and a design space: what they mean, what cannot work, and what was hardly meant."""
    from armwright.cli.check import check_files, run_check
    from armwright.cli.notes import can_draw

    problem = load_problem(task, space, objectives=objectives)
    drawn = (out or Path(f"{problem.task.name}-check.png")) if can_draw(open_console(json_), picture) else None
    run_check(open_console(), problem, check_files(task, space), deep, drawn, json_)


def tasks(
    names: Annotated[list[str] | None, typer.Argument(help="Describe these tasks (built-in, random-N, files).")] = None,
    json_: Json = False,
    csv_: Csv = False,
) -> None:
    """List the built-in tasks, or describe the tasks given."""
    from armwright.cli.show_inputs import show_task, show_tasks, task_rows
    from armwright.experiments.baselines import baselines_of
    from armwright.proof.front_gap import best_known_hypervolume
    from armwright.tasks.catalogue import builtin_tasks, load_task

    check_formats(json_, csv_)
    listed = [load_task(name) for name in names] if names else list(builtin_tasks().values())
    if csv_:
        print_csv(task_rows(listed))
        return
    known = {task.name: best_known_hypervolume(task) for task in listed} if names or json_ else {}
    stored = {name: baselines_of(name) if known[name] is not None else [] for name in known}
    if json_:
        print_json(
            [
                task.model_dump(mode="json")
                | {"best_known_hypervolume": known[task.name], "baselines": [asdict(b) for b in stored[task.name]]}
                for task in listed
            ]
        )
        return
    console = open_console()
    if not names:
        show_tasks(console, listed)
    for task in listed if names else ():
        show_task(console, task, known[task.name], stored[task.name])


def actuators(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="Actuators to list in full.")] = None,
    torque: Annotated[
        str | None, typer.Option(help='Bound of the peak torque, else of the stall torque, such as ">=2" [N m].')
    ] = None,
    speed: Annotated[
        str | None, typer.Option(help=r'Bound of the no-load speed, such as ">5" \[rad/s] or ">50 rpm".')
    ] = None,
    mass: Annotated[str | None, typer.Option(help=r'Bound of the mass, such as "<=0.08" \[kg] or "<=80 g".')] = None,
    price: Annotated[str | None, typer.Option(help='Bound of the price, such as "<=60" [USD].')] = None,
    voltage: Annotated[str | None, typer.Option(help="Voltage, such as 12, or a bound [V].")] = None,
    where: Annotated[
        list[str] | None, typer.Option(help='A condition on any value, such as "backlash<0.005" (may be repeated).')
    ] = None,
    json_: Json = False,
    csv_: Csv = False,
) -> None:
    """List the catalogue of actuators that a space file may name, or the values of some and where they are from."""
    from armwright.cli.actuator_filter import ActuatorFilter
    from armwright.cli.show_inputs import actuator_rows, show_actuator, show_actuators
    from armwright.robot.actuators import catalogue, named_actuator

    check_formats(json_, csv_)
    bounds = {"torque": torque, "speed": speed, "mass": mass, "price": price, "voltage": voltage}
    chosen = ActuatorFilter.of(bounds, where or ())
    known = [named_actuator(name) for name in names] if names else list(catalogue().values())
    records = chosen.apply(known)
    if json_:
        print_json([r.completed().model_dump(exclude_none=True) | {"assumed": r.assumed} for r in records])
        return
    if csv_:
        print_csv(actuator_rows(records))
        return
    console = open_console()
    if not names:
        show_actuators(console, records)
        for name, count in chosen.unknown(known).items():
            console.print(f"left out, as their {name.replace('_', ' ')} is unknown: {count}")
    for record in records if names else ():
        show_actuator(console, record)


def draft(
    description: Annotated[
        list[str], typer.Argument(metavar="DESCRIPTION...", help="The task of the arm, in any language.")
    ],
    model: ModelName = None,
    max_cost: MaxCost = None,
    model_options: ModelOptionsFile = None,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("."),
    force: Annotated[bool, typer.Option("--force", help="Replace files of the same name.")] = False,
    print_prompt: Annotated[
        bool, typer.Option("--print-prompt", help="Print the prompt and the schema that would be sent, and exit.")
    ] = False,
    json_: Json = False,
) -> None:
    """Have a language model draft a task file, and a space file if needed, from DESCRIPTION.

    Nothing is run.
    """
    from armwright.cli.show_inputs import show_draft

    if not print_prompt:
        import_module("armwright.llm.client")  # names the extra `llm`, which brings all that follows
    from armwright.llm.configuration import load_model_options
    from armwright.llm.draft import Drafter, drafting_model
    from armwright.llm.draft_prompt import draft_prompt, draft_schema

    request = " ".join(description)
    if print_prompt:
        print_text(draft_prompt(request))
        print_json(draft_schema())
        return
    console = open_console(json_)
    options = load_model_options(model_options, model=model, max_cost=max_cost)
    drafter = Drafter(drafting_model(options), out, force)
    console.print(drafter.forecast(request))
    try:
        drafted = drafter.draft(request)
    except KeyboardInterrupt:
        console.print("\nstopped; no task was written")
        sys.exit(INTERRUPTED)
    if json_:
        print_json(drafted.record())
        return
    show_draft(console, drafted)
