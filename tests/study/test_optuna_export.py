"""Runs exported to Optuna, read back with Optuna, its figures, and optuna-dashboard in a real browser."""

import os
import re
import shlex
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import optuna
import pytest
from optuna.artifacts import FileSystemArtifactStore, download_artifact, get_all_artifact_meta
from optuna.exceptions import ExperimentalWarning, StorageInternalError
from optuna.trial import TrialState
from optuna_dashboard import get_note, save_note
from playwright.sync_api import Browser, expect
from typer.testing import CliRunner, Result

from armwright.cli.app import app
from armwright.exceptions import RunFolderError, SettingsError
from armwright.problem.problem import Problem
from armwright.proof.results import read_summary
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.optuna_distributions import distributions
from armwright.study.front.front_run import find_front
from armwright.study.optuna_export import ARTIFACTS, STUDY_DB, ExportedStudy, export_study
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task
from tests.support.browser import Tab
from tests.support.command_line import PATIENCE

SPACE = DesignSpace.model_validate({"name": "some", "joints": [2, 4], "actuators": ["XL430-W250", "XM430-W350"]})
TASK = Task.model_validate(
    {
        "name": "some",
        "targets": [[0.3, 0.1, 0.2], [0.2, -0.2, 0.1]],
        "objectives": ["worst_error", "torque", "mass"],
        "constraints": ["length <= 1.1", "worst_error <= 0.4"],
        "reference_point": [0.6, 60.0, 2.0],
    }
)
REASON = 'one <img src=x onerror="document.title=1"> | **two**, $x^2$ and [three](http://127.0.0.1:9/a.png)\n# four'


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
            }
            assert trial.user_attrs == {name: value for name, value in told.items() if value is not None}
            noted = ours.sampler_notes.get("trial", {})
            assert {name: trial.system_attrs[name] for name in noted} == noted
            assert trial.duration.total_seconds() == pytest.approx(ours.seconds["total"], abs=2e-6)
        written = (folder / "trials.jsonl").stat().st_mtime
        assert study.trials[-1].datetime_complete.timestamp() == pytest.approx(written, abs=1e-3)


def verdicts_of(folder: Path, history: History) -> dict[int, str]:
    summary = read_summary(folder)
    assert summary is not None
    robust = summary["verification"]["robust_numbers"]
    return {member.number: "robust" if member.number in robust else "sensitive" for member in history.front}


def test_exported_runs_cover_all_trial_fields(run: Path) -> None:
    """Otherwise the comparison above could miss parameters, attributes and notes."""
    with opened(run / STUDY_DB) as study:
        assert len({len(trial.params) for trial in study.trials}) > 1
        names = {name for trial in study.trials for name in trial.user_attrs}
        assert names >= {"source", "joints", "proposal", "reason", "verdict"}
        assert any(not all(value <= 0 for value in trial.constraints.values()) for trial in study.trials)
        assert any("generation" in name for trial in study.trials for name in trial.system_attrs)


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


@pytest.mark.parametrize("which", ["run", "plain"])
def test_best_trials_are_the_front(which: str, request: pytest.FixtureRequest) -> None:
    """Of designs with equal values, Optuna keeps all and the front keeps the first."""
    folder = request.getfixturevalue(which)
    _, history = read_run(folder)
    assert history.front
    with opened(folder / STUDY_DB) as study:
        best = {tuple(trial.values): trial.number for trial in reversed(study.best_trials)}
    assert sorted(best.values()) == sorted(member.number for member in history.front)


def test_optuna_computes_the_same_hypervolume(plain: Path) -> None:
    _, history = read_run(plain)
    with opened(plain / STUDY_DB) as study, warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        figure = optuna.visualization.plot_hypervolume_history(study, study.user_attrs["reference_point"])
    (curve,) = (trace for trace in figure.data if trace.mode == "lines+markers")
    assert np.allclose(curve.y, history.hypervolumes, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["run", "plain"])
def test_optuna_plots_an_exported_study(which: str, request: pytest.FixtureRequest) -> None:
    matplotlib.use("agg")
    folder = request.getfixturevalue(which)
    _, history = read_run(folder)
    names = set(distributions(history.problem.space))

    def error(trial: optuna.trial.FrozenTrial) -> float:
        return trial.values[0]

    about: dict[str, Any] = {"target": error, "target_name": "position_error"}
    with opened(folder / STUDY_DB) as study, warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        warnings.filterwarnings("ignore", "PedAnova|Param .* unique value")  # Optuna's own
        front = optuna.visualization.plot_pareto_front(study)
        best = front.data[-1]
        assert set(zip(best.x, best.y, strict=True)) >= {member.values[:2] for member in history.front}
        assert all(objective.name in str(front.layout) for objective in history.problem.objectives)
        assert optuna.visualization.plot_slice(study, **about).data
        assert optuna.visualization.plot_parallel_coordinate(study, **about).data
        importances = set(optuna.visualization.plot_param_importances(study, **about).data[0].y)
        assert importances
        assert importances == names if which == "plain" else importances <= names  # all parameters of each design
        optuna.visualization.matplotlib.plot_slice(study, **about)
        plt.close("all")


def test_dashboard_note_lists_the_front(run: Path) -> None:
    _, history = read_run(run)
    assert history.front
    with opened(run / STUDY_DB) as study:
        note = get_note(study)
    for member in history.front:
        assert f"| {member.number} | {member.design.joints} |" in note


def test_front_designs_have_urdf_artifacts(run: Path, tmp_path: Path) -> None:
    _, history = read_run(run)
    store = FileSystemArtifactStore(run / ARTIFACTS)
    front = {member.number for member in history.front}
    assert front
    with opened(run / STUDY_DB) as study:
        found = {trial.number: get_all_artifact_meta(trial, storage=study._storage) for trial in study.trials}
    assert {number for number, artifacts in found.items() if artifacts} == front
    for number in front:
        (artifact,) = found[number]
        assert (artifact.filename, artifact.mimetype) == (f"some-{number}.urdf", "application/xml")
        copy = tmp_path / artifact.filename
        download_artifact(artifact_store=store, file_path=str(copy), artifact_id=artifact.artifact_id)
        assert copy.read_bytes() == (run / "designs" / f"{number:04d}" / "arm.urdf").read_bytes()
    assert len(list((run / ARTIFACTS).iterdir())) == len(front)


def test_exported_study_can_be_continued(plain: Path, tmp_path: Path) -> None:
    """An export never replaces trials added to it."""
    database, problem = tmp_path / STUDY_DB, Problem(load_task("target-1"))
    export_study(plain, database)
    with opened(database) as study:
        study.sampler = optuna.samplers.TPESampler(seed=0)
        trial = study.ask(distributions(problem.space))
        study.tell(trial, problem.evaluate([problem.space.from_free_values(trial.params)]).values[0].tolist())
        save_note(study, "mine")
    before = database.read_bytes()
    artifacts = set((tmp_path / ARTIFACTS).iterdir())
    result = exported(plain, "--out", str(database))
    assert isinstance(result.exception, RunFolderError)
    assert "exists, and may hold notes or trials of yours" in str(result.exception)
    assert database.read_bytes() == before
    assert set((tmp_path / ARTIFACTS).iterdir()) == artifacts
    with opened(database) as study:
        assert len(study.trials) == 21


def test_nsga2_continues_from_the_parents_of_the_run(run: Path) -> None:
    _, history = read_run(run)
    noted = {name: ids for trial in history for name, ids in trial.sampler_notes.get("study", {}).items()}
    assert noted
    sampler = optuna.samplers.NSGAIISampler()
    with opened(run / STUDY_DB) as study:
        for name, numbers in noted.items():
            assert ":parent:" in name
            parents = sampler.get_parent_population(study, int(name.rpartition(":")[2]))
            assert sorted(trial.number for trial in parents) == sorted(numbers)


def test_only_an_export_writes_a_database(tmp_path: Path) -> None:
    """A stopped run is exported up to its last trial, without outdated verdicts."""
    problem, folder = Problem(load_task("target-1")), tmp_path / "run"
    optimize(problem, proposer="none", n_total=1, out=folder)
    assert not (folder / STUDY_DB).exists()
    assert not (folder / ARTIFACTS).exists()

    def stop(progress: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimize(problem, proposer="none", n_total=9, out=folder, watch=stop)
    result = exported(folder)
    assert result.exit_code == 0, result.output
    assert (
        result.output.splitlines()[-1].strip() == ExportedStudy(folder / STUDY_DB, folder / ARTIFACTS).dashboard_command
    )
    _, history = read_run(folder)
    assert 11 < len(history) < 19
    with opened(folder / STUDY_DB) as study:
        assert [trial.values for trial in study.trials] == [list(trial.values) for trial in history]
        assert not any("verdict" in trial.user_attrs for trial in study.trials)
    optimize(problem, proposer="none", n_total=9, out=folder)
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == len(history), "the export stays as it was made"


@pytest.mark.slow
def test_front_search_is_exported(tmp_path: Path) -> None:
    found = find_front(Problem(load_task("target-1")), evaluations=1000, out=tmp_path / "front")
    with opened(export_study(tmp_path / "front").database) as study:
        assert sorted(trial.values for trial in study.best_trials) == sorted(list(m.values) for m in found.front)
        assert {trial.user_attrs["source"] for trial in study.trials} == {"front_search"}
        assert study.user_attrs["method"]["search"] == "front_search"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_folder_with_an_undecodable_name_is_exported(plain: Path, tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"run-\xff")
    folder.mkdir()
    for name in ("config.yaml", "trials.jsonl", "summary.json"):
        (folder / name).write_bytes((plain / name).read_bytes())
    with opened(export_study(folder, tmp_path / STUDY_DB).database) as study:
        assert study.study_name == "run-?"


def test_failed_export_leaves_no_database(plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(study: optuna.Study, trials: Any) -> None:
        next(trials)
        raise StorageInternalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(optuna.Study, "add_trials", fail)
        with pytest.raises(RunFolderError, match=r"cannot write .*study\.db: database or disk is full"):
            export_study(plain, tmp_path / STUDY_DB)
    assert [path.name for path in tmp_path.iterdir()] == [ARTIFACTS]
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
    unknown = CliRunner().invoke(app, ["export", str(plain), "--format", "optunaa"])
    assert 'Did you mean "optuna"' in str(unknown.exception)


@contextmanager
def dashboard(command: list[str], port: int) -> Iterator[str]:
    """Serve with the real program."""
    program = str(Path(sys.executable).with_name(command[0]))
    with subprocess.Popen(
        [program, *command[1:], "--port", str(port)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as server:
        try:
            assert server.stdout is not None
            while b"Listening" not in (line := server.stdout.readline()):
                assert line, "it did not begin"
            deadline = time.monotonic() + PATIENCE
            while True:  # it says so before it accepts connections
                with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port)):
                    break
                assert time.monotonic() < deadline, "it accepts no connection"
            yield f"http://127.0.0.1:{port}/dashboard"
        finally:
            server.kill()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_optuna_dashboard_shows_an_exported_study(run: Path, browser: Browser) -> None:
    _, history = read_run(run)
    number = max(member.number for member in history.front)
    proposed = next(trial for trial in history if trial.source == "talker")
    content = (run / "designs" / f"{number:04d}" / "arm.urdf").read_bytes()
    command = shlex.split(ExportedStudy(run / STUDY_DB, run / ARTIFACTS).dashboard_command)
    before = (run / STUDY_DB).read_bytes()
    tab = Tab(browser, viewport={"width": 1400, "height": 1600}, accept_downloads=True)
    page = tab.page
    with dashboard(command, free_port()) as address:
        page.goto(f"{address}/studies/1")
        expect(page.get_by_text("Pareto Front")).to_be_visible()
        expect(page.locator("body")).to_contain_text("worst_error")
        expect(page.locator(".scatterlayer .point")).not_to_have_count(0)
        expect(page.locator("body")).to_contain_text("Hyperparameter Importance")

        page.goto(f"{address}/studies/1/trials?numbers={number}")
        shown = page.locator("body")
        expect(shown).to_contain_text(f"Trial {number} (trial_id={number + 1})")
        expect(shown).to_contain_text("Best Trial")
        expect(shown).to_contain_text(f"source {history.trials[number].source}")
        expect(shown).to_contain_text(f"joints {history.trials[number].design.joints}")
        expect(shown).to_contain_text(f"verdict {verdicts_of(run, history)[number]}")
        for name in history.trials[number].design.params:
            expect(shown).to_contain_text(f"{name} ")
        with page.expect_download() as download:
            page.get_by_label(re.compile("download", re.IGNORECASE)).first.click()
        assert download.value.suggested_filename == f"some-{number}.urdf"
        assert download.value.path().read_bytes() == content

        # A model's words are shown as they are: no picture is fetched, no script runs.
        page.goto(f"{address}/studies/1/trials?numbers={proposed.number}")
        expect(shown).to_contain_text("source talker")
        expect(shown).to_contain_text('one <img src=x onerror="document.title=1"> | **two**, $x^2$ and [three]')
        expect(page.get_by_role("link", name="three")).to_have_count(0)

        page.goto(f"{address}/studies/1/note")
        expect(page.get_by_role("cell", name=str(number), exact=True).first).to_be_visible()
    assert not [url for url in tab.requests if not url.startswith(address.removesuffix("/dashboard"))]
    assert not tab.faults
    tab.close()
    assert (run / STUDY_DB).read_bytes() == before, "to look changes nothing"
