"""Workers: designs evaluated by other processes, from one shared Optuna study."""

import sqlite3
import threading
import time
import types
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import optuna
import pytest
from optuna.trial import TrialState

import armwright as aw
from armwright.exceptions import EvaluatorError, MissingExtraError, RunConflictError, SettingsError, StorageError
from armwright.history import History
from armwright.judging import Judged, Judging, judged
from armwright.proposers.proposer import Proposal, Proposer
from armwright.run_config import WorkersRecord
from armwright.run_folder import read_run
from armwright.study import Progress
from armwright.trial import FinishedTrial
from armwright.workers import board as board_module
from armwright.workers import judging, worker
from armwright.workers.board import Board, shown_url, sqlite_url
from tests.boards import optunas
from tests.torture.lives import trials

TASK = aw.load_task("target-1")
PROBLEM = aw.Problem(TASK)


@pytest.fixture(autouse=True)
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time between two looks is no part of what is tested."""
    monkeypatch.setattr(judging, "LOOK_EVERY", 0.01)
    monkeypatch.setattr(worker, "LOOK_EVERY", 0.01)


class Crew:
    """Workers in threads of this process, that begin as soon as the run does."""

    def __init__(self, run: Path, n: int, **wanted: Any) -> None:
        self.done: list[int] = []
        self.faults: list[BaseException] = []
        self._began = threading.Event()
        self._threads = [threading.Thread(target=self._work, args=(run, wanted)) for _ in range(n)]
        for thread in self._threads:
            thread.start()

    def hear(self, progress: Progress) -> None:
        if "start" in progress.note and "worker" in progress.note:
            self._began.set()

    def _work(self, run: Path, wanted: dict[str, Any]) -> None:
        self._began.wait()
        try:
            self.done.append(aw.work(run, say=lambda _: None, **wanted))
        except BaseException as fault:  # noqa: BLE001 raised in the test's thread
            self.faults.append(fault)

    def begin(self) -> None:
        self._began.set()

    def join(self) -> None:
        self._began.set()
        for thread in self._threads:
            thread.join()


def with_crew(run: Path, n: int, problem: aw.Problem = PROBLEM, **asked: Any) -> tuple[aw.Run, Crew]:
    crew = Crew(run, n, evaluator=problem.evaluator)
    settings = {"proposer": "rules", "n_init": 5, "n_step": 4, "n_total": 12, **asked}
    try:
        found = aw.optimize(problem, out=run, workers=aw.Workers(n, heartbeat=1), watch=crew.hear, **settings)
    finally:
        crew.join()
    assert not crew.faults
    return found, crew


@pytest.mark.parametrize("sampler", ["tpe", "nsga2"])
def test_one_worker_makes_the_run_of_none(tmp_path: Path, sampler: str) -> None:
    """To the bit: where a design is evaluated changes nothing."""
    aw.optimize(PROBLEM, proposer="rules", n_init=5, n_step=4, n_total=12, sampler=sampler, out=tmp_path / "here")
    found, crew = with_crew(tmp_path / "there", 1, sampler=sampler)
    assert trials(tmp_path / "there") == trials(tmp_path / "here")
    assert crew.done == [17 - found.summary["same_arms"]]


class Numbered(Proposer):
    """Each proposal is a design of its own."""

    name = "numbered"

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        return Proposal(history.problem.space.sample(1, seed)[0], f"numbered-{number}")


def test_many_workers_evaluate_each_trial_once(tmp_path: Path) -> None:
    evaluated: Counter[aw.Arm] = Counter()
    lock = threading.Lock()

    @aw.evaluator("reach [m]", "joints_used")
    def measured(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
        with lock:
            evaluated[arm] += 1
        return sum(link.length for link in arm.links), 1.0 + arm.base[2]

    problem = aw.Problem(TASK.model_copy(update={"reference_point": None}), evaluator=measured)
    found, crew = with_crew(tmp_path / "run", 4, problem, n_total=40, proposer=Numbered())
    assert [trial.number for trial in found.trials] == list(range(45))
    assert set(evaluated.values()) == {1}
    assert sum(evaluated.values()) == sum(crew.done) == 45
    proposals = [trial.proposal for trial in found.trials if trial.source == "numbered"]
    assert len(proposals) == len(set(proposals)) == 10
    for trial in found.trials:
        assert trial.values == problem.evaluate([trial.design])[0].values
    _, history = read_run(tmp_path / "run")
    assert [trial.values for trial in history] == [trial.values for trial in found.trials]


def test_optuna_sees_the_study(tmp_path: Path) -> None:
    """Its own front is the run's; constraints, sources and parameters are there."""
    task = TASK.model_copy(update={"constraints": ("length <= 0.6",)})
    found, _ = with_crew(tmp_path / "run", 2, aw.Problem(task), n_total=20)
    with optunas(tmp_path / "run") as study:
        best = sorted(trial.user_attrs["number"] for trial in study.best_trials)
        by_number = {trial.user_attrs["number"]: trial for trial in study.trials}
        assert study.metric_names == ["position_error", "torque"]
    assert best == sorted(m.number for m in found.front)
    for trial in found.trials:
        if trial.same_as is None:
            theirs = by_number[trial.number]
            assert (tuple(theirs.values), theirs.user_attrs["source"]) == (trial.values, trial.source)
            assert theirs.params == dict(trial.design.params)


def test_a_run_that_was_left_goes_on_with_what_workers_did_meanwhile(tmp_path: Path) -> None:
    """Designs that were evaluated while no search was there are not evaluated again."""
    evaluated: Counter[aw.Arm] = Counter()

    @aw.evaluator("reach [m]", "height [m]")
    def measured(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
        evaluated[arm] += 1
        return sum(link.length for link in arm.links), 1.0 + arm.base[2]

    problem = aw.Problem(TASK.model_copy(update={"reference_point": None}), evaluator=measured)

    def leave(progress: Any) -> None:
        if "worker" in progress.note:
            raise KeyboardInterrupt

    def search(watch: Callable[[Any], None]) -> aw.Run:
        return aw.optimize(
            problem, proposer="rules", n_init=6, n_step=4, n_total=8, out=tmp_path / "run",
            workers=aw.Workers(3, heartbeat=1), watch=watch,
        )  # fmt: skip

    with pytest.raises(KeyboardInterrupt):  # as soon as workers are called, before anything is posted
        search(leave)
    left = threading.Event()

    def leave_later(progress: Any) -> None:
        if "none is there" in progress.note:
            left.set()
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judging, "LONELY", 0.0)
        with pytest.raises(KeyboardInterrupt):
            search(leave_later)
    assert left.is_set()
    assert trials(tmp_path / "run") == []
    crew = Crew(tmp_path / "run", 1, evaluator=measured)
    crew.begin()
    found = search(lambda _: None)
    crew.join()
    assert not crew.faults
    assert set(evaluated.values()) == {1}
    assert len(found.trials) == 14


@pytest.mark.parametrize("kind", [ValueError, SystemExit])
def test_an_evaluator_that_fails_stops_the_search_and_its_trial_is_evaluated_again(
    tmp_path: Path, kind: type[BaseException]
) -> None:
    state = {"broken": True}

    @aw.evaluator("reach [m]", "height [m]")
    def measured(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
        if state["broken"] and arm.base[2] < 0.0:
            raise kind("below the floor")
        return sum(link.length for link in arm.links), 1.0 + arm.base[2]

    problem = aw.Problem(TASK.model_copy(update={"reference_point": None}), evaluator=measured)
    crew = Crew(tmp_path / "run", 2, evaluator=measured)

    def search() -> aw.Run:
        return aw.optimize(
            problem, proposer="none", n_init=6, n_total=6, out=tmp_path / "run",
            workers=aw.Workers(2, heartbeat=1), watch=crew.hear,
        )  # fmt: skip

    with pytest.raises(EvaluatorError, match=r"trial \d+: .* failed: \w+: below the floor .* same command"):
        search()
    state["broken"] = False
    found = search()
    crew.join()
    assert not crew.faults
    assert len(found.trials) == 12


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda run: aw.Workers(0), "1 to 10,000"),
        (lambda run: aw.Workers(1, heartbeat=0), "1 to 3600"),
        (lambda run: aw.optimize(PROBLEM, workers=aw.Workers(1)), "workers need a run folder"),
        (lambda run: aw.optimize(PROBLEM, workers=aw.Workers(1, "nonsense"), out=run), "a URL such as"),
        (lambda run: aw.optimize(PROBLEM, workers=aw.Workers(1, "sqlite://"), out=run), "in memory"),
        (lambda run: aw.optimize(PROBLEM, workers=aw.Workers(1, "sqlite:////no/such/place.db"), out=run), "no folder"),
        (
            lambda run: aw.optimize(PROBLEM, workers=aw.Workers(1), in_flight=1, proposer="rules", out=run),
            "does not go with",
        ),
    ],
)
def test_what_cannot_be_is_said(tmp_path: Path, ask: Callable[[Path], object], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        ask(tmp_path / "run")


@pytest.mark.parametrize(
    ("url", "fault", "words"),
    [
        (
            "postgresql://nobody:secret@127.0.0.1:1/db",
            StorageError,
            "cannot use .*nobody@127.0.0.1:1/db: connection failed",
        ),
        ("oddbase://host/db", SettingsError, "oddbase"),
        ("postgresql+asyncpg://host/db", MissingExtraError, r'pip install "armwright\[distributed\]"'),
    ],
)
def test_a_database_that_cannot_be_used_is_said(tmp_path: Path, url: str, fault: type[Exception], words: str) -> None:
    with pytest.raises(fault, match=words) as raised:
        aw.optimize(PROBLEM, workers=aw.Workers(1, url), out=tmp_path / "run")
    assert "secret" not in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_worker_says_what_is_wrong(tmp_path: Path) -> None:
    with_crew(tmp_path / "run", 1, n_total=1)
    aw.optimize(PROBLEM, n_total=1, proposer="none", out=tmp_path / "other")
    with pytest.raises(SettingsError, match="was not begun with --workers"):
        aw.work(tmp_path / "other")
    with pytest.raises(StorageError, match="the database holds no study armwright-run-"):
        aw.work(tmp_path / "run", storage=f"sqlite:///{tmp_path}/empty.db")
    own = aw.evaluator("energy [J]")(lambda arm, task: 1.0)
    with pytest.raises(SettingsError, match=r"is evaluated by armwright itself, not by tests.test_workers"):
        aw.work(tmp_path / "run", own)
    with pytest.raises(RunConflictError, match="workers: evaluate there, None asked"):
        aw.optimize(PROBLEM, proposer="rules", n_init=5, n_step=4, n_total=1, out=tmp_path / "run")


def test_a_damaged_database_is_said_at_once(tmp_path: Path) -> None:
    with_crew(tmp_path / "run", 1, n_total=1)
    (tmp_path / "run" / "workers.db").write_bytes(b"no database, and much longer than a header" * 100)
    for use in (
        lambda: aw.work(tmp_path / "run"),
        lambda: aw.optimize(
            PROBLEM, proposer="rules", n_init=5, n_step=4, n_total=3, out=tmp_path / "run", workers=aw.Workers(1)
        ),
    ):
        with pytest.raises(StorageError, match="file is not a database"):
            use()
    assert len(trials(tmp_path / "run")) == 6  # the run itself is unharmed


def test_a_password_is_written_nowhere(tmp_path: Path) -> None:
    assert shown_url("postgresql://ada:secret@host/db?password=secret") == "postgresql://ada@host/db"
    record = aw.Workers(2, "postgresql://ada:secret@host:5432/db").record(tmp_path)
    assert record.storage == "postgresql://ada@host:5432/db"
    assert "secret" not in repr(aw.Workers(2, "postgresql://ada:secret@host/db"))
    assert shown_url("postgresql://ada@host/db?sslpassword=secret&sslmode=require").endswith("/db?sslmode=require")
    assert shown_url("postgresql://ada:/se[cret@host/db") == "postgresql://ada@host/db"


@pytest.mark.parametrize("password", ["s@cret", "p@ss:word"])
def test_a_password_that_is_no_part_of_a_url_is_not_repeated(tmp_path: Path, password: str) -> None:
    url = f"postgresql://ada:{password}@host/db"
    with_crew(tmp_path / "run", 1, n_total=1)
    for use in (
        lambda: shown_url(url),
        lambda: aw.work(tmp_path / "run", storage=url),
        lambda: aw.optimize(PROBLEM, workers=aw.Workers(1, url), out=tmp_path / "other"),
    ):
        with pytest.raises(SettingsError, match="within the URL @ is %40") as raised:
            use()
        assert "cret" not in str(raised.value)
        assert "word@" not in str(raised.value)


def test_refinements_come_as_often_as_they_are_due(tmp_path: Path) -> None:
    """However many trials are under way, and unrecorded, when one is due."""
    found, _ = with_crew(tmp_path / "run", 3, n_total=20, proposer="none", polish_every=5)
    assert sum(trial.refines is not None for trial in found.trials) == 19 // 5


class Later(Judging):
    """Workers that were given a trial in an earlier session, and that judge the latest first."""

    at_a_time = 2

    def __init__(self, trials: Sequence[FinishedTrial]) -> None:
        self._before = trials
        self._waiting = list(trials)

    def begun(self, recorded: int) -> Sequence[FinishedTrial]:
        return self._before

    def post(self, trial: FinishedTrial) -> None:
        self._waiting.append(trial)

    def results(self) -> dict[int, Judged]:
        trial = self._waiting.pop()
        return {trial.number: judged(PROBLEM, trial)}


def test_an_arm_that_is_drawn_again_before_it_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A later trial, begun in an earlier session, is the arm that an earlier one is drawn with now."""
    settings: dict[str, Any] = {"proposer": "none", "sampler": "random", "n_init": 2, "n_total": 3}
    whole = aw.optimize(PROBLEM, **settings)
    later = FinishedTrial(number=1, source="random", design=whole.trials[0].design, values=())
    monkeypatch.setattr(aw.Workers, "begin", lambda *_: Later([later]))
    found = aw.optimize(PROBLEM, **settings, workers=aw.Workers(2), out=tmp_path / "run")
    assert [trial.number for trial in found.trials] == list(range(5))
    assert found.trials[0].values == found.trials[1].values == whole.trials[0].values
    assert found.trials[0].same_as is None


def by_workers(file: Path, say: Callable[[str], None] = print) -> judging.ByWorkers:
    record = WorkersRecord(storage=sqlite_url(file), study="shared", at_a_time=2, heartbeat=1)
    return judging.ByWorkers(PROBLEM, record.storage, record, say)


def begun(number: int, seed: int) -> FinishedTrial:
    return FinishedTrial(number=number, source="random", design=PROBLEM.space.sample(1, seed)[0], values=())


def board_of(file: Path) -> Board:
    board = Board(sqlite_url(file), "shared", 1, [])
    board.open()
    return board


def test_another_search_on_the_same_study_is_noticed(tmp_path: Path) -> None:
    """As of two copies of a run folder."""
    one, other = by_workers(tmp_path / "db"), by_workers(tmp_path / "db")
    one.post(begun(0, seed=1))
    other.post(begun(0, seed=2))
    with pytest.raises(StorageError, match="trial 0 of the database's study is another design"):
        one.results()
    for search in (one, other):
        search.close()


def test_three_workers_that_die_over_a_design_end_the_search(tmp_path: Path) -> None:
    heard: list[str] = []
    search = by_workers(tmp_path / "db", heard.append)
    search.post(begun(7, seed=1))
    board = board_of(tmp_path / "db")

    def die() -> None:
        posted = board.claim()
        assert posted is not None
        board._storage.set_trial_state_values(board._id(posted.place), TrialState.FAIL)  # as for one that is silent

    for _ in range(2):
        die()
        assert search.results() == {}
    assert heard == ["the worker of trial 7 is not heard any more; another one evaluates it"] * 2
    die()
    with pytest.raises(EvaluatorError, match=r"3 workers died over trial 7, .*its design is \{'origin_x'"):
        search.results()
    board.close()
    search.close()


def test_nobody_is_dead_who_could_not_be_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sign of life of an hour ago: after an outage, at the begin of a search, where the machine slept."""
    search = by_workers(tmp_path / "db")
    search.post(begun(0, seed=1))
    board = board_of(tmp_path / "db")
    assert board.claim() is not None
    with closing(sqlite3.connect(tmp_path / "db")) as database:
        database.execute("UPDATE trial_heartbeats SET heartbeat = datetime('now', '-1 hour')")
        database.commit()

    def state() -> TrialState:
        return board.posted()[0].state

    clock = types.SimpleNamespace(monotonic=lambda: at, time=lambda: at, sleep=lambda _: None)
    at = time.monotonic() + 1.0  # a search that has just begun
    monkeypatch.setattr(board_module, "time", clock)
    board.fail_silent()
    assert state() == TrialState.RUNNING
    at += 3600.0  # the machine slept
    board.fail_silent()
    assert state() == TrialState.RUNNING
    at += 2.9
    board.fail_silent()
    assert state() == TrialState.RUNNING
    at += 0.2  # in all this time there was no other sign
    board.fail_silent()
    assert state() == TrialState.FAIL
    board.close()
    search.close()


def test_a_study_that_was_deleted_is_said(tmp_path: Path) -> None:
    search = by_workers(tmp_path / "db")
    search.post(begun(0, seed=1))
    optuna.delete_study(study_name="shared", storage=sqlite_url(tmp_path / "db"))
    with pytest.raises(StorageError, match="the database holds no study shared"):
        search.results()
    search.close()


def test_a_run_that_goes_on_keeps_its_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none is named: it may have come from the environment."""
    monkeypatch.setenv("ARMWRIGHT_STORAGE", sqlite_url(tmp_path / "shared.db"))
    with_crew(tmp_path / "run", 1, n_total=1)
    monkeypatch.delenv("ARMWRIGHT_STORAGE")
    assert aw.Workers(2).record(tmp_path / "run").storage == sqlite_url(tmp_path / "shared.db")
    found, _ = with_crew(tmp_path / "run", 1, n_total=3)
    assert len(found.trials) == 8
    assert not (tmp_path / "run" / "workers.db").exists()
    with_crew(tmp_path / "own", 1, n_total=1)
    (tmp_path / "own").rename(tmp_path / "moved")
    assert aw.Workers(2).record(tmp_path / "moved").storage == sqlite_url(tmp_path / "moved" / "workers.db")


@pytest.mark.parametrize("name", ["a?b", "a%20b", "a{b}"])
def test_any_folder_may_hold_the_database(tmp_path: Path, name: str) -> None:
    with_crew(tmp_path / name, 1, n_total=1)
    assert (tmp_path / name / "workers.db").exists()
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_run_that_could_not_begin_leaves_its_folder_free(tmp_path: Path) -> None:
    with pytest.raises(StorageError):
        aw.optimize(PROBLEM, workers=aw.Workers(1, "postgresql://127.0.0.1:1/db"), out=tmp_path / "run")
    assert len(aw.optimize(PROBLEM, proposer="none", n_init=2, n_total=1, out=tmp_path / "run").trials) == 3
