"""The cells of an experiment, one run per seed, task and method, and the comparison of those that are finished."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from armwright.exceptions import FailureError, SettingsError, TaskError, did_you_mean
from armwright.experiments.compare_runs import Comparison
from armwright.experiments.plan import ExperimentPlan, MethodPlan
from armwright.experiments.run_record import read_run_summary
from armwright.llm.recording_file import shipped_recordings
from armwright.proof.results import read_summary
from armwright.tasks.catalogue import load_task

RUNS = "runs"  # in an experiment's folder
MAX_CELLS = 100_000

T = TypeVar("T", int, str)


@dataclass(frozen=True)
class Cell:
    """One run of an experiment: a method on a task with a seed, in its own folder.

    task, space: names or absolute paths. replay: a recording, or the folder of a recorded run, to replay.
    """

    experiment: ExperimentPlan = field(hash=False)  # the same for all cells
    plan: MethodPlan
    task: str
    task_name: str
    space: str | None
    seed: int
    folder: Path
    replay: str | None = None
    reason: str = ""  # why it cannot be run; empty if it can

    @property
    def description(self) -> str:
        """Method, task and seed, for messages."""
        return f"{self.plan.label}, {self.task_name}, seed {self.seed}"


@dataclass(frozen=True)
class CellOutcome:
    """The outcome of a cell."""

    cell: Cell
    seconds: float
    hypervolume: float | None = None
    fault: str = ""  # why it failed; empty if it is finished


def plan_cells(
    plan: ExperimentPlan,
    folder: Path,
    out: Path,
    *,
    methods: Sequence[str] = (),
    tasks: Sequence[str] = (),
    seeds: Sequence[int] = (),
) -> tuple[list[Cell], list[Cell]]:
    """Return the cells that can be run, by seed, task and method, and those that cannot.

    The files that the experiment names are in `folder`; its results go to `out`. Empty methods, tasks or seeds stand
    for all.
    """
    chosen_methods = _chosen("method", methods, list(plan.methods), plan.name)
    chosen_tasks = _chosen("task", tasks, plan.task_list, plan.name)
    chosen_seeds = _chosen("seed", seeds, plan.seed_list, plan.name)
    n_cells = len(chosen_tasks) * len(chosen_seeds) * len(chosen_methods)
    if n_cells > MAX_CELLS:
        raise SettingsError(f"the experiment has {n_cells:,} cells; expected at most {MAX_CELLS:,}")
    space = None if plan.space is None else str((folder / plan.space).resolve())
    found = [_task(name, folder) for name in chosen_tasks]
    names = [name for _, name in found]
    if len(set(names)) < len(names):
        raise SettingsError(f"expected tasks with different names, got {', '.join(sorted(names))}")
    cells: list[Cell] = []
    # By seed first: an experiment that is stopped early then has results of every method.
    for seed, (task, task_name), key in itertools.product(chosen_seeds, found, chosen_methods):
        if seed not in plan.seeds_of(key):
            continue
        method, task_folder = plan.methods[key], out.resolve() / RUNS / key / task_name / f"seed{seed}"
        replay, reason = _model_source(method, task_name, seed, folder)
        cell = Cell(
            experiment=plan,
            plan=method,
            task=task,
            task_name=task_name,
            space=space,
            seed=seed,
            folder=task_folder,
            replay=replay,
            reason=reason,
        )
        cells.append(cell)
    return [cell for cell in cells if not cell.reason], [cell for cell in cells if cell.reason]


def _chosen(what: str, chosen: Sequence[T], available: Sequence[T], experiment: str) -> Sequence[T]:
    """Return what is chosen, all if nothing is; SettingsError for what there is not."""
    for one in chosen:
        if one not in available:
            names = list(map(str, available))
            raise SettingsError(
                f'{experiment} has no {what} "{one}".{did_you_mean(str(one), names)} Available: {", ".join(names)}'
            )
    return [one for one in available if one in chosen] if chosen else available


def _model_source(plan: MethodPlan, task: str, seed: int, folder: Path) -> tuple[str | None, str]:
    """Return the recording that a method replays, if it does, and the reason why it has no answers of a model."""
    if plan.needs_a_model and plan.model_options.model is None:
        return None, "no language model is configured; name one by --model"
    recording = plan.recording(task, seed)
    if recording is not None and recording not in shipped_recordings():
        recording = str((folder / recording).resolve())
        if not Path(recording).exists():
            return None, f"there is no {plan.proposer.removeprefix('replay:')}"
    return recording, ""


def _task(name: str, folder: Path) -> tuple[str, str]:
    """Return the argument for `load_task`, independent of the working directory, and the task's name."""
    file = folder / name
    if Path(name).suffix in (".yaml", ".yml"):
        if not file.is_file():
            raise TaskError(f"there is no file {file}, which the experiment names as a task")
        return str(file.resolve()), load_task(file).name
    return name, load_task(name).name


def collect(plan: ExperimentPlan, cells: Sequence[Cell]) -> Comparison:
    """Compare the finished cells, with the labels and in the order of the plan."""
    records = [
        read_run_summary(cell.folder, cell.plan.label) for cell in cells if read_summary(cell.folder) is not None
    ]
    if not records:
        raise FailureError("no cell of the experiment is finished, so there is nothing to compare")
    labels = [method.label for method in plan.methods.values()]
    tasks = list(dict.fromkeys(cell.task_name for cell in cells))
    against = {m.label: [plan.methods[key].label for key in m.against] for m in plan.methods.values() if m.against}
    published = {
        (plan.methods[key].label, task): numbers
        for key, by_task in plan.published.items()
        for task, numbers in by_task.items()
    }
    baseline = plan.methods[plan.baseline or next(iter(plan.methods))].label
    return Comparison(records, labels, tasks, baseline, against, published, plan.published_in)
