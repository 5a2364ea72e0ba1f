"""The settings of a run: everything needed to repeat it, as config.yaml holds it."""

import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, cast

from pydantic import BaseModel, Field, field_validator

from armwright.arrays import Array
from armwright.exceptions import RunConflictError, RunFolderError
from armwright.kinematics.devices import Device, usable_device
from armwright.problem.evaluation import Evaluation
from armwright.problem.evaluators import Evaluator
from armwright.problem.objective import Objective
from armwright.problem.objectives import OBJECTIVES, PAPER_OBJECTIVES
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task

# Of a task; its words may change.
IDENTITY = (
    "name", "targets", "payload", "payload_factors", "target_noise", "restarts", "obstacles", "moves", "move_step",
    "move_time", "workspace", "constraints", "reference_point",
)  # fmt: skip
PACKAGES = ("armwright", "moocore", "numpy", "optuna", "warp-lang", "pydantic-ai-slim", "scipy", "torch")


class Method(BaseModel, frozen=True, extra="forbid"):
    """How a study searches.

    proposer: its name and settings; None for black-box trials only.
    in_flight: how many questions go on while black-box trials run; None: the study waits for each.
    refine_every: after so many counted trials the next free one refines a design of the front; None: never.
    initial_designs: that the first of the n_init trials are, in place of random ones.
    """

    proposer: dict[str, Any] | None
    sampler: str
    n_init: int = Field(ge=1)
    n_step: int = Field(ge=1)
    n_total: int = Field(ge=1)
    in_flight: int | None = Field(default=None, ge=1)
    refine_every: int | None = Field(default=None, ge=1)
    initial_designs: tuple[dict[str, float | str], ...] = ()

    @field_validator("proposer")
    @classmethod
    def _check_proposer(cls, settings: dict[str, Any] | None) -> dict[str, Any] | None:
        """Check the settings that a resumed run asks its proposer with."""
        kinds = {"name": str} | ({"prompt": str} if settings and "prompt" in settings else {})
        if "prompt" in kinds:
            kinds |= {"memory": str, "answer": str, "proposals": int}
        kinds |= {"template": str} if settings and "template" in settings else {}
        for key, kind in kinds.items():
            if settings is not None and not isinstance(settings.get(key), kind):
                raise ValueError(f"{key} = {settings.get(key)!r} is no {kind.__name__}")
        return settings

    @property
    def n_trials(self) -> int:
        """The number of trials of the whole study, the random ones included."""
        return self.n_init + self.n_total

    @property
    def n_proposals(self) -> int:
        """The number of proposals in the whole study: one in each block of n_step trials."""
        return -(-self.n_total // self.n_step)

    def first_trial(self, block: int) -> int:
        """Return the number of the first trial of a block."""
        return self.n_init + block * self.n_step

    def n_started(self, number: int) -> int:
        """Return how many blocks have started when trial `number` starts, its own included."""
        return max(0, (number - self.n_init) // self.n_step + 1)

    def is_first_trial(self, number: int) -> bool:
        """Return whether trial `number` is the first of a block."""
        return number >= self.n_init and (number - self.n_init) % self.n_step == 0


class FrontMethod(BaseModel, frozen=True, extra="forbid"):
    """The settings of a direct search (study/front_run.py): its initial designs."""

    search: Literal["front_search"] = "front_search"
    initial_designs: dict[str, Any] | None = None

    @property
    def n_init(self) -> int:
        """Its trials are the front alone."""
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
    """Everything needed to repeat a run.

    tolerance, device: `Problem`'s.
    objectives: what is minimised, in the order of the trials' values.
    reference_point: as the task states it, or as frozen after the first n_init trials (None until then).
    """

    task: Task
    space: DesignSpace
    tolerance: float = Field(default=0.0, ge=0.0)
    device: Device = "cpu"
    objectives: tuple[ObjectiveRecord, ...] = record_objectives(PAPER_OBJECTIVES)
    reference_point: tuple[float, ...] | None
    method: Method | FrontMethod
    seed: int
    evaluator: str | None = None  # of one's own that measured designs in place of ours, by name; never loaded from here
    versions: dict[str, str]
    earlier_versions: list[dict[str, str]] = []  # of sessions that made earlier trials, where they were others

    @property
    def problem(self) -> Problem:
        """The problem of the run; on the CPU, where its GPU is not here.

        Objectives of one's own have their names and values here; to compute them again needs the problem itself.
        """
        return self.problem_with(None)

    def problem_with(self, evaluator: Evaluator | None) -> Problem:
        """Return the problem of the run with the evaluator that measures its designs."""
        own = {} if evaluator is None else {objective.name: objective for objective in evaluator.objectives}
        objectives = tuple(own.get(record.name) or _recorded(record) for record in self.objectives)
        return Problem(self.task, self.space, self.tolerance, usable_device(self.device), objectives, evaluator)

    @property
    def study(self) -> Method:
        """The settings of its study; RunFolderError if it is a search for the whole front."""
        if isinstance(self.method, FrontMethod):
            raise RunFolderError(
                "this run is a search for the whole front, not a study: its front needs no refinement, and "
                "`armwright design` with a larger --budget continues it"
            )
        return self.method


def _recorded(record: ObjectiveRecord) -> Objective:
    """Return the built-in objective of a record, or one without a formula."""
    known = OBJECTIVES.get(record.name)
    if known is not None and record_objectives((known,)) == (record,):
        return known

    def each(evaluation: Evaluation) -> Array:
        raise RunFolderError(
            f"the run minimised an objective of its own, {record.name}; its formula is not in the run folder"
        )

    return Objective(record.name, record.unit, record.label.lower(), each, "arm", record.label, record.symbol)


def versions(evaluator: Evaluator | None = None) -> dict[str, str]:
    """Return the versions that results depend on, with a part of the sha256 of an evaluator's file."""
    found = {"python": platform.python_version()}
    if evaluator is not None and evaluator.version:
        found["evaluator"] = evaluator.version
    for package in PACKAGES:
        with suppress(metadata.PackageNotFoundError):  # an extra
            found[package] = metadata.version(package)
    return found


def check_same_run(path: Path, there: RunConfig, asked: RunConfig) -> None:
    """Raise RunConflictError if `asked` differs from the existing run; a larger n_total is allowed."""
    old, new = _identity(there), _identity(asked)
    differences = [
        f"{key}: {_brief(old.get(key))} there, {_brief(new.get(key))} asked"
        for key in {**old, **new}
        if old.get(key) != new.get(key)
    ]
    n_there, n_asked = (getattr(config.method, "n_total", 0) for config in (there, asked))
    if n_asked < n_there:
        differences.append(f"n_total: {n_there} there, {n_asked} asked (it can only grow)")
    if differences:
        raise RunConflictError(
            f"{path} holds a run with other settings ({'; '.join(differences)}). "
            "Give another --out DIR, or the same settings"
        )


def _brief(value: Any) -> str:
    """Return a setting on one short line; custom prompts fill a page."""
    text = " ".join(str(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _identity(config: RunConfig) -> dict[str, Any]:
    """Return the settings that identify a run, flat."""
    content = config.model_dump(mode="json")
    content["task"] = {key: content["task"][key] for key in IDENTITY}
    content["objectives"] = [objective["name"] for objective in content["objectives"]]
    method = content.pop("method")
    method.pop("n_total", None)
    if isinstance(method["initial_designs"], dict):
        method["initial_designs"].pop("run", None)  # a path has many spellings; its content is known by its sha256
    for key in ("versions", "earlier_versions", "reference_point"):
        del content[key]
    return _flat({**content, **method})


def _flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in content.items():
        if isinstance(value, dict):
            flat.update(_flat(cast("dict[str, Any]", value), f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat
