"""Commands before a run: init, edit, check, tasks, actuators, draft."""

import os
import shlex
import sys
from importlib import import_module
from pathlib import Path

from armwright.cli.options import load_problem
from armwright.cli.signals import INTERRUPTED
from armwright.cli.streams import open_console, print_json, print_records, print_text
from armwright.exceptions import FailureError, TaskError


def init(
    file: Path, *, from_: Path | None = None, unit: str | None = None, offset: tuple[float, float, float] = (0, 0, 0)
) -> None:
    """Write a commented task file to edit.

    Parameters:
        file: The task file to write, such as my-task.yaml.
        from_: CSV or text file of points, with columns named x, y, z in its header.
        unit: Unit of x, y, z: m or mm. Default: as in the header, else m.
        offset: Offset X Y Z added to every point [m].
    """
    from armwright.files import naming_write_errors
    from armwright.tasks.points_file import read_points
    from armwright.tasks.task import Task
    from armwright.tasks.task_template import task_template
    from armwright.yaml_documents import parse_document

    if file.suffix not in (".yaml", ".yml"):
        raise TaskError(f"{file}: expected a name that ends in .yaml, such as {file.stem}.yaml")
    if os.path.lexists(file):
        raise TaskError(f"{file} already exists; use another name, or delete it first")
    found = None if from_ is None else read_points(from_, unit, offset)
    text = task_template(file) if found is None else task_template(file, found.targets)
    task = parse_document(text, Task, TaskError, str(file))
    with naming_write_errors(file, error=FailureError), file.open("x", encoding="utf-8") as new:
        new.write(text)
    for note in found.notes if found is not None else ():
        print_text(f"note: {from_}: {note}")
    print_text(
        f"wrote {file} with {len(task.targets)} targets; edit it, then run: armwright optimize {shlex.quote(str(file))}"
    )


def edit(task: Path, *, space: Path | None = None, port: int = 0, open_: bool = False) -> None:
    """Draw TASK and its design space in the browser, check them, and design arms (extra edit).

    Ctrl-C ends it, with a search that it has started.

    Parameters:
        task (TASK): The task file, such as my-task.yaml; it may be new.
        space: The space file. Default: TASK's name with -space.
        port: Port to listen on; 0: any free port.
        open_: Open the page in the browser.
    """
    from armwright.editor.edited_files import EditedFiles
    from armwright.editor.server import serve_editor

    serve_editor(EditedFiles(task, space), print_text, port, open_)


def check(
    task: str,
    *,
    space: Path | None = None,
    objectives: str | None = None,
    deep: bool = False,
    picture: bool = True,
    out: Path | None = None,
    json_: bool = False,
) -> None:
    """Check TASK and a design space: what they mean, what cannot work, and what was hardly meant.

    Parameters:
        deep: Also look for constraints that none of 1,000 random designs satisfies.
        picture: Draw targets, bases, obstacles and the cycle's lines.
        out: The picture: a PNG, PDF or SVG file. Default: NAME-check.png.
    """
    from armwright.cli.check import run_check
    from armwright.cli.notes import can_draw

    problem = load_problem(task, space, objectives=objectives)
    drawn = (out or Path(f"{problem.task.name}-check.png")) if can_draw(open_console(json_), picture) else None
    run_check(open_console(), problem, deep, drawn, json_)


def tasks(names: list[str] | None = None, *, json_: bool = False, csv_: bool = False) -> None:
    """List the built-in tasks, or describe the tasks given.

    Parameters:
        names: Describe these tasks (built-in, random-N, files).
    """
    from armwright.cli.show_inputs import show_task, show_tasks, task_rows
    from armwright.proof.front_gap import best_known_hypervolume
    from armwright.tasks.catalogue import builtin_tasks, load_task

    console = open_console(json_ or csv_)
    listed = [load_task(name) for name in names] if names else list(builtin_tasks().values())
    content = [
        task.model_dump(mode="json") | {"best_known_hypervolume": best_known_hypervolume(task)} for task in listed
    ]
    if print_records(json_, csv_, content, task_rows(listed)):
        return
    if not names:
        show_tasks(console, listed)
    for task in listed if names else ():
        show_task(console, task, best_known_hypervolume(task))


def actuators(names: list[str] | None = None, *, json_: bool = False, csv_: bool = False) -> None:
    """List the catalogue of actuators that a space file may name, or the values of some and where they are from.

    Parameters:
        names ([NAME]...): Actuators to list in full.
    """
    from armwright.cli.show_inputs import actuator_rows, show_actuator, show_actuators
    from armwright.robot.actuators import catalogue, named_actuator

    console = open_console(json_ or csv_)
    records = [named_actuator(name) for name in names] if names else list(catalogue().values())
    content = [record.completed().model_dump(exclude_none=True) | {"assumed": record.assumed} for record in records]
    if print_records(json_, csv_, content, actuator_rows(records)):
        return
    for record in records if names else ():
        show_actuator(console, record)
    if not names:
        show_actuators(console, records)


def draft(
    description: list[str],
    *,
    model: str | None = None,
    max_cost: float | None = None,
    model_options: str | None = None,
    out: Path = Path("."),
    force: bool = False,
    print_prompt: bool = False,
    json_: bool = False,
) -> None:
    """Have a language model draft a task file, and a space file if needed, from DESCRIPTION.

    Nothing is run.

    Parameters:
        description (DESCRIPTION...): The task of the arm, in any language.
        out: Folder for the files.
        force: Replace files of the same name.
        print_prompt: Print the prompt and the schema that would be sent, and exit.
    """
    request = " ".join(description)
    if print_prompt:
        from armwright.llm.draft_prompt import draft_prompt, draft_schema

        print_text(draft_prompt(request))
        print_json(draft_schema())
        return
    import_module("armwright.llm.client")  # names the extra `llm`, which brings all that follows
    from armwright.cli.show_inputs import show_draft
    from armwright.llm.configuration import load_model_options
    from armwright.llm.draft import Drafter, drafting_model

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
