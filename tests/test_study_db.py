"""study.db, read by whom it is for: Optuna, its figures, and optuna-dashboard in a real browser."""

import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import optuna
import pytest
from optuna.artifacts import FileSystemArtifactStore, download_artifact, get_all_artifact_meta
from optuna.exceptions import ExperimentalWarning
from optuna.trial import TrialState
from optuna_dashboard import get_note, save_note
from playwright.sync_api import Browser, expect
from typer.testing import CliRunner, Result

from armwright import study_db
from armwright.cli import app
from armwright.exceptions import RunFolderError
from armwright.exporting import export_study
from armwright.front import find_front
from armwright.history import History
from armwright.optuna_storage import artifact_ids
from armwright.problem import Problem
from armwright.proposers.proposer import Proposal, Proposer
from armwright.results import read_summary
from armwright.run_folder import read_run
from armwright.sampling import distributions
from armwright.space import DesignSpace
from armwright.study import optimize
from armwright.study_db import ARTIFACTS, STUDY_DB, write_study
from armwright.task import Task, load_task
from tests.browser import Tab

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
WORDS = 'one <img src=x onerror="document.title=1"> | **two**, $x^2$ and [three](http://127.0.0.1:9/a.png)\n# four'


class Talker(Proposer):
    """Proposes uniform designs, for a reason that is full of markup."""

    name = "talker"

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        return Proposal(history.problem.space.sample(1, seed)[0], f"talker-{number}", WORDS * 40)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a space with conditions, a task with constraints, three objectives, and NSGA-II, which keeps notes."""
    folder = tmp_path_factory.mktemp("study-db") / "run"
    optimize(Problem(TASK, SPACE), proposer=Talker(), sampler="nsga2", n_total=30, out=folder)
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run as anybody's first."""
    folder = tmp_path_factory.mktemp("study-db") / "plain"
    optimize(Problem(load_task("target-1")), proposer="rules", n_total=40, out=folder)
    return folder


@contextmanager
def opened(file: Path, name: str | None = None) -> Iterator[optuna.Study]:
    """The study as Optuna loads it."""
    storage = optuna.storages.RDBStorage(f"sqlite:///{file}")
    try:
        yield optuna.load_study(study_name=name, storage=storage)
    finally:
        storage.engine.dispose()


def rows(file: Path) -> dict[str, list[Any]]:
    """All tables, without the numbers of their rows."""
    with closing(sqlite3.connect(file)) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {
            table: sorted(
                (row[1:] if "attribute" in table or table in ("trial_params", "trial_values") else row)
                for row in database.execute(f"SELECT * FROM {table}")
            )
            for table in tables
        }


def schema(file: Path) -> set[tuple[str, str, str]]:
    with closing(sqlite3.connect(file)) as database:
        found = database.execute("SELECT type, name, sql FROM sqlite_master")
        return {(kind, name, re.sub(r"\s+", " ", sql or "").replace(" ,", ",")) for kind, name, sql in found}


def test_every_row_is_as_optuna_itself_writes_it(run: Path, tmp_path: Path) -> None:
    """Optuna copies what it reads of ours into a file of its own."""
    other = tmp_path / "other.db"
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    optuna.copy_study(
        from_study_name="run", from_storage=f"sqlite:///{run / STUDY_DB}", to_storage=f"sqlite:///{other}"
    )
    assert schema(run / STUDY_DB) == schema(other)
    ours, theirs = rows(run / STUDY_DB), rows(other)
    assert {table: len(found) for table, found in ours.items()} == {
        table: len(found) for table, found in theirs.items()
    }
    for table, found in ours.items():
        assert found == theirs[table], table
    assert len(ours["trials"]) == 40
    assert ours["trial_params"]
    assert ours["trial_system_attributes"]


def test_optuna_has_the_run(run: Path) -> None:
    config, history = read_run(run)
    with opened(run / STUDY_DB) as study:
        assert study.study_name == "run"
        assert study.metric_names == ["worst_error", "torque", "mass"]
        assert all(direction.name == "MINIMIZE" for direction in study.directions)
        assert study.user_attrs["task"] == "some"
        assert study.user_attrs["method"]["sampler"] == "nsga2"
        assert study.user_attrs["armwright"] == config.versions["armwright"]
        assert study.user_attrs["hypervolume"] == history.hypervolume[-1]
        space = distributions(history.problem.space)
        assert len({len(trial.params) for trial in study.trials}) > 1, "parameters that some designs lack"
        for trial, ours in zip(study.trials, history, strict=True):
            assert trial.number == ours.number
            assert trial.state is TrialState.COMPLETE
            assert trial.params == history.problem.space.free_values(ours.design)
            assert trial.distributions == {name: space[name] for name in trial.params}
            assert trial.values == list(ours.values)
            assert tuple(trial.constraints.values()) == ours.constraints
            assert list(trial.constraints) == ["length <= 1.1", "worst_error <= 0.4"]
            assert trial.user_attrs["source"] == ours.source
            assert trial.user_attrs.get("proposal") == ours.proposal
            assert trial.user_attrs["joints"] == ours.design.joints
            assert trial.duration.total_seconds() == pytest.approx(ours.seconds["total"], abs=2e-6)
        assert any(trial.user_attrs["source"] == "talker" for trial in study.trials)
        written = (run / "trials.jsonl").stat().st_mtime
        assert study.trials[-1].datetime_complete.timestamp() == pytest.approx(written, abs=1e-3)


@pytest.mark.parametrize("which", ["run", "plain"])
def test_its_best_trials_are_the_front(which: str, request: pytest.FixtureRequest) -> None:
    """Optuna counts designs of equal values, too: of these the front has the first."""
    folder = request.getfixturevalue(which)
    _, history = read_run(folder)
    assert history.front
    with opened(folder / STUDY_DB) as study:
        best = {tuple(trial.values): trial.number for trial in reversed(study.best_trials)}
        assert sorted(best.values()) == sorted(member.number for member in history.front)
        solid = {trial.number for trial in study.best_trials if trial.user_attrs.get("verdict") == "solid"}
    summary = read_summary(folder)
    assert summary is not None
    assert solid == set(summary["verification"]["solid_numbers"])


def test_optuna_computes_the_same_hypervolume(plain: Path) -> None:
    _, history = read_run(plain)
    with opened(plain / STUDY_DB) as study:
        reference_point = study.user_attrs["reference_point"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExperimentalWarning)
            figure = optuna.visualization.plot_hypervolume_history(study, reference_point)
    (curve,) = (trace for trace in figure.data if trace.mode == "lines+markers")
    assert np.allclose(curve.y, history.hypervolumes, rtol=1e-12)


def test_optuna_draws_it(plain: Path, run: Path) -> None:
    matplotlib.use("agg")

    def error(trial: optuna.trial.FrozenTrial) -> float:
        return trial.values[0]

    about: dict[str, Any] = {"target": error, "target_name": "position_error"}
    for folder in (plain, run):
        with opened(folder / STUDY_DB) as study, warnings.catch_warnings():
            warnings.simplefilter("ignore", ExperimentalWarning)
            warnings.filterwarnings("ignore", "PedAnova|Param .* unique value")  # what Optuna says of itself
            _, history = read_run(folder)
            front = optuna.visualization.plot_pareto_front(study)
            best = front.data[-1]
            assert set(zip(best.x, best.y, strict=True)) >= {member.values[:2] for member in history.front}
            names = str(front.layout)
            assert all(objective.name in names for objective in history.problem.objectives)
            assert optuna.visualization.plot_slice(study, **about).data
            assert optuna.visualization.plot_optimization_history(study, **about).data
            assert optuna.visualization.plot_parallel_coordinate(study, **about).data
            assert optuna.visualization.plot_edf(study, **about).data
            importances = optuna.visualization.plot_param_importances(study, **about).data[0]
            assert set(importances.y) <= set(distributions(history.problem.space))
            if folder == plain:  # of parameters that all designs have
                assert set(importances.y) == set(distributions(history.problem.space))
            if len(study.directions) == 2:
                optuna.visualization.matplotlib.plot_pareto_front(study)
            optuna.visualization.matplotlib.plot_param_importances(study, **about)
            optuna.visualization.matplotlib.plot_slice(study, **about)
            plt.close("all")


def test_the_dashboards_own_reader_has_the_notes(run: Path) -> None:
    _, history = read_run(run)
    with opened(run / STUDY_DB) as study:
        words = get_note(study)
        assert "on the front" in words
        for member in history.front:
            assert f"| {member.number} |" in words
        proposed = next(trial for trial in history if trial.reason)
        trial = optuna.trial.Trial(study, study.trials[proposed.number]._trial_id)
        note = get_note(trial)
        assert len(note) > 2 * study_db.NOTE_PART, "in several parts"
        unescaped = re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", note)
        assert unescaped.endswith(f"Why talker proposed it: {WORDS * 40}")


def test_each_design_of_the_front_has_its_urdf_as_an_artifact(run: Path, tmp_path: Path) -> None:
    _, history = read_run(run)
    store = FileSystemArtifactStore(run / ARTIFACTS)
    front = {member.number for member in history.front}
    with opened(run / STUDY_DB) as study:
        for trial in study.trials:
            found = get_all_artifact_meta(trial, storage=study._storage)
            assert len(found) == (trial.number in front)
            for artifact in found:
                assert artifact.filename == f"some-{trial.number}.urdf"
                download_artifact(
                    artifact_store=store, file_path=str(tmp_path / artifact.filename), artifact_id=artifact.artifact_id
                )
                there = (run / "designs" / f"{trial.number:04d}" / "arm.urdf").read_bytes()
                assert (tmp_path / artifact.filename).read_bytes() == there
    assert len(list((run / ARTIFACTS).iterdir())) == len(front)


def test_the_same_command_again_changes_nothing_and_an_export_makes_the_same(plain: Path) -> None:
    before = (plain / STUDY_DB).read_bytes()
    optimize(Problem(load_task("target-1")), proposer="rules", n_total=40, out=plain)
    assert (plain / STUDY_DB).read_bytes() == before
    assert exported(plain).exit_code == 0
    assert (plain / STUDY_DB).read_bytes() == before
    (plain / STUDY_DB).unlink()
    assert exported(plain).exit_code == 0
    assert (plain / STUDY_DB).read_bytes() == before


def test_one_goes_on_with_it_and_loses_nothing_when_the_run_goes_on_too(tmp_path: Path) -> None:
    problem, folder = Problem(load_task("target-1")), tmp_path / "run"
    optimize(problem, proposer="none", n_total=12, out=folder)
    space = distributions(problem.space)
    with opened(folder / STUDY_DB) as study:
        study.sampler = optuna.samplers.TPESampler(seed=0)

        def objective(trial: optuna.Trial) -> tuple[float, ...]:
            given = {
                name: trial.suggest_float(name, each.low, each.high)
                if isinstance(each, optuna.distributions.FloatDistribution)
                else trial.suggest_categorical(name, each.choices)
                for name, each in space.items()
            }
            return tuple(problem.evaluate([problem.space.from_free_values(given)]).values[0].tolist())

        study.optimize(objective, n_trials=3)
        save_note(study, "mine")
    optimize(problem, proposer="none", n_total=14, out=folder)
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == 24
        assert "A run of armwright" in get_note(study)
    with opened(folder / "study-1.db") as study:
        assert len(study.trials) == 25
        assert get_note(study) == "mine"
    optimize(problem, proposer="none", n_total=15, out=folder)
    assert not (folder / "study-2.db").exists(), "nobody had changed that one"
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == 25


def test_nsga2_goes_on_from_the_parents_of_the_run(run: Path) -> None:
    _, history = read_run(run)
    noted = {name: ids for trial in history for name, ids in trial.sampler_notes.get("study", {}).items()}
    assert noted
    sampler = optuna.samplers.NSGAIISampler()
    with opened(run / STUDY_DB) as study:
        for name, numbers in noted.items():
            assert ":parent:" in name
            parents = sampler.get_parent_population(study, int(name.rpartition(":")[2]))
            assert sorted(trial.number for trial in parents) == sorted(numbers)


def test_one_that_is_kept_keeps_its_arms(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    optimize(Problem(load_task("target-1")), proposer="none", n_total=6, out=folder)
    with opened(folder / STUDY_DB) as study:
        save_note(study, "mine")
    assert exported(folder).exit_code == 0
    optimize(Problem(load_task("target-1")), proposer="none", n_total=20, out=folder)
    named = {file.name: artifact_ids(file) for file in folder.glob("*.db")}
    assert named["study-1.db"] - named[STUDY_DB], "the front has moved on"
    assert {path.name for path in (folder / ARTIFACTS).iterdir()} == named["study-1.db"] | named[STUDY_DB]


def test_a_journal_of_somebody_else_s_is_taken_for_no_part_of_it(plain: Path, tmp_path: Path) -> None:
    _, history = read_run(plain)
    (tmp_path / "a.db-journal").write_bytes(b"of a file that is gone")
    assert write_study(plain, history, None, tmp_path / "a.db").kept is None
    assert (tmp_path / "a-1.db-journal").exists()
    assert not (tmp_path / "a.db-journal").exists()


def test_a_name_that_is_no_text(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"run-\xff")
    optimize(Problem(load_task("target-1")), proposer="none", n_init=2, n_total=1, out=folder)
    assert (folder / STUDY_DB).exists()


def test_an_interrupted_run_that_goes_on_takes_it_away(tmp_path: Path) -> None:
    problem, folder = Problem(load_task("target-1")), tmp_path / "run"
    optimize(problem, proposer="none", n_total=3, out=folder)

    def stop(progress: Any) -> None:
        assert not (folder / STUDY_DB).exists()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimize(problem, proposer="none", n_total=9, out=folder, watch=stop)
    result = exported(folder)  # of the trials so far
    assert result.exit_code == 0, result.output
    with opened(folder / STUDY_DB) as study:
        assert len(study.trials) == 14
        assert not any("verdict" in trial.user_attrs for trial in study.trials)


def test_a_search_for_the_whole_front_has_one_too(tmp_path: Path) -> None:
    found = find_front(Problem(load_task("target-1")), budget=3000, out=tmp_path / "front")
    with opened(tmp_path / "front" / STUDY_DB) as study:
        assert sorted(trial.values for trial in study.best_trials) == sorted(list(m.values) for m in found.front)
        assert {trial.user_attrs["source"] for trial in study.trials} == {"front"}
        assert study.user_attrs["method"]["search"] == "front"


def test_of_very_many_trials_only_an_export_makes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armwright.results.MOST_AT_END", 12)
    optimize(Problem(load_task("target-1")), proposer="none", n_total=3, out=tmp_path / "run")
    assert not (tmp_path / "run" / STUDY_DB).exists()
    assert exported(tmp_path / "run").exit_code == 0
    assert (tmp_path / "run" / STUDY_DB).exists()


KILLED = """
import sys
from pathlib import Path
from armwright.run_folder import read_run
from armwright.study_db import write_study
run = Path(sys.argv[1])
_, history = read_run(run)
while True:
    write_study(run, history, None)
    print("written", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_a_kill_while_it_is_written_leaves_a_whole_one(plain: Path, tmp_path: Path) -> None:
    for moment in range(3):
        process = subprocess.Popen([sys.executable, "-c", KILLED, str(plain)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        for _ in range(moment + 1):
            assert process.stdout.readline() == b"written\n"
        process.send_signal(signal.SIGKILL)
        process.communicate()
        with closing(sqlite3.connect(plain / STUDY_DB)) as database:
            assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        with opened(plain / STUDY_DB) as study:
            assert len(study.trials) == 50
    assert exported(plain).exit_code == 0


def exported(run: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["export", str(run), "--format", "optuna", *options])


def test_a_file_of_somebody_elses_is_kept(plain: Path, tmp_path: Path) -> None:
    _, history = read_run(plain)
    whole = write_study(plain, history, None, tmp_path / "a" / "b.db").path.read_bytes()
    for number, content in enumerate((b"", b"no database", whole[:50], whole[1:]), start=1):
        (tmp_path / "a" / "b.db").write_bytes(content)
        result = exported(plain, "--out", str(tmp_path / "a" / "b.db"))
        assert result.exit_code == 0
        assert f"b-{number}.db now" in result.output
        assert (tmp_path / "a" / f"b-{number}.db").read_bytes() == content
        with opened(tmp_path / "a" / "b.db") as study:
            assert len(study.trials) == 50


def test_what_cannot_be_written_is_said(plain: Path, tmp_path: Path) -> None:
    (tmp_path / "folder.db").mkdir()
    with pytest.raises(RunFolderError, match=r"cannot write .*folder\.db: Is a directory"):
        export_study(plain, tmp_path / "folder.db")
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="cannot write"):
        export_study(plain, tmp_path / "file" / "study.db")
    assert "--design 3 goes with the other formats" in str(exported(plain, "--design", "3").exception)
    assert "not a run folder" in str(exported(tmp_path / "nothing").exception)
    assert not (tmp_path / "nothing").exists()
    unknown = CliRunner().invoke(app, ["export", str(plain), "--format", "optunaa"])
    assert 'Did you mean "optuna"' in str(unknown.exception)


@pytest.mark.slow
def test_a_run_does_without_optunas_library_for_databases() -> None:
    """It takes half a second to load; and who reads runs needs no Optuna at all."""
    code = """
import sys
import armwright.results
assert "optuna" not in sys.modules
import tempfile, armwright as aw
with tempfile.TemporaryDirectory() as folder:
    problem = aw.Problem(aw.load_task("target-1"))
    aw.optimize(problem, proposer="none", n_init=2, n_total=1, verify=False, out=folder + "/run")
assert "sqlalchemy" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@contextmanager
def dashboard(run: Path, port: int) -> Iterator[str]:
    """The real program, at the command that `armwright export` prints."""
    result = exported(run)
    command = result.output.splitlines()[-1].split()
    assert command[0] == "optuna-dashboard", result.output
    program = str(Path(sys.executable).with_name(command[0]))
    address = f"http://127.0.0.1:{port}/dashboard"
    with subprocess.Popen(
        [program, *command[1:], "--port", str(port)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as server:
        try:
            assert server.stdout is not None
            while b"Listening" not in (line := server.stdout.readline()):
                assert line, "it did not begin"
            yield address
        finally:
            server.kill()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_optuna_dashboard_shows_it(run: Path, browser: Browser) -> None:
    _, history = read_run(run)
    front = {member.number for member in history.front}
    number = max(front)
    proposed = next(trial for trial in history if trial.source == "talker")
    content = (run / "designs" / f"{number:04d}" / "arm.urdf").read_bytes()
    before = (run / STUDY_DB).read_bytes()
    tab = Tab(browser, viewport={"width": 1400, "height": 1600}, accept_downloads=True)
    page = tab.page
    with dashboard(run, free_port()) as address:
        page.goto(f"{address}/studies/1")
        expect(page.get_by_text("Pareto Front")).to_be_visible(timeout=60_000)
        expect(page.locator("body")).to_contain_text("worst_error")
        points = page.locator(".scatterlayer .point")
        expect(points).not_to_have_count(0)
        expect(page.locator("body")).to_contain_text("Hyperparameter Importance")

        page.goto(f"{address}/studies/1/trials?numbers={number}")
        shown = page.locator("body")
        expect(shown).to_contain_text(f"Trial {number} (trial_id={number + 1})", timeout=60_000)
        expect(shown).to_contain_text("Best Trial")
        expect(shown).to_contain_text("On the front")
        expect(shown).to_contain_text(f"source {history.trials[number].source}")
        expect(shown).to_contain_text(f"joints {history.trials[number].design.joints}")
        for name in history.trials[number].design.params:
            expect(shown).to_contain_text(f"{name} ")
        with page.expect_download() as download:
            page.get_by_label(re.compile("download", re.IGNORECASE)).first.click()
        assert download.value.suggested_filename == f"some-{number}.urdf"
        assert download.value.path().read_bytes() == content

        # A model's words are shown as they are: no picture is fetched, no script runs.
        page.goto(f"{address}/studies/1/trials?numbers={proposed.number}")
        expect(shown).to_contain_text("source talker", timeout=60_000)
        expect(shown).to_contain_text('one <img src=x onerror="document.title=1"> | **two**, $x^2$ and [three]')
        expect(page.get_by_role("link", name="three")).to_have_count(0)

        page.goto(f"{address}/studies/1/note")
        expect(page.get_by_role("cell", name=str(number), exact=True).first).to_be_visible(timeout=60_000)
    assert not [url for url in tab.requests if not url.startswith(address.removesuffix("/dashboard"))]
    assert not tab.faults
    tab.close()
    assert (run / STUDY_DB).read_bytes() == before, "to look changes nothing"
