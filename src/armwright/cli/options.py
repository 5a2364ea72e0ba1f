"""Options that several commands share, and the objects that they describe."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from armwright.problem.problem import Problem
    from armwright.study.workers.cluster import Workers

# Groups of options in `--help`
TASK, SEARCH, MODEL = "Task", "Search", "Language model"
EVALUATION, OUTPUT = "Evaluation", "Output"


def option(help: str, *names: str, panel: str | None = None, default: str | None = None, **others: Any) -> Any:
    """Return an option in a group of `--help`; default: in words, if the value itself says too little."""
    return typer.Option(*names, help=help, rich_help_panel=panel, show_default=default or True, **others)


# Options
TaskName = Annotated[
    str, typer.Argument(metavar="TASK", help="A built-in task (see `armwright tasks`), a YAML file, or a run folder.")
]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]
SpaceFile = Annotated[
    Path | None,
    option("Design space: a built-in one, or a YAML file.", panel=TASK, default="the task's own, else the paper's"),
]
Objectives = Annotated[
    str | None,
    option("Objectives to minimise instead of the task's: names with commas, see docs/method.md, 3.", panel=TASK),
]
EvaluatorName = Annotated[
    str | None,
    option(
        "A custom Python function that evaluates arms, FILE.py:FUNCTION or MODULE:FUNCTION; its code is run.",
        panel=TASK,
    ),
]
EvaluationTimeout = Annotated[
    float | None,
    option(
        "End an evaluation by --evaluator after so many seconds; its design is infeasible then.",
        panel=EVALUATION,
        default="no limit",
    ),
]
AllowFailures = Annotated[
    bool,
    option(
        "Go on if the first five evaluations by --evaluator all fail with the same exception.",
        "--allow-failures",
        panel=EVALUATION,
    ),
]
Robust = Annotated[
    bool, option("Count a design by its worst case with the base or a link 1 mm off.", "--robust", panel=TASK)
]
Seed = Annotated[int, option("Seed of everything random.", panel=SEARCH)]
ModelName = Annotated[str | None, option("Language model, such as openai-chat:gpt-4o.", panel=MODEL)]
PromptName = Annotated[
    str | None,
    option(
        "Prompt: plus (with analysis instructions), minus, or full (whole front, mechanics).",
        panel=MODEL,
        default="plus",
    ),
]
MemoryName = Annotated[
    str | None,
    option(
        "What the model remembers of a run: none (every question is new) or chat (the whole conversation).",
        panel=MODEL,
        default="none",
    ),
]
MaxCost = Annotated[float | None, option("Stop asking the model after so many USD.", panel=MODEL)]
ModelOptionsFile = Annotated[
    str | None,
    option(
        "All other settings of the model (base_url, temperature, in_flight, ...): a YAML file, or a mapping in "
        "place such as '{temperature: 0}'; see docs/language-models.md.",
        panel=MODEL,
        metavar="FILE",
    ),
]
DeviceName = Annotated[str, option("Evaluate arms on: auto, cpu or cuda.", panel=EVALUATION)]
Figures = Annotated[
    bool,
    option("Make the page (report.html) and the figures of a finished run.", "--figures/--no-figures", panel=OUTPUT),
]
SummaryJson = Annotated[bool, option("Print only summary.json to stdout.", "--json", panel=OUTPUT)]
Json = Annotated[bool, option("Print only JSON to stdout.", "--json", panel=OUTPUT)]
Csv = Annotated[bool, option("Print only CSV to stdout, in SI units.", "--csv", panel=OUTPUT)]
Scheduler = Annotated[
    str | None,
    option(
        "Use the Dask cluster at this address (tcp://HOST:PORT); --workers then limits tasks in flight.",
        panel=EVALUATION,
    ),
]


def is_run(name: str) -> bool:
    """Return whether this is a run folder; unlike Path.is_file, also for a name that is too long."""
    from armwright.runs.folder import CONFIG

    return os.path.isfile(os.path.join(name, CONFIG))


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
    from armwright.runs.folder import read_config
    from armwright.spaces.design_space import default_space, load_space
    from armwright.spaces.tolerance import TOLERANCE
    from armwright.tasks.catalogue import load_task

    run = read_config(Path(task)) if is_run(task) else None
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

    if not n_workers and not scheduler:
        return None
    return Workers(n_workers or None, scheduler)
