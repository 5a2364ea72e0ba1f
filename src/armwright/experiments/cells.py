"""The cells of an experiment: one run per seed, task and method."""

import itertools
import shlex
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from armwright.exceptions import SettingsError, TaskError
from armwright.experiments.plan import ExperimentPlan, MethodPlan
from armwright.llm.model_options import ModelOptions
from armwright.llm.recording_file import shipped_recordings
from armwright.llm.servers import SERVER_KEY
from armwright.llm.transcript import TRANSCRIPTS
from armwright.tasks.catalogue import load_task

RUNS = "runs"  # in an experiment's folder
MAX_CELLS = 100_000


@dataclass(frozen=True)
class Cell:
    """One run of an experiment: a method on a task with a seed, in its own folder.

    task, space: names or absolute paths. replay: a recording, or the folder of a recorded run, to replay.
    """

    method: str
    plan: MethodPlan
    task: str
    task_name: str
    space: str | None
    seed: int
    n_init: int
    n_total: int
    robust: bool
    folder: Path
    replay: str | None = None

    @property
    def description(self) -> str:
        """Method, task and seed, for messages."""
        return f"{self.plan.label}, {self.task_name}, seed {self.seed}"

    @property
    def command(self) -> str:
        """The shell command of the same run."""
        without_key = ["env", "-u", SERVER_KEY] if self.plan.model_options.keyless else []
        options = self._design_options() if self.plan.design else self._study_options()
        return shlex.join([*without_key, *_program(), *options])

    def _study_options(self) -> list[str]:
        plan, options = self.plan, self.plan.model_options
        if self.replay:
            options = ModelOptions(in_flight=options.in_flight) if options.in_flight else ModelOptions()
        arguments: dict[str, Any] = {
            "proposer": f"replay:{self.replay}" if self.replay else plan.proposer,
            **options.command_options(),
            "sampler": plan.sampler,
            "n-init": self.n_init,
            "n-step": plan.n_step,
            "n-total": self.n_total,
        }
        return ["optimize", self.task, *self._arguments(arguments), "--no-figures"]

    def _design_options(self) -> list[str]:
        return ["design", self.task, *self._arguments({"evaluations": self.plan.design}), "--no-figures"]

    def _arguments(self, options: Mapping[str, Any]) -> list[str]:
        options = {**options, "space": self.space, "seed": self.seed, "out": self.folder}
        given = [f"--{name.replace('_', '-')}={value}" for name, value in options.items() if value is not None]
        return given + ["--robust"] * self.robust


@dataclass(frozen=True)
class Skipped:
    """A cell that cannot be run, and the reason."""

    cell: Cell
    reason: str


def plan_cells(
    plan: ExperimentPlan, folder: Path, out: Path, replay: Path | None = None
) -> tuple[list[Cell], list[Skipped]]:
    """Return the cells that can be run, by seed, task and method, and those that cannot.

    Args:
        plan: The experiment.
        folder: Folder of the files that the experiment names.
        out: Folder of the experiment's results.
        replay: Folder of an earlier experiment, whose recorded runs replace the model.
    """
    if replay is not None and not replay.is_dir():
        raise SettingsError(f"--replay: expected the folder of an earlier experiment, got {replay}")
    n_cells = len(plan.task_list) * len(plan.seed_list) * len(plan.methods)
    if n_cells > MAX_CELLS:
        raise SettingsError(f"the experiment has {n_cells:,} cells; expected at most {MAX_CELLS:,}")
    space = None if plan.space is None else str((folder / plan.space).resolve())
    tasks = [_task(name, folder) for name in plan.task_list]
    names = [name for _, name in tasks]
    if len(set(names)) < len(names):
        raise SettingsError(f"expected tasks with different names, got {', '.join(sorted(names))}")
    ready: list[Cell] = []
    skipped: list[Skipped] = []
    methods = {key: _with_prompt(method, folder) for key, method in plan.methods.items()}
    # By seed first: an experiment that is stopped early then has results of every method.
    for seed, (task, task_name), (key, method) in itertools.product(plan.seed_list, tasks, methods.items()):
        seeds = plan.seeds_of(key)
        if seed not in seeds:
            continue
        cell = Cell(
            method=key,
            plan=method,
            task=task,
            task_name=task_name,
            space=space,
            seed=seed,
            n_init=plan.n_init,
            n_total=plan.n_total,
            robust=plan.robust,
            folder=out.resolve() / RUNS / key / task_name / f"seed{seed}",
        )
        if seed == seeds[0] and not cell.command.isprintable():
            raise SettingsError(f"{cell.command}: a name in it has a character that is not printable")
        cell, reason = _with_model_source(cell, folder, replay)
        if reason:
            skipped.append(Skipped(cell, reason))
        else:
            ready.append(cell)
    return ready, skipped


def _with_model_source(cell: Cell, folder: Path, replay: Path | None) -> tuple[Cell, str]:
    """Return the cell with its model or replay; or the reason why it has neither."""
    recording = cell.plan.recording(cell.task_name, cell.seed)
    if recording is not None:
        if recording not in shipped_recordings():
            recording = str((folder / recording).resolve())
            if not Path(recording).exists():
                return cell, f"there is no {cell.plan.proposer.removeprefix('replay:')}"
        return replace(cell, replay=recording), ""
    if not cell.plan.needs_a_model:
        return cell, ""
    if replay is not None:
        recorded = replay.resolve() / RUNS / cell.method / cell.task_name / f"seed{cell.seed}"
        if (recorded / TRANSCRIPTS).is_file():
            return replace(cell, replay=str(recorded)), ""
        return cell, f"{replay} has no recorded run of it"
    if cell.plan.model_options.model is None:
        return cell, "no language model is configured; use --model, or --replay DIR for recorded runs"
    return cell, ""


def _task(name: str, folder: Path) -> tuple[str, str]:
    """Return the argument for `load_task`, independent of the working directory, and the task's name."""
    file = folder / name
    if Path(name).suffix in (".yaml", ".yml"):
        if not file.is_file():
            raise TaskError(f"there is no file {file}, which the experiment names as a task")
        return str(file.resolve()), load_task(file).name
    return name, load_task(name).name


def _with_prompt(method: MethodPlan, folder: Path) -> MethodPlan:
    """Return the method with the path of its prompt file made absolute."""
    from armwright.llm.prompt import BUILTIN_PROMPTS  # which loads jinja2: comparisons do without

    options = method.model_options
    if options.prompt in BUILTIN_PROMPTS:
        return method
    options = options.model_copy(update={"prompt": str((folder / options.prompt).resolve())})
    return method.model_copy(update={"model_options": options})


def _program() -> list[str]:
    """Return the command that started this program, for a shell on the same machine."""
    called = Path(sys.argv[0])
    return [str(called.resolve())] if called.name == "armwright" and called.is_file() else ["armwright"]
