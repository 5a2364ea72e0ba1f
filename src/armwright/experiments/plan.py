"""Experiment files: tasks, seeds and methods, and their selection."""

from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Literal, Self

import yaml
from pydantic import AfterValidator, BaseModel, Field, model_validator

from armwright.exceptions import SettingsError, did_you_mean
from armwright.files import check_name, check_no_links, naming_write_errors, replace_file
from armwright.llm.configuration import configured_model, own_addresses
from armwright.llm.model_options import ModelOptions
from armwright.proposers.factory import Choice, choose_proposer
from armwright.spaces.design_space import builtin_spaces
from armwright.tasks.catalogue import builtin_names
from armwright.yaml_documents import parse_document, read_document

PLAN = "experiment.yaml"  # in the experiment's folder
ALL_TASKS = "all"  # the tasks of `suite_tasks`, instead of a list
MAX_SEEDS = 10_000
Key = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._-]{0,39}$"), AfterValidator(check_name)]
Count = Annotated[int, Field(ge=1, le=2**31 - 1)]


def _check_seeds(seeds: int | tuple[int, ...]) -> int | tuple[int, ...]:
    if isinstance(seeds, tuple) and (not seeds or len(set(seeds)) < len(seeds)):
        raise ValueError("expected at least one seed, each once")
    return seeds


# A number of seeds from 0 on, or a list.
Seeds = Annotated[
    Annotated[int, Field(ge=1, le=MAX_SEEDS)] | tuple[Annotated[int, Field(ge=0, le=2**31 - 1)], ...],
    AfterValidator(_check_seeds),
]


class MethodPlan(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A method: the options of `armwright optimize`, or, with `design`, the evaluations of `armwright design`.

    label: name in tables and figures. proposer: as in `armwright optimize`; `replay:NAME` may contain {task} and
        {seed}, and runs the cells for which there is such a recording.
    seeds: those of the experiment's seeds that it runs; None for all. against: the methods that it is compared with; by
        default the baseline.
    """

    label: str = Field(min_length=1, max_length=40)
    proposer: Literal["none", "rules", "llm"] | Annotated[str, Field(pattern="^replay:.+")] = "none"
    design: Count | None = None  # evaluations of `armwright design`, which then runs instead of a study
    sampler: str = "tpe"
    n_step: Count = 10
    seeds: Seeds | None = None
    against: tuple[Key, ...] = ()
    model_options: ModelOptions = ModelOptions()

    @property
    def needs_a_model(self) -> bool:
        """True if it needs a language model, or a recorded run of one."""
        return self.design is None and self.proposer == "llm"

    def recording(self, task: str, seed: int) -> str | None:
        """Return the recording that it replays for a task and a seed; None if it replays none."""
        kind, _, name = self.proposer.partition(":")
        return name.replace("{task}", task).replace("{seed}", str(seed)) if kind == "replay" else None

    def choose_proposer(self, replay: str | None = None) -> Choice:
        """Return its proposer; with a recorded run, that of the replay."""
        if replay is not None:
            return choose_proposer(f"replay:{replay}")
        return choose_proposer(self.proposer, self.model_options)


class FigurePlan(BaseModel, frozen=True, extra="forbid"):
    """A figure of hypervolume curves, with a panel for each task."""

    title: str  # above the curves
    methods: tuple[Key, ...] = Field(min_length=1)  # to draw


class ExperimentPlan(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The content of an experiment file.

    tasks: names of built-in tasks (including random-N), or task files next to the experiment file.
    n_init, n_total, space, robust: as in `armwright optimize`; equal for all methods, so that they can be compared.
    seeds: a number of seeds from 0 on, or a list. baseline: the method that others without `against` are compared with.
    published: published numbers to show, by method and task: (E_hv, σ_hv).
    figures: by name; by default one with all methods. samples: methods to draw in detail, with their first seed; the
        first one with runs is used.
    """

    name: Key  # also of its folder
    description: str = ""
    tasks: Annotated[tuple[str, ...], Field(min_length=1)] | Literal["all"]
    seeds: Seeds = 5
    n_init: Count = 10
    n_total: Count = 200
    space: str | None = None
    robust: bool = False
    methods: dict[Key, MethodPlan] = Field(min_length=1)
    baseline: Key | None = None
    published: dict[Key, dict[str, tuple[float, float]]] = {}
    published_in: str = ""  # source of these numbers
    figures: dict[Key, FigurePlan] = {}
    samples: tuple[Key, ...] = ()

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        used = {"baseline": () if self.baseline is None else (self.baseline,), "published": tuple(self.published)}
        used |= {f"figures.{name}": figure.methods for name, figure in self.figures.items()}
        used |= {f"methods.{key}.against": method.against for key, method in self.methods.items()}
        for where, keys in (used | {"samples": self.samples}).items():
            for key in keys:
                if key not in self.methods:
                    raise ValueError(
                        f'{where} names the unknown method "{key}"; available: {", ".join(self.methods)}.'
                        f"{did_you_mean(key, self.methods)}"
                    )
        labels = [method.label for method in self.methods.values()]
        if len(set(labels)) < len(labels):
            raise ValueError("two methods have the same label")
        return self

    @property
    def seed_list(self) -> tuple[int, ...]:
        """The seeds as a list."""
        return _listed(self.seeds)

    def seeds_of(self, key: str) -> tuple[int, ...]:
        """Return the seeds that a method runs."""
        seeds = self.methods[key].seeds
        return tuple(seed for seed in self.seed_list if seeds is None or seed in _listed(seeds))

    @property
    def task_list(self) -> tuple[str, ...]:
        """The tasks as a list."""
        return suite_tasks() if self.tasks == ALL_TASKS else tuple(self.tasks)

    @property
    def drawn(self) -> tuple[dict[str, tuple[str, list[str]]], list[str]]:
        """Title and methods of each figure, and the samples; all methods by their labels."""
        labels = {key: method.label for key, method in self.methods.items()}
        curves = {
            name: (figure.title, [labels[key] for key in figure.methods]) for name, figure in self.figures.items()
        }
        return curves, [labels[key] for key in self.samples]


def _listed(seeds: int | tuple[int, ...]) -> tuple[int, ...]:
    return tuple(range(seeds)) if isinstance(seeds, int) else seeds


def suite_tasks() -> tuple[str, ...]:
    """Return the names of the built-in tasks in the paper's space."""
    return tuple(name for name in builtin_names() if name not in builtin_spaces())


def builtin_files() -> dict[str, Traversable]:
    """Return the files of the built-in experiments by name."""
    folder = resources.files("armwright.experiments") / "builtin"
    return {file.name.removesuffix(".yaml"): file for file in sorted(folder.iterdir(), key=lambda file: file.name)}


def builtin_text(name: str) -> str:
    """Return the file of a built-in experiment, as a template."""
    files = builtin_files()
    if name not in files:
        raise SettingsError(
            f'unknown experiment "{name}".{did_you_mean(name, files)} Built-in experiments: {", ".join(files)}; '
            "or give a YAML file"
        )
    return files[name].read_text(encoding="utf-8")


def load_experiment(name_or_path: str) -> tuple[ExperimentPlan, Path]:
    """Return an experiment by its name or YAML file, and the folder of its other files."""
    path = Path(name_or_path)
    if name_or_path in builtin_files() or not path.is_file():
        return parse_document(builtin_text(name_or_path), ExperimentPlan, SettingsError, name_or_path), Path.cwd()
    plan = read_document(path, ExperimentPlan, SettingsError)
    methods = {
        key: method.model_copy(update={"model_options": method.model_options.named_in(path.name)})
        for key, method in plan.methods.items()
    }
    return plan.model_copy(update={"methods": methods}), path.resolve().parent


def with_model(plan: ExperimentPlan, options: ModelOptions) -> ExperimentPlan:
    """Return the plan with the configured model, if any, for methods that need a model and name none.

    The options of a method take precedence.
    """
    methods: dict[str, MethodPlan] = {}
    addresses = (*own_addresses(), None if options.keyless else options.base_url)
    for key, method in plan.methods.items():
        method = method.model_copy(update={"model_options": method.model_options.approved(addresses)})
        if method.needs_a_model and method.model_options.model is None:
            configured = configured_model(method.model_options.with_defaults(options))
            if configured is not None:
                method = method.model_copy(update={"model_options": configured.options})
        methods[key] = method
    return plan.model_copy(update={"methods": methods})


def write_plan(plan: ExperimentPlan, out: Path) -> None:
    """Store the plan, with the models that were used, next to the results."""
    text = yaml.safe_dump(plan.model_dump(mode="json", exclude_defaults=True), sort_keys=False, allow_unicode=True)
    check_no_links(out)
    with naming_write_errors(out / PLAN):
        out.mkdir(parents=True, exist_ok=True)
        replace_file(out / PLAN, text.encode())
