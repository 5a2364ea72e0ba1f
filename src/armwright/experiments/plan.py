"""What an experiment consists of: the file that people write, and the cells that it stands for."""

import itertools
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, Field, field_validator, model_validator

from armwright.exceptions import SettingsError, TaskError, did_you_mean
from armwright.files import check_name
from armwright.llm.configuration import configured_model
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import PROMPTS
from armwright.llm.transcript import TRANSCRIPTS
from armwright.proposers.factory import PROPOSERS, Choice, choose_proposer
from armwright.tasks.catalogue import builtin_names, load_task
from armwright.yaml_documents import parse_document, read_document

ALL_TASKS = "all"  # instead of a list: every built-in task
RUNS = "runs"  # in an experiment's folder
MOST_SEEDS = 10_000
MOST_CELLS = 100_000
Key = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._-]{0,39}$"), AfterValidator(check_name)]
Count = Annotated[int, Field(ge=1, le=2**31 - 1)]


class MethodPlan(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """One method: the options of `armwright optimize`, or, with `front`, the budget of `armwright front`.

    label: how tables and figures call it.
    """

    label: str = Field(min_length=1, max_length=40)
    proposer: str = "none"
    front: str | None = None  # a budget of `armwright front`, which then runs instead of a study
    sampler: str = "tpe"
    n_step: Count = 10
    refine_every: Count | None = None
    model_options: ModelOptions = ModelOptions()

    @property
    def asks_a_model(self) -> bool:
        """Whether it can only run with a language model, or with a record of one."""
        return self.front is None and self.proposer == "llm"

    def choose_proposer(self, replay: Path | None = None) -> Choice:
        """Return its proposer; with a recorded run, that of the replay."""
        if replay is not None:
            return choose_proposer(f"replay:{replay}")
        return choose_proposer(self.proposer, self.model_options)

    @model_validator(mode="after")
    def _check_proposer(self) -> Self:
        allowed = tuple(name for name in PROPOSERS if name != "auto")
        if self.proposer not in allowed:
            raise ValueError(
                f'proposer "{self.proposer}" is not one of {", ".join(allowed)}.{did_you_mean(self.proposer, allowed)}'
            )
        return self


class FigurePlan(BaseModel, frozen=True, extra="forbid"):
    """Hypervolume curves of some methods, a panel for each task."""

    title: str  # above the curves
    methods: tuple[Key, ...] = Field(min_length=1)  # whose curves are drawn


class ExperimentPlan(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """An experiment as its file states it.

    tasks: names of built-in tasks (random-N is one of a seeded family), or task files beside the experiment's file.
    n_init, n_total, space, robust: as of `armwright optimize`, the same for all methods, so that they can be compared.
    seeds: so many from 0 on, or a list. baseline: what the others are compared with.
    published: numbers to show beside ours: of a method, of a task, (E_hv, σ_hv).
    figures: by name; without any, one with all methods. samples: the methods whose runs with the first seed are drawn,
        the first of them that has runs.
    """

    name: Key  # of its folder
    description: str = ""  # what it is to show
    tasks: tuple[str, ...] | Literal["all"]
    seeds: Annotated[int, Field(ge=1, le=MOST_SEEDS)] | tuple[Annotated[int, Field(ge=0, le=2**31 - 1)], ...] = 5
    n_init: Count = 10
    n_total: Count = 200
    space: str | None = None
    robust: bool = False
    methods: dict[Key, MethodPlan] = Field(min_length=1)  # by names of yours
    baseline: Key | None = None
    published: dict[Key, dict[str, tuple[float, float]]] = {}
    published_in: str = ""  # where these numbers stand
    figures: dict[Key, FigurePlan] = {}
    samples: tuple[Key, ...] = ()

    @field_validator("seeds")
    @classmethod
    def _each_seed_once(cls, seeds: int | tuple[int, ...]) -> int | tuple[int, ...]:
        if isinstance(seeds, tuple) and (not seeds or len(set(seeds)) < len(seeds)):
            raise ValueError("seeds must hold at least one number, each once")
        return seeds

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        if not self.tasks:
            raise ValueError("tasks is empty: name at least one, or all")
        used = {"baseline": () if self.baseline is None else (self.baseline,), "published": tuple(self.published)}
        used |= {f"figures.{name}": figure.methods for name, figure in self.figures.items()}
        for where, keys in (used | {"samples": self.samples}).items():
            for key in keys:
                if key not in self.methods:
                    raise ValueError(
                        f'{where} names "{key}", which is none of the methods {", ".join(self.methods)}.'
                        f"{did_you_mean(key, self.methods)}"
                    )
        labels = [method.label for method in self.methods.values()]
        if len(set(labels)) < len(labels):
            raise ValueError("two methods have the same label")
        return self

    @property
    def seed_list(self) -> tuple[int, ...]:
        """The seeds, each by itself."""
        return tuple(range(self.seeds)) if isinstance(self.seeds, int) else self.seeds

    @property
    def task_list(self) -> tuple[str, ...]:
        """The tasks, each by itself."""
        return tuple(builtin_names()) if self.tasks == ALL_TASKS else tuple(self.tasks)

    @property
    def against(self) -> str:
        """The method that the others are compared with: the stated one, else the first."""
        return self.baseline or next(iter(self.methods))


@dataclass(frozen=True)
class Cell:
    """One run of an experiment: a method on a task with a seed, in a folder of its own.

    task, space: names or absolute paths. replay: the recorded run that is played instead of asking a model.
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
    replay: Path | None = None

    @property
    def words(self) -> str:
        """What it is, for the user."""
        return f"{self.plan.label}, {self.task_name}, seed {self.seed}"

    @property
    def command(self) -> str:
        """The same run as one command for a shell."""
        return shlex.join([*_program(), *(self._front_options() if self.plan.front else self._study_options())])

    def _study_options(self) -> list[str]:
        plan, options = self.plan, self.plan.model_options
        replayed = ModelOptions(in_flight=options.in_flight) if options.in_flight else ModelOptions()
        said: dict[str, Any] = {
            "proposer": f"replay:{self.replay}" if self.replay else plan.proposer,
            **(replayed if self.replay else options).command_options(),
            "sampler": plan.sampler,
            "n-init": self.n_init,
            "n-step": plan.n_step,
            "n-total": self.n_total,
            "refine-every": plan.refine_every,
        }
        return ["optimize", self.task, *self._options(said), "--no-figures"]

    def _front_options(self) -> list[str]:
        return ["front", self.task, *self._options({"budget": self.plan.front}), "--no-figures"]

    def _options(self, said: Mapping[str, Any]) -> list[str]:
        all_said = {**said, "space": self.space, "seed": self.seed, "out": self.folder}
        given = [f"--{name.replace('_', '-')}={value}" for name, value in all_said.items() if value is not None]
        return given + ["--robust"] * self.robust


@dataclass(frozen=True)
class Skipped:
    """A cell that cannot be run here, and why."""

    cell: Cell
    reason: str


def builtin_experiments() -> dict[str, ExperimentPlan]:
    """The experiments that come with armwright, by name."""
    folder = resources.files("armwright.experiments") / "builtin"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".yaml")), key=lambda f: f.name)
    plans = [parse_document(f.read_text(encoding="utf-8"), ExperimentPlan, SettingsError, f.name) for f in files]
    return {plan.name: plan for plan in plans}


def builtin_text(name: str) -> str:
    """The file of a built-in experiment, to edit a copy of it."""
    file = resources.files("armwright.experiments") / "builtin" / f"{name}.yaml"
    if name not in builtin_experiments():
        raise SettingsError(_unknown(name))
    return file.read_text(encoding="utf-8")


def load_experiment(name_or_path: str) -> tuple[ExperimentPlan, Path]:
    """A built-in experiment by its name, or that of a YAML file, and the folder that its files lie in."""
    known = builtin_experiments()
    if name_or_path in known:
        return known[name_or_path], Path.cwd()
    path = Path(name_or_path)
    if not path.is_file():
        raise SettingsError(_unknown(name_or_path))
    return read_document(path, ExperimentPlan, SettingsError), path.resolve().parent


def _unknown(name: str) -> str:
    known = builtin_experiments()
    return (
        f'unknown experiment "{name}".{did_you_mean(name, known)} Built-in experiments: {", ".join(known)}; '
        "or give a YAML file"
    )


def cells_of(
    plan: ExperimentPlan, beside: Path, out: Path, replay: Path | None = None
) -> tuple[list[Cell], list[Skipped]]:
    """The cells that can be run, by seed, task and method, and those that cannot.

    beside: the folder that the experiment's own files lie in. out: the experiment's folder.
    replay: a folder of an earlier experiment, whose recorded runs stand for the model.
    """
    if replay is not None and not replay.is_dir():
        raise SettingsError(f"--replay {replay}: there is no such folder of an earlier experiment")
    n_cells = len(plan.task_list) * len(plan.seed_list) * len(plan.methods)
    if n_cells > MOST_CELLS:
        raise SettingsError(f"the experiment has {n_cells:,} cells; at most {MOST_CELLS:,} are allowed")
    space = None if plan.space is None else str((beside / plan.space).resolve())
    tasks = [_task(name, beside) for name in plan.task_list]
    names = [name for _, name in tasks]
    if len(set(names)) < len(names):
        raise SettingsError(f"two tasks of the experiment have the same name: {', '.join(sorted(names))}")
    ready: list[Cell] = []
    skipped: list[Skipped] = []
    methods = {key: _with_prompt(method, beside) for key, method in plan.methods.items()}
    # By seed first: what is there when an experiment is stopped then says something of every method.
    for seed, (task, task_name), (key, method) in itertools.product(plan.seed_list, tasks, methods.items()):
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
        if seed == plan.seed_list[0] and not cell.command.isprintable():
            raise SettingsError(f"{cell.command}: a name in it has a character that can stand on no line of a script")
        cell, reason = _source_of_model(cell, replay)
        if reason:
            skipped.append(Skipped(cell, reason))
        else:
            ready.append(cell)
    return ready, skipped


def _source_of_model(cell: Cell, replay: Path | None) -> tuple[Cell, str]:
    """The cell with what answers in it, or why nothing does."""
    if not cell.plan.asks_a_model:
        return cell, ""
    if replay is not None:
        recorded = replay.resolve() / RUNS / cell.method / cell.task_name / f"seed{cell.seed}"
        if (recorded / TRANSCRIPTS).is_file():
            return replace(cell, replay=recorded), ""
        return cell, f"{replay} holds no record of it"
    if cell.plan.model_options.model is None:
        return cell, "no language model is configured; --model names one, --replay DIR plays recorded runs"
    return cell, ""


def with_model(plan: ExperimentPlan, options: ModelOptions) -> ExperimentPlan:
    """Return the plan with the configured model, if there is one, for the methods that ask one and name none.

    What a method states goes before the options.
    """
    methods: dict[str, MethodPlan] = {}
    for key, method in plan.methods.items():
        if method.asks_a_model and method.model_options.model is None:
            configured = configured_model(method.model_options.with_defaults(options))
            if configured is not None:
                method = method.model_copy(update={"model_options": configured.options})
        methods[key] = method
    return plan.model_copy(update={"methods": methods})


def with_seeds(plan: ExperimentPlan, seeds: int | None) -> ExperimentPlan:
    """The plan with so many seeds from 0 on."""
    if seeds is None:
        return plan
    if not 1 <= seeds <= MOST_SEEDS:
        raise SettingsError(f"--seeds {seeds}: a whole number from 1 to {MOST_SEEDS} is needed")
    return plan.model_copy(update={"seeds": seeds})


def with_only(plan: ExperimentPlan, methods: Sequence[str], tasks: Sequence[str]) -> ExperimentPlan:
    """The plan with some of its methods and tasks alone; all, where none is named."""
    for asked, there, what in ((methods, plan.methods, "method"), (tasks, plan.task_list, "task")):
        for name in asked:
            if name not in there:
                raise SettingsError(
                    f'{plan.name} has no {what} "{name}".{did_you_mean(name, there)} It has: {", ".join(there)}'
                )
    kept = {key: method for key, method in plan.methods.items() if not methods or key in methods}
    return plan.model_copy(
        update={
            "methods": kept,
            "tasks": tuple(name for name in plan.task_list if not tasks or name in tasks),
            "baseline": plan.against if plan.against in kept else None,
            "published": {key: numbers for key, numbers in plan.published.items() if key in kept},
            "figures": {
                name: figure.model_copy(update={"methods": tuple(key for key in figure.methods if key in kept)})
                for name, figure in plan.figures.items()
                if any(key in kept for key in figure.methods)
            },
            "samples": tuple(key for key in plan.samples if key in kept),
        }
    )


def _task(name: str, beside: Path) -> tuple[str, str]:
    """What `load_task` takes, wherever the cell runs, and the task's own name."""
    file = beside / name
    if Path(name).suffix in (".yaml", ".yml"):
        if not file.is_file():
            raise TaskError(f"there is no file {file}, which the experiment names as a task")
        return str(file.resolve()), load_task(file).name
    return name, load_task(name).name


def _with_prompt(method: MethodPlan, beside: Path) -> MethodPlan:
    """Return the method with its prompt's file as an absolute path."""
    options = method.model_options
    if options.prompt in PROMPTS:
        return method
    options = options.model_copy(update={"prompt": str((beside / options.prompt).resolve())})
    return method.model_copy(update={"model_options": options})


def _program() -> list[str]:
    """How armwright was called, for a shell on the same machine."""
    called = Path(sys.argv[0])
    return [str(called.resolve())] if called.name == "armwright" and called.is_file() else ["armwright"]
