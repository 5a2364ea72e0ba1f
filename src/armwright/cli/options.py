"""Options that several commands share, and the objects that they describe."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from armwright.problem.problem import Problem
    from armwright.study.workers.cluster import Workers

# Groups of options in `--help`
TASK, SEARCH, MODEL = "Task", "Search", "Language model"
EVALUATION, OUTPUT = "Evaluation", "Output"

# Options
TaskName = Annotated[
    str, typer.Argument(metavar="TASK", help="A built-in task (see `armwright tasks`), a YAML file, or a run folder.")
]
RunFolder = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]
SpaceFile = Annotated[
    Path | None,
    typer.Option(
        help="Design space: the name of a built-in one, or a YAML file.",
        show_default="the task's own, else the paper's",
        rich_help_panel=TASK,
    ),
]
Objectives = Annotated[
    str | None,
    typer.Option(
        help="Objectives to minimise instead of the task's: names with commas, see docs/method.md, 3.",
        rich_help_panel=TASK,
    ),
]
EvaluatorName = Annotated[
    str | None,
    typer.Option(
        help="A custom Python function that evaluates arms, FILE.py:FUNCTION or MODULE:FUNCTION; its code is run.",
        rich_help_panel=TASK,
    ),
]
EvaluationTimeout = Annotated[
    float | None,
    typer.Option(
        help="End an evaluation by --evaluator after so many seconds; its design is infeasible then.",
        show_default="no limit",
        rich_help_panel=EVALUATION,
    ),
]
AllowFailures = Annotated[
    bool,
    typer.Option(
        "--allow-failures",
        help="Go on if the first five evaluations by --evaluator all fail with the same exception.",
        rich_help_panel=EVALUATION,
    ),
]
Robust = Annotated[
    bool,
    typer.Option(
        "--robust", help="Count a design by its worst case with the base or a link 1 mm off.", rich_help_panel=TASK
    ),
]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", rich_help_panel=SEARCH)]
ModelName = Annotated[
    str | None, typer.Option(help="Language model, such as openai-chat:gpt-4o.", rich_help_panel=MODEL)
]
PromptName = Annotated[
    str | None,
    typer.Option(
        help="Prompt: plus (with analysis instructions), minus, or full (whole front, mechanics).",
        show_default="plus",
        rich_help_panel=MODEL,
    ),
]
MemoryName = Annotated[
    str | None,
    typer.Option(
        help="What the model remembers of a run: none (every question is new) or chat (the whole conversation).",
        show_default="none",
        rich_help_panel=MODEL,
    ),
]
MaxCost = Annotated[float | None, typer.Option(help="Stop asking the model after so many USD.", rich_help_panel=MODEL)]
ModelOptionsFile = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="All other settings of the model (base_url, temperature, in_flight, ...): a YAML file, or a mapping in "
        "place such as '{temperature: 0}'; see docs/language-models.md.",
        rich_help_panel=MODEL,
    ),
]
DeviceName = Annotated[str, typer.Option(help="Evaluate arms on: auto, cpu or cuda.", rich_help_panel=EVALUATION)]
Figures = Annotated[
    bool,
    typer.Option(
        "--figures/--no-figures",
        help="Make the page (report.html) and the figures of a finished run.",
        rich_help_panel=OUTPUT,
    ),
]
SummaryJson = Annotated[bool, typer.Option("--json", help="Print only summary.json to stdout.", rich_help_panel=OUTPUT)]
Json = Annotated[bool, typer.Option("--json", help="Print only JSON to stdout.", rich_help_panel=OUTPUT)]
Csv = Annotated[bool, typer.Option("--csv", help="Print only CSV to stdout, in SI units.", rich_help_panel=OUTPUT)]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Use the Dask cluster at this address (tcp://HOST:PORT); --workers then limits tasks in flight.",
        rich_help_panel=EVALUATION,
    ),
]


def load_problem(
    task: str,
    space: Path | None,
    robust: bool = False,
    device: str = "cpu",
    many: bool = False,
    objectives: str | None = None,
    evaluator: str | None = None,
) -> "Problem":
    """Load the task, space and evaluator that the options name.

    Args:
        task: A built-in task, a task file, or a run folder, whose task it is.
        space: A built-in space or a space file; None for that of the run folder, or of the task's name, else the
            paper's.
        robust: Whether a design counts by its worst case within the build tolerance.
        device: "auto", "cpu" or "cuda".
        many: Whether many designs are evaluated at once, which makes "auto" prefer a GPU.
        objectives: Names with commas, in place of the task's.
        evaluator: FILE.py:FUNCTION or MODULE:FUNCTION.
    """
    from armwright.kinematics.devices import resolve_device
    from armwright.problem.evaluators import load_evaluator
    from armwright.problem.objectives import PAPER_OBJECTIVES, named_objectives
    from armwright.problem.problem import Problem
    from armwright.runs.folder import CONFIG, read_config
    from armwright.spaces.design_space import default_space, load_space
    from armwright.spaces.tolerance import TOLERANCE
    from armwright.tasks.catalogue import load_task

    is_run = os.path.isfile(os.path.join(task, CONFIG))  # unlike Path.is_file, False also for a name that is too long
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

    if not n_workers and not scheduler:
        return None
    return Workers(n_workers or None, scheduler)
