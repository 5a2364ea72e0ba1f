"""Export a run as an Optuna study, for optuna-dashboard, Optuna's figures, and a search that continues there."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from warnings import catch_warnings, simplefilter

import optuna
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.storages import RDBStorage
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState, create_trial

from armwright.exceptions import RunFolderError, SettingsError
from armwright.files import replace_file, replace_surrogates
from armwright.proof.results import read_summary
from armwright.runs.config import RunConfig
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.optuna_distributions import distributions, quietly

STUDY_DB = "study.db"
TRIAL_ATTRIBUTES = ("source", "proposal", "reason", "fault", "duplicate_of")


def export_study(run: Path, target: Path | None = None) -> Path:
    """Export all finished trials of a run as an Optuna study in a new database of Optuna's own storage.

    The run may be finished, stopped or ongoing. The database is `study.db` in its folder if `target` is None.

    Raises:
        RunFolderError: The database exists, as it may hold notes and trials of its owner, or it cannot be written.
        SettingsError: The run has no finished trial.
    """
    config, history = read_run(run)
    if not len(history):
        raise SettingsError(f"{run} has no finished trial yet")
    target = target or run / STUDY_DB
    if target.exists():
        raise RunFolderError(
            f"{target} exists, and may hold notes or trials of yours; move it away, or give another --out FILE"
        )
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory() as folder:
            database = Path(folder) / STUDY_DB
            storage = RDBStorage(f"sqlite:///{database.as_posix()}")
            try:
                _write(run, config, history, storage)
            finally:
                storage.engine.dispose()
            replace_file(target, database.read_bytes())
    except (OSError, StorageInternalError) as error:
        raise RunFolderError(f"cannot write {target}: {getattr(error, 'strerror', None) or error}") from error
    return target


def _write(run: Path, config: RunConfig, history: History, storage: RDBStorage) -> None:
    """Write the study of a run into an empty database."""
    objectives = history.problem.objectives
    with quietly(), catch_warnings():
        simplefilter("ignore", ExperimentalWarning)  # metric names
        directions = [StudyDirection.MINIMIZE] * len(objectives)
        name = replace_surrogates(run.resolve().name)
        study = optuna.create_study(storage=storage, study_name=name, directions=directions)
        study.set_metric_names([objective.name for objective in objectives])
    attributes = {
        "armwright": config.versions.get("armwright"),
        "task": config.task.name,
        "space": config.space.name,
        "seed": config.seed,
        "method": config.method.model_dump(mode="json"),
        "units": {objective.name: objective.unit for objective in objectives},
        "reference_point": history.reference_point,
        "hypervolume": float(history.hypervolume[-1]) if len(history.hypervolume) else None,
    }
    for key, value in attributes.items():
        if value is not None:
            study.set_user_attr(key, value)
    study.add_trials(_trials(history, _verdicts(run, history)))


def _verdicts(run: Path, history: History) -> dict[int, str]:
    """Return "robust" or "sensitive" by trial number, for a front that was verified."""
    summary = read_summary(run)
    if summary is None or summary["n_trials"] != len(history) or summary["verification"] is None:
        return {}
    robust = set(summary["verification"]["robust_numbers"])
    return {member.number: "robust" if member.number in robust else "sensitive" for member in history.front}


def _trials(history: History, verdicts: Mapping[int, str]) -> Iterator[FrozenTrial]:
    """Yield the trials of the study."""
    problem = history.problem
    every = distributions(problem.space)
    names = [constraint.description for constraint in problem.constraints]
    for trial in history:
        params = problem.space.free_values(trial.design)
        attributes = {name: getattr(trial, name) for name in TRIAL_ATTRIBUTES}
        failure = trial.failure
        attributes["failure"] = None if failure is None else f"{failure.kind}: {failure.description}"
        attributes |= {"joints": trial.design.joints, "verdict": verdicts.get(trial.number)}
        attributes["seconds"] = trial.seconds.get("total")
        yield create_trial(
            params=params,
            distributions={name: every[name] for name in params},
            state=TrialState.COMPLETE if failure is None else TrialState.FAIL,
            values=trial.values if failure is None else None,
            constraints=dict(zip(names, trial.violations, strict=True)),
            user_attrs={name: value for name, value in attributes.items() if value not in (None, "")},
            system_attrs=dict(trial.sampler_notes.get("trial", {})),
        )
