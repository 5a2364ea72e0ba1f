"""Runs exported to Optuna, read back with Optuna and its figures."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.trial import TrialState
from typer.testing import CliRunner, Result

from armwright import DesignSpace, History, Problem, Proposal, Proposer, Task, load_task, optimize, read_run
from armwright.cli.app import app
from armwright.exceptions import RunFolderError, SettingsError
from armwright.proof.results import read_summary
from armwright.spaces.optuna_distributions import distributions
from armwright.study.optuna_export import STUDY_DB, export_study
from tests.support.arms import LIGHT
from tests.support.controlled_runs import after, interrupt

SPACE = DesignSpace.model_validate(
    {"name": "some", "joints": [2, 4], **LIGHT, "actuators": ["XL430-W250", "XM430-W350"]}
)
TASK = Task.model_validate(
    {
        "name": "some",
        "targets": [[0.3, 0.1, 0.2], [0.2, -0.2, 0.1]],
        "objectives": ["worst_error", "torque", "mass"],
        "constraints": ["length <= 1.1", "worst_error <= 0.4"],
        "reference_point": [0.6, 60.0, 2.0],
    }
)
REASON = "one | **two**\n# four"


class Talker(Proposer):
    """Proposes uniform designs, for a reason that is full of markup."""

    name = "talker"

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        return Proposal(history.problem.space.sample(1, seed)[0], f"talker-{number}", REASON)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with conditional parameters, constraints, three objectives, and NSGA-II, which keeps notes."""
    folder = tmp_path_factory.mktemp("optuna") / "run"
    optimize(Problem(TASK, SPACE), proposer=Talker(), sampler="nsga2", n_total=30, out=folder)
    export_study(folder)
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with the default settings, exported."""
    folder = tmp_path_factory.mktemp("optuna") / "plain"
    optimize(Problem(load_task("target-1")), proposer="rules", n_total=10, out=folder)
    export_study(folder)
    return folder


@contextmanager
def opened(database: Path) -> Iterator[optuna.Study]:
    """Load the study with Optuna."""
    storage = optuna.storages.RDBStorage(f"sqlite:///{database}")
    try:
        yield optuna.load_study(study_name=None, storage=storage)
    finally:
        storage.engine.dispose()


def exported(run: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["export", str(run), "--format", "optuna", *options])


@pytest.mark.parametrize("which", ["run", "plain"])
def test_exported_trials_equal_those_of_the_run(which: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(which)
    _, history = read_run(folder)
    space = history.problem.space
    every = distributions(space)
    constraints = [constraint.description for constraint in history.problem.constraints]
    verdicts = verdicts_of(folder, history)
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == len(history)
        for ours, trial in zip(history, study.trials, strict=True):
            assert trial.number == ours.number
            assert trial.state is TrialState.COMPLETE
            assert trial.params == space.free_values(ours.design)
            assert trial.distributions == {name: every[name] for name in trial.params}
            assert trial.values == list(ours.values)
            assert trial.constraints == dict(zip(constraints, ours.violations, strict=True))
            told = {
                "source": ours.source,
                "joints": ours.design.joints,
                "proposal": ours.proposal,
                "reason": ours.reason or None,
                "fault": ours.fault,
                "failure": ours.failure or None,
                "duplicate_of": ours.duplicate_of,
                "verdict": verdicts.get(ours.number),
                "seconds": ours.seconds["total"],
            }
            assert trial.user_attrs == {name: value for name, value in told.items() if value is not None}
            noted = ours.sampler_notes.get("trial", {})
            assert {name: trial.system_attrs[name] for name in noted} == noted
        if which == "run":  # all fields occur in it
            names = {name for trial in study.trials for name in trial.user_attrs}
            assert names >= {"source", "joints", "proposal", "reason", "verdict"}
            assert len({len(trial.params) for trial in study.trials}) > 1
            assert any("generation" in name for trial in study.trials for name in trial.system_attrs)


def verdicts_of(folder: Path, history: History) -> dict[int, str]:
    summary = read_summary(folder)
    assert summary is not None
    robust = summary["verification"]["robust_numbers"]
    return {member.number: "robust" if member.number in robust else "sensitive" for member in history.front}


def test_exported_study_names_its_run(run: Path) -> None:
    config, history = read_run(run)
    with opened(run / STUDY_DB) as study:
        assert study.study_name == "run"
        assert study.metric_names == ["worst_error", "torque", "mass"]
        assert [direction.name for direction in study.directions] == ["MINIMIZE"] * 3
        assert study.user_attrs == {
            "armwright": config.versions["armwright"],
            "task": "some",
            "space": "some",
            "seed": 0,
            "method": config.method.model_dump(mode="json"),
            "units": {o.name: o.unit for o in history.problem.objectives},
            "reference_point": [0.6, 60.0, 2.0],
            "hypervolume": history.hypervolume[-1],
        }


def test_best_trials_are_the_front(run: Path) -> None:
    """Of designs with equal values, Optuna keeps all and the front keeps the first."""
    _, history = read_run(run)
    assert history.front
    with opened(run / STUDY_DB) as study:
        best = {tuple(trial.values): trial.number for trial in reversed(study.best_trials)}
    assert sorted(best.values()) == sorted(member.number for member in history.front)


def test_optuna_computes_the_same_hypervolume(plain: Path) -> None:
    _, history = read_run(plain)
    with opened(plain / STUDY_DB) as study, warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        figure = optuna.visualization.plot_hypervolume_history(study, study.user_attrs["reference_point"])
    (curve,) = (trace for trace in figure.data if trace.mode == "lines+markers")
    assert np.allclose(curve.y, history.hypervolumes, rtol=1e-12)


def test_exported_study_can_be_continued(plain: Path, tmp_path: Path) -> None:
    """An export never replaces trials added to it."""
    database, problem = tmp_path / STUDY_DB, Problem(load_task("target-1"))
    export_study(plain, database)
    with opened(database) as study:
        study.sampler = optuna.samplers.TPESampler(seed=0)
        trial = study.ask(distributions(problem.space))
        study.tell(trial, problem.evaluate([problem.space.from_free_values(trial.params)]).values[0].tolist())
    before = database.read_bytes()
    result = exported(plain, "--out", str(database))
    assert isinstance(result.exception, RunFolderError)
    assert "exists, and may hold notes or trials of yours" in str(result.exception)
    assert database.read_bytes() == before
    with opened(database) as study:
        assert len(study.trials) == 21


def test_only_an_export_writes_a_database(tmp_path: Path) -> None:
    """A stopped run is exported up to its last trial, without outdated verdicts."""
    problem, folder = Problem(load_task("target-1")), tmp_path / "run"
    optimize(problem, proposer="none", n_total=1, out=folder)
    assert not (folder / STUDY_DB).exists()

    with pytest.raises(KeyboardInterrupt):
        optimize(problem, proposer="none", n_total=9, out=folder, watch=after(13, interrupt))
    result = exported(folder)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1].strip() == f"optuna-dashboard sqlite:///{folder / STUDY_DB}"
    _, history = read_run(folder)
    assert 11 < len(history) < 19
    with opened(folder / STUDY_DB) as study:
        assert [trial.values for trial in study.trials] == [list(trial.values) for trial in history]
        assert not any("verdict" in trial.user_attrs for trial in study.trials)
    optimize(problem, proposer="none", n_total=9, out=folder)
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == len(history), "the export stays as it was made"


def test_failed_export_leaves_no_database(plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(study: optuna.Study, trials: Any) -> None:
        next(trials)
        raise StorageInternalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(optuna.Study, "add_trials", fail)
        with pytest.raises(RunFolderError, match=r"cannot write .*study\.db: database or disk is full"):
            export_study(plain, tmp_path / STUDY_DB)
    assert not list(tmp_path.iterdir())
    export_study(plain, tmp_path / STUDY_DB)


def test_invalid_exports_are_refused(plain: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(RunFolderError, match="cannot write"):
        export_study(plain, tmp_path / "file" / "study.db")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "config.yaml").write_bytes((plain / "config.yaml").read_bytes())
    with pytest.raises(SettingsError, match="has no finished trial yet"):
        export_study(tmp_path / "empty")
    assert "--design 3 does not go with --format optuna" in str(exported(plain, "--design", "3").exception)
    assert "not a run folder" in str(exported(tmp_path / "nothing").exception)
    assert not (tmp_path / "nothing").exists()
