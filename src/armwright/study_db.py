"""study.db: a run as a study of Optuna's, for optuna-dashboard, Optuna's figures, and whoever goes on with it.

study.db      SQLite, made in one step from the finished trials and never read back (`optuna_storage.py`)
artifacts/    the URDF of each design of the front, by the id that study.db has for it
study-1.db    a study.db that somebody changed, as trials or notes of theirs may be in it; kept when a new one is made
"""

import json
import re
import shlex
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any, cast
from uuid import UUID, uuid5

from armwright.exceptions import RunFolderError
from armwright.export.urdf import to_urdf
from armwright.files import replace_file, writable
from armwright.history import FinishedTrial, History
from armwright.llm.words import one_line
from armwright.optuna_storage import StoredStudy, StoredTrial, artifact_ids, as_sqlite, is_untouched, trial_id
from armwright.run_folder import TRIALS, RunConfig, read_config

STUDY_DB = "study.db"
ARTIFACTS = "artifacts"
MOST_AT_END = 10_000  # trials of which the end of a run makes a study.db; `armwright export` makes it of any number
LONGEST_REASON = 300  # characters, in a table
NOTE_PART = 2045  # characters of a note that optuna-dashboard keeps in one attribute
BESIDE = ("-journal", "-wal", "-shm")  # what SQLite keeps beside a file that is being written
IDS = UUID("2f4d9c1e-6a57-4b0c-9c39-6a1f0a4b7d11")  # the names that ids of artifacts are made under
_PUNCTUATION = re.compile(r"([!-/:-@\[-`{-~])")


@dataclass(frozen=True)
class StudyFile:
    """Where a study.db was written, its artifacts, and the one before, which was kept where somebody had changed it."""

    path: Path
    artifacts: Path
    kept: Path | None

    @property
    def command(self) -> str:
        """That shows it in a browser."""
        return shlex.join(
            ["optuna-dashboard", f"sqlite:///{self.path.as_posix()}", "--artifact-dir", self.artifacts.as_posix()]
        )


def write_study(
    run: Path, history: History, summary: Mapping[str, Any] | None, target: Path | None = None
) -> StudyFile:
    """Makes the study.db of a run, in its folder or in the file `target`, with its artifacts beside it.

    summary: of a finished run; it says which designs of the front are solid.

    A crash leaves the old file or the new one.
    """
    target = run / STUDY_DB if target is None else target
    artifacts = target.with_name(ARTIFACTS)
    try:
        study = _RunAsStudy(run, read_config(run), history, _verdicts(history, summary))
        content = as_sqlite(study.stored())
        artifacts.mkdir(parents=True, exist_ok=True)
        files = {_artifact_id(name, urdf): urdf for name, urdf in study.urdfs.values()}
        for id_, urdf in files.items():  # before the file that names them
            replace_file(artifacts / id_, urdf.encode())
        kept = _set_aside(target)
        _remove_artifacts(target, set(files))
        replace_file(target, content)
    except OSError as fault:
        raise RunFolderError(f"cannot write {target}: {fault.strerror or fault}") from fault
    return StudyFile(target, artifacts, kept)


def discard_study(run: Path) -> None:
    """Takes study.db away, as its run goes on; one that somebody changed is kept under another name."""
    target = run / STUDY_DB
    if _set_aside(target) is None:
        _remove_artifacts(target, set())
        target.unlink(missing_ok=True)


def _remove_artifacts(target: Path, needed: set[str]) -> None:
    """Takes away what the study.db that is there names, but for what is needed, by others beside it, too."""
    if target.exists():
        others = [file for file in target.parent.glob(f"*{target.suffix}") if file != target and file.is_file()]
        for id_ in artifact_ids(target).difference(needed, *map(artifact_ids, others)):
            (target.with_name(ARTIFACTS) / id_).unlink(missing_ok=True)


def _set_aside(target: Path) -> Path | None:
    """Renames a file that is there and is not as we wrote it; returns where it is then.

    What SQLite keeps beside it goes first: else it could be taken for a part of the next file of that name.
    """
    beside = [side for side in BESIDE if target.with_name(target.name + side).exists()]
    if not beside and (not target.exists() or is_untouched(target)):
        return None
    kept = next(p for n in count(1) if not (p := target.with_name(f"{target.stem}-{n}{target.suffix}")).exists())
    for side in (*beside, ""):
        with suppress(FileNotFoundError):  # whoever wrote it has just ended
            target.with_name(target.name + side).rename(kept.with_name(kept.name + side))
    return kept if kept.exists() else None


def _verdicts(history: History, summary: Mapping[str, Any] | None) -> dict[int, str]:
    """Whether each design of the front is solid or fragile, where it was verified."""
    if summary is None or summary["n_trials"] != len(history) or summary["verification"] is None:
        return {}
    solid = set(summary["verification"]["solid_numbers"])
    return {member.number: "solid" if member.number in solid else "fragile" for member in history.front}


@dataclass(frozen=True)
class _RunAsStudy:
    """A run in Optuna's words."""

    run: Path
    config: RunConfig
    history: History
    verdicts: Mapping[int, str]

    def stored(self) -> StoredStudy:
        from optuna.distributions import distribution_to_json

        return StoredStudy(
            name=writable(self.run.resolve().name),
            metric_names=[objective.name for objective in self.history.problem.objectives],
            distributions={name: distribution_to_json(each) for name, each in self._distributions.items()},
            trials=self._trials(),
            user=self._attributes(),
            system=self._notes(),
        )

    @cached_property
    def urdfs(self) -> dict[int, tuple[str, str]]:
        """Name and content of the file of each design of the front."""
        task = self.history.problem.task.name
        named = [(member, f"{task}-{member.number}") for member in self.history.front]
        return {member.number: (f"{name}.urdf", to_urdf(member.arm, name)) for member, name in named}

    @cached_property
    def _distributions(self) -> dict[str, Any]:
        from armwright.sampling import distributions  # loads Optuna, which most readers of runs do without

        return distributions(self.history.problem.space)

    def _trials(self) -> Iterator[StoredTrial]:
        """Trials keep how long they took: all are counted back from the moment when the last one was written."""
        space = self.history.problem.space
        names = [f"constraints:{constraint.words}" for constraint in self.history.problem.constraints]
        ended = datetime.fromtimestamp((self.run / TRIALS).stat().st_mtime, UTC).replace(tzinfo=None)
        ended -= sum(map(_duration, self.history), timedelta())
        for trial in self.history:
            started, ended = ended, ended + _duration(trial)
            broken = dict(zip(names, trial.constraints, strict=True))
            yield StoredTrial(
                params={
                    name: self._distributions[name].to_internal_repr(value)
                    for name, value in space.free_values(trial.design).items()
                },
                values=trial.values,
                started=started,
                ended=ended,
                user=self._trial_attributes(trial),
                system={**trial.sampler_notes.get("trial", {}), **broken, **self._artifact(trial.number)},
            )

    def _artifact(self, number: int) -> dict[str, str]:
        """What `optuna.artifacts.upload_artifact` notes on a trial."""
        if number not in self.urdfs:
            return {}
        name, urdf = self.urdfs[number]
        id_ = _artifact_id(name, urdf)
        about = {"artifact_id": id_, "filename": name, "mimetype": "application/xml", "encoding": None}
        return {f"artifacts:{id_}": json.dumps(about)}

    def _trial_attributes(self, trial: FinishedTrial) -> dict[str, Any]:
        """Where a trial comes from and what it is, as far as there is something to say."""
        return _known(
            source=trial.source,
            joints=trial.design.joints,
            verdict=self.verdicts.get(trial.number),
            proposal=trial.proposal,
            reason=one_line(trial.reason, LONGEST_REASON) or None,
            expected=None if trial.expected is None else list(trial.expected),
            fault=trial.fault,
            failure=trial.failure or None,
            refines=trial.refines,
            same_as=trial.same_as,
        )

    def _attributes(self) -> dict[str, Any]:
        config, history = self.config, self.history
        curve, reference_point = history.hypervolume, history.reference_point
        return _known(
            armwright=config.versions.get("armwright"),
            task=config.task.name,
            space=config.space.name,
            seed=config.seed,
            method=config.method.model_dump(mode="json"),
            units={objective.name: objective.unit for objective in history.problem.objectives},
            reference_point=None if reference_point is None else list(reference_point),
            hypervolume=float(curve[-1]) if len(curve) else None,
        )

    def _notes(self) -> dict[str, Any]:
        """What samplers noted on the study; notes of the study and of single trials for optuna-dashboard."""
        noted: dict[str, Any] = {}
        for trial in self.history:
            noted |= {name: _by_id(name, note) for name, note in trial.sampler_notes.get("study", {}).items()}
        noted |= _note("", self._words())
        for trial in self.history:
            words = self._trial_words(trial)
            noted |= _note(f"{trial_id(trial.number)}:", words) if words else {}
        return noted

    def _words(self) -> str:
        """Of the study: its front as a table."""
        objectives, front = self.history.problem.objectives, self.history.front
        heads = ["trial", "joints", *(f"{o.name} [{o.unit}]" for o in objectives), "source", "verdict"]
        rows = [
            [str(m.number), m.design.joints, *(f"{v:.4g}" for v in m.values), m.source, self.verdicts.get(m.number, "")]
            for m in front
        ]
        about = (
            f"A run of armwright on {self.config.task.name}, seed {self.config.seed}: {len(self.history)} designs, "
            f"{len(front)} on the front, each of these with its URDF as an artifact."
        )
        return "\n".join([_plain(about), "", _row(heads), f"|{' --- |' * len(heads)}", *map(_row, rows)])

    def _trial_words(self, trial: FinishedTrial) -> str:
        """Of a trial: what it came to, where it is on the front, and why it was proposed."""
        values = zip(self.history.problem.objectives, trial.values, strict=True)
        reached = ", ".join(f"{o.name} = {value:.4g} {o.unit}".rstrip() for o, value in values)
        verdict = self.verdicts.get(trial.number)
        words = [
            f"On the front{f', {verdict}' if verdict else ''}: {reached}." if trial.number in self.urdfs else "",
            f"Why {trial.source} proposed it: {trial.reason}" if trial.reason else "",
        ]
        return "\n\n".join(_plain(part) for part in words if part)


def _by_id(name: str, note: Any) -> Any:
    """A sampler's note for this file: who the parents of a generation are, genetic samplers note by the trials' ids.

    In the memory that a study runs in, these are the numbers.
    """
    return list(map(trial_id, cast("list[int]", note))) if ":parent:" in name else note


def _duration(trial: FinishedTrial) -> timedelta:
    return timedelta(seconds=trial.seconds.get("total", 0.0))


def _known(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _artifact_id(name: str, content: str) -> str:
    """Follows from the file, so that the same one is written again as it was."""
    return str(uuid5(IDS, f"{name}\n{content}"))


def _note(of: str, words: str) -> dict[str, Any]:
    """As `optuna_dashboard.save_note` keeps it: its version, and the text in parts."""
    parts = [words[at : at + NOTE_PART] for at in range(0, len(words), NOTE_PART)]
    kept = {f"dashboard:{of}note_str:{place}": part for place, part in enumerate(parts)}
    return {f"dashboard:{of}note_ver": 1, **kept}


def _row(cells: list[str]) -> str:
    """Of a Markdown table."""
    return f"| {' | '.join(map(_plain, cells))} |"


def _plain(text: str) -> str:
    """Text that Markdown shows as it is; a model's words are no markup."""
    return _PUNCTUATION.sub(r"\\\1", text)
