"""Options of commands, and the objects that they describe.

A command is a plain function: parameters before `*` are its arguments, the others its options. Their help stands in its
docstring, in a section for each group of `--help`: `name (METAVAR): text. Default: text.` This module's docstring holds
what several commands share:

Parameters:
    run (RUN): A run folder.
    source (RUN|ARM): A run folder, a URDF file, or a name such as ur5e (robot_descriptions; extra arms).
    task (TASK): A built-in task (see `armwright tasks`), a YAML file, or a run folder.
    base (X,Y,Z[,YAW]): Where base links stand [m], and how far they are turned about the vertical [°].
        Default: searched.
    base_link: Link of the URDF at the base. Default: the root.
    tip: Link of the URDF at the tip. Default: the last one before a gripper.

Task:
    objectives: Objectives to minimise instead of the task's: names with commas, see docs/method.md, 3.
    robust: Count a design by its worst case with the base or a link 1 mm off.
    space: Design space: a built-in one, or a YAML file. Default: the task's own, else the paper's.

Search:
    seed: Seed of everything random.

Language model:
    max_cost: Stop asking the model after so many USD.
    model: Language model, such as openai-chat:gpt-4o.
    model_options (FILE): All other settings of the model (base_url, temperature, in_flight, ...): a YAML file, or a
        mapping in place such as '{temperature: 0}'; see docs/language-models.md.

Evaluation:
    device: Evaluate arms on: auto, cpu or cuda.
    scheduler: Use the Dask cluster at this address (tcp://HOST:PORT); --workers then limits tasks in flight.

Output:
    csv_: Print only CSV to stdout, in SI units.
    figures: Make the page (report.html) and the figures of a finished run.
    json_: Print only JSON to stdout.
"""

import inspect
import math
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin

import typer

from armwright.exceptions import SettingsError

if TYPE_CHECKING:
    from armwright.problem.problem import Problem
    from armwright.robot.mounting import Mounting
    from armwright.study.workers.cluster import Workers

_SECTION = re.compile(r"^([A-Z][\w ]*):\n((?:    .+\n)+)", re.MULTILINE)
_PARAMETER = re.compile(r"^    (\w+)(?: \(([^)\n]+)\))?: (.+(?:\n     .+)*)", re.MULTILINE)


def read_declaration(function: Callable[..., None]) -> tuple[str, inspect.Signature]:
    """Return the help of a command without its parameters, and its signature with these declared for Typer."""
    text, signature = inspect.cleandoc(function.__doc__ or "") + "\n", inspect.signature(function)
    known = {**_read_help(__doc__ or ""), **_read_help(text)}
    parameters = [_declare(one, known.get(one.name, {})) for one in signature.parameters.values()]
    return _SECTION.sub("", text).strip(), signature.replace(parameters=parameters)


def _read_help(text: str) -> dict[str, dict[str, Any]]:
    """Return the settings of Typer's parameters by name."""
    found: dict[str, dict[str, Any]] = {}
    for panel, body in _SECTION.findall(text):
        for name, metavar, description in _PARAMETER.findall(body):
            help_, _, default = " ".join(description.split()).partition(" Default: ")
            found[name] = {
                "help": help_.replace("[", r"\["),  # which is markup
                "metavar": metavar or None,
                "show_default": default.removesuffix(".") or True,
                "rich_help_panel": None if panel == "Parameters" else panel,
            }
    return found


def _declare(parameter: inspect.Parameter, settings: dict[str, Any]) -> inspect.Parameter:
    """Return a parameter with its declaration as Typer has it, unless it has one."""
    if get_origin(parameter.annotation) is Annotated:
        return parameter.replace(kind=parameter.KEYWORD_ONLY)
    name = parameter.name.strip("_").replace("_", "-")
    option = f"--{name}" if len(name) > 1 else f"-{name}"
    names = f"{option}/--no-{name}" if parameter.default is True else option
    is_argument = parameter.kind is parameter.POSITIONAL_OR_KEYWORD
    declaration = typer.Argument(**settings) if is_argument else typer.Option(names, **settings)
    return parameter.replace(annotation=Annotated[parameter.annotation, declaration], kind=parameter.KEYWORD_ONLY)


def load_problem(
    task: str,
    space: Path | None,
    robust: bool = False,
    device: str = "cpu",
    many: bool = False,
    objectives: str | None = None,
    evaluator: str | None = None,
) -> "Problem":
    """Load the task, space and evaluator that options name; many: of many designs, for which "auto" prefers a GPU."""
    from armwright.kinematics.devices import resolve_device
    from armwright.problem.evaluators import load_evaluator
    from armwright.problem.objectives import PAPER_OBJECTIVES, named_objectives
    from armwright.problem.problem import Problem
    from armwright.runs.folder import CONFIG, read_config
    from armwright.spaces.design_space import default_space, load_space
    from armwright.spaces.tolerance import TOLERANCE
    from armwright.tasks.catalogue import load_task

    is_run = os.path.isfile(os.path.join(task, CONFIG))  # unlike Path.is_file, also for a name that is too long
    run = read_config(Path(task)) if is_run else None
    loaded = load_task(task) if run is None else run.task
    measured = None if evaluator is None else load_evaluator(evaluator)
    names = () if objectives is None else tuple(name.strip() for name in objectives.split(","))
    chosen = ()
    if measured is not None:
        chosen = named_objectives(names, measured.objectives) if names else measured.objectives
    elif objectives is not None and names != (loaded.objectives or tuple(o.name for o in PAPER_OBJECTIVES)):
        # the task's reference point applies to its own objectives only
        resolution = tuple(pair for pair in loaded.resolution if pair[0] in names)
        loaded = loaded.model_copy(update={"objectives": names, "reference_point": None, "resolution": resolution})
    default = default_space(loaded.name) if run is None else run.space
    return Problem(
        loaded,
        default if space is None else load_space(space),
        tolerance=TOLERANCE if robust else 0.0,
        device=resolve_device(device, many),
        objectives=chosen,
        evaluator=measured,
    )


def select_workers(n_workers: int | None, scheduler: str | None) -> "Workers | None":
    """Return the workers of --workers and --scheduler; None to evaluate in this process."""
    from armwright.study.workers.cluster import Workers

    return Workers(n_workers or None, scheduler) if n_workers or scheduler else None


def parse_numbers(option: str, text: str, expected: str, *counts: int) -> list[float]:
    """Parse finite numbers with commas, as many as one of the counts."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise SettingsError(f'{option} "{text}": expected {expected}')
    return numbers


def refuse(reason: str, **options: object) -> None:
    """Raise SettingsError if one of these options is given, with the reason after its name and value."""
    for name, value in options.items():
        if value is not None:
            raise SettingsError(f"--{name.replace('_', '-')} {value}{reason}")


def parse_prices(texts: Sequence[str]) -> dict[str, float]:
    """Parse `ur5e=28000`, each of another arm, into prices by name [USD]."""
    prices: dict[str, float] = {}
    for text in texts:
        name, _, price = text.rpartition("=")
        if name in prices:
            raise SettingsError(f"--price: expected one price of {name}, got two")
        try:
            prices[name] = float(price if name else "")
        except ValueError:
            raise SettingsError(f'--price "{text}": expected ARM=USD, such as ur5e=28000') from None
    return prices


def parse_base(text: str | None) -> "Mounting | None":
    """Parse `0.1,0,0.3` or `0.1,0,0.3,90` into a mounting; None for None."""
    from armwright.robot.mounting import Mounting

    if text is None:
        return None
    expected = "three numbers with commas, such as 0,0,0.5 [m], or a fourth, the turn [°]"
    x, y, z, *yaw = parse_numbers("--base", text, expected, 3, 4)
    return Mounting.of((x, y, z, *map(math.radians, yaw)))
