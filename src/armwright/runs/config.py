"""The settings of a run: everything needed to repeat it, stored in config.yaml."""

import platform
from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, BaseModel, Field

from armwright.arrays import LARGEST_OBJECTIVE, Array
from armwright.exceptions import RunConflictError, RunFolderError
from armwright.kinematics.devices import Device, usable_device
from armwright.problem.evaluation import Evaluation
from armwright.problem.evaluators import Evaluator
from armwright.problem.objective import Objective
from armwright.problem.objectives import OBJECTIVES, PAPER_OBJECTIVES
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from armwright.text import one_line
from armwright.validation_messages import check_integer

# Settings that may differ when a run resumes. The objectives of the task are those of the run.
MAY_DIFFER = {
    "task": {"description", "provenance", "objectives"},
    "versions": True,
    "earlier_versions": True,
    "reference_point": True,
}
SHOWN = 80  # characters of a setting in a message; custom prompts are long
PACKAGES = ("armwright", "moocore", "numpy", "optuna", "warp-lang", "pydantic-ai-slim", "scipy", "torch")


def _check_proposer(settings: dict[str, Any] | None) -> dict[str, Any] | None:
    """Check the settings that a resumed run passes to its proposer."""
    for key in ("name", "prompt", "memory", "answer") if "prompt" in (settings or {}) else ("name",):
        if settings is not None and not isinstance(settings.get(key), str):
            raise ValueError(f"{key}: expected str, got {settings.get(key)!r}")
    return settings


class Method(BaseModel, frozen=True, extra="forbid"):
    """The search settings of a study."""

    # Its name and settings; None for black-box trials only
    proposer: Annotated[dict[str, Any] | None, AfterValidator(_check_proposer)]
    sampler: str
    n_init: int = Field(ge=1)  # number of random trials
    n_step: int = Field(ge=1)  # trials of a block; one of each block is the proposer's
    n_total: int = Field(ge=1)  # number of counted trials
    in_flight: int | None = Field(default=None, ge=1)  # requests while black-box trials go on; None to wait for each
    initial_designs: tuple[dict[str, float | str], ...] = ()  # designs of the first of the n_init trials
    screen: bool = False  # whether the surrogate decides which proposals are evaluated

    @property
    def n_trials(self) -> int:
        """The number of trials of the whole study, the random ones included."""
        return self.n_init + self.n_total

    @property
    def n_proposals(self) -> int:
        """The number of proposals in the whole study: one in each block of n_step trials."""
        return -(-self.n_total // self.n_step)

    def n_started(self, number: int) -> int:
        """Return how many blocks have started when trial `number` starts, its own included."""
        return max(0, (number - self.n_init) // self.n_step + 1)

    def is_first_trial(self, number: int) -> bool:
        """Return whether trial `number` is the first of a block."""
        return number >= self.n_init and (number - self.n_init) % self.n_step == 0


class FrontMethod(BaseModel, frozen=True, extra="forbid"):
    """The search settings of a direct search (study/front/front_run.py): its initial designs."""

    search: Literal["front_search"] = "front_search"
    initial_designs: dict[str, Any] | None = None

    @property
    def n_init(self) -> int:
        """0: the trials are the front."""
        return 0


class ObjectiveRecord(BaseModel, frozen=True, extra="forbid"):
    """An objective as recorded in a run's settings; its formula is code."""

    name: str
    label: str
    unit: str
    symbol: str


def record_objectives(objectives: Sequence[Objective]) -> tuple[ObjectiveRecord, ...]:
    """Return the records of objectives."""
    return tuple(ObjectiveRecord(name=o.name, label=o.label, unit=o.unit, symbol=o.symbol) for o in objectives)


class RunConfig(BaseModel, frozen=True, extra="forbid"):
    """Everything needed to repeat a run."""

    task: Task
    space: DesignSpace
    tolerance: float = Field(default=0.0, ge=0.0)  # build tolerance of the problem [m]
    device: Device = "cpu"  # device of the problem
    # What is minimised, in the order of the trials' values
    objectives: tuple[ObjectiveRecord, ...] = record_objectives(PAPER_OBJECTIVES)
    # The task's, or the one chosen after the first n_init trials; None until then
    reference_point: tuple[Annotated[float, Field(le=2.0 * LARGEST_OBJECTIVE)], ...] | None
    method: Method | FrontMethod
    seed: int  # seed of all random numbers
    evaluator: str | None = None  # name of the custom evaluator; never loaded from here
    versions: dict[str, str]  # versions that the results depend on
    earlier_versions: list[dict[str, str]] = []  # versions of earlier sessions, if they differ

    @cached_property
    def problem(self) -> Problem:
        """Return the problem of the run, on the CPU if its GPU is missing.

        Custom objectives have their names and recorded values; their formulas are not in the run folder.
        """
        objectives = tuple(map(_recorded, self.objectives))
        return Problem(self.task, self.space, self.tolerance, usable_device(self.device), objectives)

    @property
    def study(self) -> Method:
        """The settings of the study; RunFolderError if the run is a direct search."""
        if isinstance(self.method, FrontMethod):
            raise RunFolderError(
                "this run is a direct search, not a study; `armwright design` with a larger --budget continues it"
            )
        return self.method


def _recorded(record: ObjectiveRecord) -> Objective:
    """Return the built-in objective of a record, or one without a formula."""
    known = OBJECTIVES.get(record.name)
    if known is not None and record_objectives((known,)) == (record,):
        return known

    def each(evaluation: Evaluation) -> Array:
        raise RunFolderError(
            f"the run minimised the custom objective {record.name}; its formula is not in the run folder"
        )

    return Objective(record.name, record.unit, record.label.lower(), each, "arm", record.label, record.symbol)


def run_config(problem: Problem, method: Method | FrontMethod, seed: int) -> RunConfig:
    """Return the settings of a new run."""
    return RunConfig(
        task=problem.task,
        space=problem.space,
        tolerance=problem.tolerance,
        device=problem.device,
        objectives=record_objectives(problem.objectives),
        reference_point=problem.reference_point,
        method=method,
        seed=check_integer("seed", seed, 0),
        evaluator=None if problem.evaluator is None else problem.evaluator.name,
        versions=versions(problem.evaluator),
    )


def describe_method(config: RunConfig) -> str:
    """Describe a run's search in a few words; only settings that differ from the defaults are named."""
    method = config.method
    if isinstance(method, FrontMethod):
        return "front search"
    text = "BBO" if method.sampler == "tpe" else f"BBO ({method.sampler})"
    if method.proposer is not None:
        name = str(method.proposer["name"])
        text += "/LLM" if name == "llm" else f"/{name}"
        text += {"plus": "+", "minus": "-", "full": " full"}.get(str(method.proposer.get("prompt", "")), "")
        if model := method.proposer.get("model"):
            text += f" {model}"
        if method.n_step != 10:
            text += f" (N_step {method.n_step})"
    if method.n_total != 200:
        text += f" ({method.n_total} trials)"
    return text


def versions(evaluator: Evaluator | None = None) -> dict[str, str]:
    """Return the versions that results depend on, with a part of the sha256 of an evaluator's file."""
    found = {"python": platform.python_version()}
    if evaluator is not None and evaluator.version:
        found["evaluator"] = evaluator.version
    return found | {package: version for package in PACKAGES if (version := _installed_version(package))}


@cache
def _installed_version(package: str) -> str:
    """Return the version of a package; empty if it is not installed, as that of an extra."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def check_same_run(path: Path, stored: RunConfig, requested: RunConfig) -> None:
    """Raise RunConflictError if `requested` differs from the stored run; a larger n_total is allowed."""
    old, new = _identity(stored), _identity(requested)
    differences = [
        f"{key}: {one_line(str(old.get(key)), SHOWN)} stored, {one_line(str(new.get(key)), SHOWN)} requested"
        for key in {**old, **new}
        if old.get(key) != new.get(key)
    ]
    n_old, n_new = (getattr(config.method, "n_total", 0) for config in (stored, requested))
    if n_new < n_old:
        differences.append(f"n_total: {n_old} stored, {n_new} requested (it can only grow)")
    if differences:
        raise RunConflictError(
            f"{path} holds a run with other settings ({'; '.join(differences)}). "
            "Give another --out DIR, or the same settings"
        )


def _identity(config: RunConfig) -> dict[str, Any]:
    """Return the settings that identify a run, flat."""
    content = config.model_dump(mode="json", exclude=MAY_DIFFER)
    content["objectives"] = [objective["name"] for objective in content["objectives"]]
    method = content.pop("method")
    method.pop("n_total", None)
    if isinstance(method["initial_designs"], dict):
        method["initial_designs"].pop("run", None)  # a path has many spellings; the sha256 identifies its content
    return _flat({**content, **method})


def _flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            flat.update(_flat(cast("dict[str, Any]", value), f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat
