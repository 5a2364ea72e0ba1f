"""The run folder: a run's settings and finished trials on disk, written, read and checked here.

    config.yaml        everything needed to repeat the run
    trials.jsonl       one line a finished trial, written before the next begins: the truth
    transcripts.jsonl  every call to a language model (llm/transcript.py)
    control.json, status.json  between a running study and whoever watches it (control.py)
    search.npz, proposals/  where a search for the whole front stands, and what it began with (front.py)
    trials.csv, front.csv, summary.json, designs/NNNN/ (results.py), and figures/ (report/figures.py)

What stands in the last lines is made from the finished trials, and can be made again.
"""

import errno
import json
import os
import platform
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Literal, Self, cast

import yaml
from filelock import FileLock, Timeout
from pydantic import BaseModel, Field, ValidationError, field_validator

from armwright.arrays import Array
from armwright.control import CHANNEL_FILES
from armwright.documents import parse_document
from armwright.evaluation import Evaluation
from armwright.exceptions import DesignError, RunConflictError, RunFolderError
from armwright.files import replace_file, writable
from armwright.history import FinishedTrial, History
from armwright.kinematics.devices import Device, usable_device
from armwright.measuring import Evaluator
from armwright.objectives import OBJECTIVES, PAPER_OBJECTIVES, Objective
from armwright.problem import Problem
from armwright.space import DesignSpace
from armwright.task import Task

LOCK = ".lock"  # held by whoever writes; the system lets go of a dead process's, and the file stays
LOCK_SECONDS = 2.0  # that a command waits for it: the workers of a killed experiment take a moment to end
CONFIG = "config.yaml"
TRIALS = "trials.jsonl"
PROPOSALS = "proposals"
SEARCH = "search.npz"
BEFORE_TRIALS = {
    LOCK, CONFIG, f"{CONFIG}.part", TRIALS, "transcripts.jsonl", *CHANNEL_FILES, f"{SEARCH}.part", PROPOSALS,
}  # fmt: skip
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
    polish_every: after so many counted trials the next free one refines a design of the front; None: never.
    start: designs that the first of the n_init trials are, in place of random ones.
    """

    proposer: dict[str, Any] | None
    sampler: str
    n_init: int = Field(ge=1)
    n_step: int = Field(ge=1)
    n_total: int = Field(ge=1)
    in_flight: int | None = Field(default=None, ge=1)
    polish_every: int | None = Field(default=None, ge=1)
    start: tuple[dict[str, float | str], ...] = ()

    @field_validator("proposer")
    @classmethod
    def _check_proposer(cls, settings: dict[str, Any] | None) -> dict[str, Any] | None:
        """That what is asked again can be asked as before."""
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
        """Of the whole study, the random ones included."""
        return self.n_init + self.n_total


class FrontMethod(BaseModel, frozen=True, extra="forbid"):
    """How a search for the whole front searches (front.py): there is nothing to choose but what it begins with."""

    search: Literal["front"] = "front"
    begin_with: dict[str, Any] | None = None

    @property
    def n_init(self) -> int:
        """Its trials are the front alone."""
        return 0


class WorkersRecord(BaseModel, frozen=True, extra="forbid"):
    """Where the designs of a study wait for workers (`armwright worker`).

    storage: the URL of the database that search and workers share, without its password.
    study: the name of Optuna's study there.
    at_a_time: designs under way at most.
    heartbeat: [s] between two signs of life of a worker; it counts as dead after some without.
    """

    storage: str
    study: str
    at_a_time: int = Field(ge=1, le=10_000)
    heartbeat: int = Field(default=10, ge=1, le=3600)


class ObjectiveRecord(BaseModel, frozen=True, extra="forbid"):
    """An objective as a run's settings tell of it; its formula is code."""

    name: str
    label: str
    unit: str
    symbol: str


def record_objectives(objectives: Sequence[Objective]) -> tuple[ObjectiveRecord, ...]:
    """What a run's settings tell of its objectives."""
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
    workers: WorkersRecord | None = None
    versions: dict[str, str]
    earlier_versions: list[dict[str, str]] = []  # of sessions that made earlier trials, where they were others

    @property
    def problem(self) -> Problem:
        """The problem of the run; on the CPU, where its GPU is not here.

        Objectives of one's own have their names and values here; to compute them again needs the problem itself.
        """
        return self.problem_with(None)

    def problem_with(self, evaluator: Evaluator | None) -> Problem:
        """The problem of the run with the evaluator that measures its designs."""
        own = {} if evaluator is None else {objective.name: objective for objective in evaluator.objectives}
        objectives = tuple(own.get(record.name) or _recorded(record) for record in self.objectives)
        return Problem(self.task, self.space, self.tolerance, usable_device(self.device), objectives, evaluator)

    @property
    def study(self) -> Method:
        """How its study searches; RunFolderError where it is a search for the whole front."""
        if isinstance(self.method, FrontMethod):
            raise RunFolderError(
                "this run is a search for the whole front, not a study: its front needs no polish, and "
                "`armwright front` with a larger --budget goes on with it"
            )
        return self.method


def _recorded(record: ObjectiveRecord) -> Objective:
    """The objective of a record: ours by its name; of one that is none of ours, only what was written down."""
    known = OBJECTIVES.get(record.name)
    if known is not None and record_objectives((known,)) == (record,):
        return known

    def each(evaluation: Evaluation) -> Array:
        raise RunFolderError(
            f"the run minimised an objective of its own, {record.name}; its formula is not in the run folder"
        )

    words = record.label.lower()
    return Objective(record.name, record.label, record.unit, record.symbol, words=words, each=each, over="arm")


def versions(evaluator: Evaluator | None = None) -> dict[str, str]:
    """The versions that the numbers of a run depend on; of an evaluator's file, a part of its sha256."""
    found = {"python": platform.python_version()}
    if evaluator is not None and evaluator.version:
        found["evaluator"] = evaluator.version
    for package in PACKAGES:
        with suppress(metadata.PackageNotFoundError):  # an extra
            found[package] = metadata.version(package)
    return found


class RunFolder:
    """A run folder held for writing by this process alone; a context manager."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = FileLock(path / LOCK)
        self._place: os.stat_result | None = None
        self._trials: BinaryIO | None = None
        self._is_new = False

    def __enter__(self) -> Self:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=LOCK_SECONDS)
            self._place = self.path.stat()
        except Timeout as fault:
            raise RunFolderError(
                f"{self.path} is in use by another armwright process; wait for it, or give another --out DIR"
            ) from fault
        except OSError as fault:
            raise _write_error(Path(fault.filename or self.path), fault) from fault
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._trials is not None:
            self._trials.close()
            self._trials = None
        self._lock.release()

    def adopt(self, config: RunConfig) -> RunConfig:
        """The folder's configuration: `config` for a folder without trials, or for one whose run it extends.

        RunConflictError with the differences where the folder holds a run with other settings.
        """
        if not self._holds_run():
            self._check_free()
            self.write_config(config)
            self._is_new = True
            return config
        there = read_config(self.path)
        check_same_run(self.path, there, config)
        if config.workers is not None and there.workers is not None and config.workers != there.workers:
            workers = config.workers.model_copy(update={"study": there.workers.study})  # where its designs lie
            there = there.model_copy(update={"workers": workers})
            self.write_config(there)
        if config.method != there.method:  # a larger n_total
            if self._n_trials() > there.study.n_trials:
                raise RunConflictError(
                    f"{self.path} was polished, so its study cannot go on; give another --out DIR, or polish it again"
                )
            there = there.model_copy(update={"method": config.method})
            self.write_config(there)
        return there

    def forget(self) -> None:
        """Takes the settings of a run away that could not begin; those of an earlier session stay."""
        if self._is_new:
            (self.path / CONFIG).unlink(missing_ok=True)

    def note_versions(self, config: RunConfig, evaluator: Evaluator | None = None) -> RunConfig:
        """The configuration of a run that goes on: where the versions are others now, those before are noted."""
        now = versions(evaluator)
        if config.versions != now:
            earlier = [*config.earlier_versions, config.versions]
            config = config.model_copy(update={"versions": now, "earlier_versions": earlier})
            self.write_config(config)
        return config

    def _holds_run(self) -> bool:
        """Whether a run lies here that came to a trial, or a first state of its search, or whose workers may have."""
        if (self.path / SEARCH).exists() or self._n_trials():
            return True
        return (self.path / CONFIG).is_file() and read_config(self.path).workers is not None

    def _n_trials(self) -> int:
        trials = self.path / TRIALS
        return trials.read_bytes().count(b"\n") if trials.is_file() else 0

    def _check_free(self) -> None:
        """RunConflictError where the folder holds anything but what a run without trials leaves."""
        others = sorted({entry.name for entry in self.path.iterdir()} - BEFORE_TRIALS)
        if (self.path / CONFIG).exists():
            read_config(self.path)
            if others:
                raise RunConflictError(
                    f"{self.path} holds results of a run ({others[0]}, …), but no trial in {TRIALS}; "
                    "put that file back, or give another --out DIR"
                )
        elif others:
            raise RunConflictError(
                f"{self.path} holds no run, but other files ({others[0]}, …); give another --out DIR"
            )

    def write_config(self, config: RunConfig) -> None:
        """Replaces config.yaml in one step."""
        content = config.model_dump(mode="json")
        self.write_text(CONFIG, yaml.dump(content, Dumper=_ConfigDumper, sort_keys=False, allow_unicode=True))

    def open_trials(
        self, space: DesignSpace, n_objectives: int = len(PAPER_OBJECTIVES), n_constraints: int = 0
    ) -> list[FinishedTrial]:
        """The finished trials; a last line that a crash cut short is dropped. Opens the file for `append`."""
        path = self.path / TRIALS
        trials, intact = _read_trials(path, space, n_objectives, n_constraints)
        try:
            self._trials = cast("BinaryIO", open(path, "ab", buffering=0))  # noqa: SIM115 (closed in __exit__)
            if intact < self._trials.tell():  # else the file keeps its time
                self._trials.truncate(intact)
        except OSError as fault:
            raise _write_error(path, fault) from fault
        return trials

    def append(self, trial: FinishedTrial) -> None:
        """Writes one finished trial: a single write, so that a crash leaves a whole line or a cut last one."""
        assert self._trials is not None, "open_trials comes first"
        self._check_here()
        line = _trial_line(trial)
        try:
            if os.fstat(self._trials.fileno()).st_nlink == 0:
                raise OSError(errno.ENOENT, "the file was deleted while the run went on")
            written = self._trials.write(line)
            if written != len(line):
                raise OSError(errno.ENOSPC, "No space left on device")
        except OSError as fault:
            raise _write_error(self.path / TRIALS, fault) from fault

    def _check_here(self) -> None:
        """RunFolderError where the folder is another than the one that is held: nothing is written beside its run."""
        try:
            is_here = self._place is not None and os.path.samestat(self._place, self.path.stat())
        except FileNotFoundError:
            is_here = False
        except OSError as fault:
            raise _write_error(self.path, fault) from fault
        if not is_here:
            raise RunFolderError(
                f"{self.path} was moved or deleted while the run went on; move it back, and the same command goes on "
                "from its last finished trial"
            )

    def replace_trials(self, trials: Iterable[FinishedTrial]) -> None:
        """Writes all trials anew."""
        self.write_bytes(TRIALS, b"".join(map(_trial_line, trials)))

    def write_text(self, name: str, text: str) -> None:
        """Replaces a file in one step, so that a crash leaves the old or the new one."""
        self.write_bytes(name, text.encode())

    def write_bytes(self, name: str, content: bytes) -> None:
        """The same for a file that is no text."""
        target = self.path / name
        self._check_here()
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            replace_file(target, content)
        except OSError as fault:
            raise _write_error(target, fault) from fault


def is_held(folder: Path) -> bool:
    """Whether a process holds a run folder for writing, here or, where the file system knows, on another machine."""
    if sys.platform == "win32":  # no looking without holding it oneself
        return True
    import fcntl

    try:
        lock = os.open(folder / LOCK, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)  # and with it what was taken
    return False


class _ConfigDumper(yaml.SafeDumper):
    """YAML without aliases, points on one line."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        plain = all(not isinstance(item, (dict, list)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain)


_ConfigDumper.add_representer(list, _ConfigDumper.represent_list)


def read_config(path: Path) -> RunConfig:
    """The configuration of a run folder."""
    file = path / CONFIG
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as fault:
        raise RunFolderError(
            f"{path} is not a run folder: cannot read {CONFIG} ({fault}); restore it, or give another folder"
        ) from fault
    try:
        return parse_document(text, RunConfig, RunFolderError, str(file))
    except RunFolderError as fault:
        raise RunFolderError(f"{fault}{_writer(text)}; restore the file, or give another --out DIR") from fault


def _writer(config: str) -> str:
    """Which armwright wrote a config.yaml that cannot be read, where it was another."""
    said, ours = re.search(r"^  armwright: '?([^'\s]+)", config, re.MULTILINE), versions().get("armwright")
    return f" (written by armwright {said[1]}; this is {ours})" if said and said[1] != ours else ""


def read_run(path: str | Path) -> tuple[RunConfig, History]:
    """The configuration and the finished trials of a run folder, for readers; nothing is changed."""
    path = Path(path)
    config = read_config(path)
    trials, _ = _read_trials(path / TRIALS, config.space, len(config.objectives), len(config.task.constraints))
    return config, History(config.problem, trials, config.method.n_init, config.reference_point)


class _BegunRecord(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False, strict=True):
    """A trial that is to be evaluated."""

    number: int
    source: str
    proposal: str | None
    reason: str = ""
    expected: list[float] | None = None
    fault: str | None = None
    asked: int | None = None
    feedback: int | None = None
    refines: int | None = None
    evaluations: int = Field(default=1, ge=0)
    same_as: int | None = None
    params: dict[str, float | str]


class _TrialRecord(_BegunRecord, frozen=True):
    """One line of trials.jsonl."""

    values: list[float] = Field(min_length=1)
    constraints: list[float] = []
    failure: str = ""
    seconds: dict[str, float]
    sampler_notes: dict[str, dict[str, Any]] = {}


def begun_record(trial: FinishedTrial) -> dict[str, Any]:
    """A trial that has no values yet, for `read_begun` in another process."""
    return _BegunRecord(**_begun_fields(trial)).model_dump(exclude_defaults=True)


def read_begun(record: Any, space: DesignSpace) -> FinishedTrial:
    """The trial of a record; RunFolderError where it is none of this space."""
    try:
        return _begun_trial(_BegunRecord.model_validate(record), space)
    except (ValueError, DesignError) as fault:
        raise RunFolderError(f"a trial that was posted for workers is damaged: {_words(fault)}") from fault


def _begun_fields(trial: FinishedTrial) -> dict[str, Any]:
    return {
        "number": trial.number,
        "source": trial.source,
        "proposal": trial.proposal,
        "reason": writable(trial.reason),
        "expected": None if trial.expected is None else list(trial.expected),
        "fault": trial.fault,
        "asked": trial.asked,
        "feedback": trial.feedback,
        "refines": trial.refines,
        "evaluations": trial.evaluations,
        "same_as": trial.same_as,
        "params": dict(trial.design.params),
    }


def _trial_line(trial: FinishedTrial) -> bytes:
    record = _TrialRecord(
        **_begun_fields(trial),
        values=list(trial.values),
        constraints=list(trial.constraints),
        failure=writable(trial.failure),
        seconds=dict(trial.seconds),
        sampler_notes={place: dict(noted) for place, noted in trial.sampler_notes.items()},
    )
    return json.dumps(record.model_dump(exclude_defaults=True)).encode() + b"\n"


def _read_trials(
    path: Path, space: DesignSpace, n_objectives: int, n_constraints: int
) -> tuple[list[FinishedTrial], int]:
    """The trials of a file, and its length [bytes] without a cut last line."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return [], 0
    except OSError as fault:
        raise RunFolderError(f"cannot read {path}: {fault.strerror or fault}") from fault
    return _parse_trials(content, 0, path, space, n_objectives, n_constraints)


def _parse_trials(
    content: bytes, first: int, path: Path, space: DesignSpace, n_objectives: int, n_constraints: int
) -> tuple[list[FinishedTrial], int]:
    """The trials from number `first` on in a part of a file, and its length [bytes] without a cut last line."""
    end = content.rfind(b"\n") + 1
    trials: list[FinishedTrial] = []
    for number, line in enumerate(content[:end].split(b"\n")[:-1], start=first):
        try:
            trials.append(_parse_trial(line, number, space, n_objectives, n_constraints))
        except (ValueError, DesignError) as fault:
            raise RunFolderError(
                f"{path}, line {number + 1} is damaged ({_words(fault)}); restore the file, or delete this line and "
                "all after it: the same command then goes on from there"
            ) from fault
    return trials, end


class TrialsReader:
    """Reads the finished trials of a run that may go on elsewhere; a line that was read is not read again."""

    def __init__(self, folder: Path, config: RunConfig) -> None:
        self._path = folder / TRIALS
        self._config = config
        self.trials: list[FinishedTrial] = []
        self._at = 0  # [bytes] read
        self._file = 0  # which file it was

    def read_on(self) -> bool:
        """Reads what has come; whether it is another file than before (the run was polished), read from its start."""
        try:
            with self._path.open("rb") as file:
                there = os.fstat(file.fileno())
                is_other = there.st_ino != self._file or there.st_size < self._at
                file.seek(0 if is_other else self._at)
                content = file.read()
        except FileNotFoundError:
            there, is_other, content = None, bool(self.trials), b""
        except OSError as fault:
            raise RunFolderError(f"cannot read {self._path}: {fault.strerror or fault}") from fault
        if is_other:
            self.trials, self._at = [], 0
            self._file = 0 if there is None else there.st_ino
        try:
            new, length = self._parsed(content)
        except RunFolderError:
            if self._at == 0:
                raise
            self.trials, self._at = [], 0  # written anew in place, perhaps, and longer than what was read
            is_other = True
            new, length = self._parsed(self._path.read_bytes())
        self.trials = [*self.trials, *new]
        self._at += length
        return is_other

    def _parsed(self, content: bytes) -> tuple[list[FinishedTrial], int]:
        config = self._config
        n_objectives, n_constraints = len(config.objectives), len(config.task.constraints)
        return _parse_trials(content, len(self.trials), self._path, config.space, n_objectives, n_constraints)


def _parse_trial(line: bytes, number: int, space: DesignSpace, n_objectives: int, n_constraints: int) -> FinishedTrial:
    record = _TrialRecord.model_validate_json(line)
    if len(record.values) != n_objectives:
        raise ValueError(f"{len(record.values)} values where {n_objectives} are due")
    if len(record.constraints) != n_constraints:
        raise ValueError(f"{len(record.constraints)} constraints where {n_constraints} are due")
    if record.number != number:
        raise ValueError(f"number {record.number} where {number} is due")
    return replace(
        _begun_trial(record, space),
        values=tuple(record.values),
        constraints=tuple(record.constraints),
        failure=record.failure,
        seconds=record.seconds,
        sampler_notes=record.sampler_notes,
    )


def _begun_trial(record: _BegunRecord, space: DesignSpace) -> FinishedTrial:
    return FinishedTrial(
        number=record.number,
        source=record.source,
        design=space.design(record.params),
        values=(),
        proposal=record.proposal,
        reason=record.reason,
        expected=None if record.expected is None else tuple(record.expected),
        fault=record.fault,
        asked=record.asked,
        feedback=record.feedback,
        refines=record.refines,
        evaluations=record.evaluations,
        same_as=record.same_as,
    )


def _words(fault: Exception) -> str:
    if not isinstance(fault, ValidationError):
        return str(fault)
    first = fault.errors(include_url=False, include_context=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}".removeprefix(": ")


def check_same_run(path: Path, there: RunConfig, asked: RunConfig) -> None:
    """RunConflictError where `asked` is another run than the one that lies there; a larger n_total is the same."""
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
    """A setting on one line; a prompt of the user's own is a whole page."""
    text = " ".join(str(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _identity(config: RunConfig) -> dict[str, Any]:
    """What makes a run this run and no other, flat."""
    content = config.model_dump(mode="json")
    content["task"] = {key: content["task"][key] for key in IDENTITY}
    content["objectives"] = [objective["name"] for objective in content["objectives"]]
    content["workers"] = None if content["workers"] is None else "evaluate"  # how many, and where, may change
    method = content.pop("method")
    method.pop("n_total", None)
    if method.get("begin_with"):
        method["begin_with"].pop("run", None)  # a path has many spellings; what lay there is known by its sha256
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


def _write_error(path: Path, fault: OSError) -> RunFolderError:
    return RunFolderError(
        f"cannot write {path}: {fault.strerror or fault}. What was written before is safe; "
        "free room or give another --out DIR, and run the same command again"
    )
