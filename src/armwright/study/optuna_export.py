"""Export a run as an Optuna study, for optuna-dashboard, Optuna's figures, and a search that continues there.

study.db      SQLite database of Optuna's own storage, with one study
artifacts/    the URDF of each design of the front, an artifact of its trial
"""

import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from warnings import catch_warnings, simplefilter

import optuna
from optuna.artifacts import FileSystemArtifactStore, upload_artifact
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.storages import RDBStorage
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState, create_trial

from armwright.exceptions import RunFolderError, SettingsError
from armwright.files import replace_file, replace_surrogates
from armwright.proof.results import read_summary
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.config import RunConfig
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.runs.trials_file import TRIALS
from armwright.spaces.optuna_distributions import distributions, quietly

STUDY_DB = "study.db"
ARTIFACTS = "artifacts"
NOTE = "dashboard:note_str:0"  # where optuna-dashboard keeps the note of a study
NOTE_VERSION = "dashboard:note_ver"
TRIAL_ATTRIBUTES = ("source", "proposal", "reason", "fault", "duplicate_of")


@dataclass(frozen=True)
class ExportedStudy:
    """The files of an exported study."""

    database: Path
    artifacts: Path

    @property
    def dashboard_command(self) -> str:
        """The command that shows the study in a browser."""
        database = f"sqlite:///{self.database.as_posix()}"
        return shlex.join(["optuna-dashboard", database, "--artifact-dir", self.artifacts.as_posix()])


def export_study(run: Path, target: Path | None = None) -> ExportedStudy:
    """Export all finished trials of a run as an Optuna study in a new database.

    Args:
        run: Folder of a finished, stopped or ongoing run.
        target: Database file; `study.db` in the run folder if None. The artifacts are stored beside it.

    Returns:
        The files written.

    Raises:
        RunFolderError: The database exists, as it may hold notes and trials of its owner, or it cannot be written.
        SettingsError: The run has no finished trial.
    """
    config, history = read_run(run)
    if not len(history):
        raise SettingsError(f"{run} has no finished trial yet")
    files = ExportedStudy(target or run / STUDY_DB, (target or run / STUDY_DB).with_name(ARTIFACTS))
    if files.database.exists():
        raise RunFolderError(
            f"{files.database} exists, and may hold notes or trials of yours; move it away, or give another --out FILE"
        )
    try:
        files.artifacts.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory() as folder:
            _Export(run, config, history, Path(folder), FileSystemArtifactStore(files.artifacts)).write()
            replace_file(files.database, (Path(folder) / STUDY_DB).read_bytes())
    except (OSError, StorageInternalError) as error:
        raise RunFolderError(f"cannot write {files.database}: {getattr(error, 'strerror', None) or error}") from error
    return files


@dataclass(frozen=True)
class _Export:
    """One export.

    folder: An empty folder, in which the database is built.
    """

    run: Path
    config: RunConfig
    history: History
    folder: Path
    store: FileSystemArtifactStore

    def write(self) -> None:
        """Build the database."""
        storage = RDBStorage(f"sqlite:///{(self.folder / STUDY_DB).as_posix()}")
        try:
            study = self._new_study(storage)
            verdicts = self._verdicts()
            study.add_trials(self._trials(verdicts))
            study_id = storage.get_study_id_from_name(study.study_name)
            notes = self._sampler_notes(storage, study_id) | {NOTE: self._note(verdicts), NOTE_VERSION: 1}
            for key, value in notes.items():
                storage.set_study_system_attr(study_id, key, value)
        finally:
            storage.engine.dispose()

    def _new_study(self, storage: RDBStorage) -> optuna.Study:
        name = replace_surrogates(self.run.resolve().name)
        objectives = self.history.problem.objectives
        with quietly(), catch_warnings():
            simplefilter("ignore", ExperimentalWarning)  # metric names
            directions = [StudyDirection.MINIMIZE] * len(objectives)
            study = optuna.create_study(storage=storage, study_name=name, directions=directions)
            study.set_metric_names([objective.name for objective in objectives])
        for key, value in self._study_attributes().items():
            if value is not None:
                study.set_user_attr(key, value)
        return study

    def _study_attributes(self) -> dict[str, Any]:
        config, history = self.config, self.history
        return {
            "armwright": config.versions.get("armwright"),
            "task": config.task.name,
            "space": config.space.name,
            "seed": config.seed,
            "method": config.method.model_dump(mode="json"),
            "units": {objective.name: objective.unit for objective in history.problem.objectives},
            "reference_point": history.reference_point,
            "hypervolume": float(history.hypervolume[-1]) if len(history.hypervolume) else None,
        }

    def _verdicts(self) -> dict[int, str]:
        """Return "robust" or "sensitive" by trial number, for a front that was verified."""
        summary = read_summary(self.run)
        if summary is None or summary["n_trials"] != len(self.history) or summary["verification"] is None:
            return {}
        robust = set(summary["verification"]["robust_numbers"])
        return {member.number: "robust" if member.number in robust else "sensitive" for member in self.history.front}

    def _trials(self, verdicts: Mapping[int, str]) -> Iterator[FrozenTrial]:
        """Yield the trials of the study.

        A run records durations only: the times are counted back from the last write of its trials.
        """
        problem, artifacts = self.history.problem, self._artifacts()
        every = distributions(problem.space)
        names = [constraint.description for constraint in problem.constraints]
        durations = [timedelta(seconds=trial.seconds.get("total", 0.0)) for trial in self.history]
        time = datetime.fromtimestamp((self.run / TRIALS).stat().st_mtime) - sum(durations, timedelta())
        for trial, duration in zip(self.history, durations, strict=True):
            params = problem.space.free_values(trial.design)
            attributes = {name: getattr(trial, name) for name in TRIAL_ATTRIBUTES}
            failure = trial.failure
            attributes["failure"] = None if failure is None else f"{failure.kind}: {failure.description}"
            attributes |= {"joints": trial.design.joints, "verdict": verdicts.get(trial.number)}
            exported = create_trial(
                params=params,
                distributions={name: every[name] for name in params},
                state=TrialState.COMPLETE if failure is None else TrialState.FAIL,
                values=trial.values if failure is None else None,
                constraints=dict(zip(names, trial.violations, strict=True)),
                user_attrs={name: value for name, value in attributes.items() if value not in (None, "")},
                system_attrs={**trial.sampler_notes.get("trial", {}), **artifacts.get(trial.number, {})},
            )
            exported.datetime_start = time
            time += duration
            exported.datetime_complete = time
            yield exported

    def _artifacts(self) -> dict[int, dict[str, Any]]:
        """Store the URDF of each design of the front, and return by trial number the attributes that refer to it.

        A finished trial takes no artifacts. The files are uploaded to running trials of a scratch study instead.
        """
        with quietly():
            scratch = optuna.create_study()
        attributes: dict[int, dict[str, Any]] = {}
        for member in self.history.front:
            name = f"{self.history.problem.task.name}-{member.number}"
            file = self.folder / f"{name}.urdf"
            file.write_text(to_urdf(member.arm, name), encoding="utf-8", newline="\n")
            trial = scratch.ask()
            upload_artifact(
                artifact_store=self.store, file_path=str(file), study_or_trial=trial, mimetype="application/xml"
            )
            attributes[member.number] = scratch.get_trials(deepcopy=False)[trial.number].system_attrs
        return attributes

    def _sampler_notes(self, storage: RDBStorage, study_id: int) -> dict[str, Any]:
        """Return the notes of samplers on the study, with the ids of this storage for parents."""
        notes: dict[str, Any] = {}
        for trial in self.history:
            notes |= trial.sampler_notes.get("study", {})
        for key in (key for key in notes if ":parent:" in key):
            notes[key] = [storage.get_trial_id_from_study_id_trial_number(study_id, number) for number in notes[key]]
        return notes

    def _note(self, verdicts: Mapping[int, str]) -> str:
        """Return the front as a Markdown table."""
        objectives, front = self.history.problem.objectives, self.history.front
        text = (
            f"A run of armwright on {self.config.task.name}, seed {self.config.seed}: {len(self.history)} designs, "
            f"{len(front)} on the front, each of these with its URDF as an artifact."
        )
        heads = ["trial", "joints", *(f"{o.name}{o.unit_in_brackets}" for o in objectives), "source", "verdict"]
        rows = [
            [str(m.number), m.design.joints, *(f"{v:.4g}" for v in m.values), m.source, verdicts.get(m.number, "")]
            for m in front
        ]
        return "\n".join([_escaped(text), "", _row(heads), f"|{' --- |' * len(heads)}", *map(_row, rows)])


def _row(cells: list[str]) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(map(_escaped, cells))} |"


def _escaped(text: str) -> str:
    """Return text without Markdown's markup: anybody may have written the names in a run folder."""
    return re.sub(r"([!-/:-@\[-`{-~])", r"\\\1", text)
