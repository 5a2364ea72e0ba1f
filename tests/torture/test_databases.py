"""Workers on a real PostgreSQL: each of them, the search and the database killed, stopped, and away for a while."""

import os
import random
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import optuna
import pytest

import armwright as aw
from armwright.workers import judging
from tests.boards import optunas
from tests.postgres import PostgresServer
from tests.torture.lives import n_lines, trials

TASK = aw.load_task("target-1")
N_TOTAL = 30  # trials of the search below


@pytest.fixture(autouse=True)
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time between two looks is no part of what is tested."""
    monkeypatch.setattr(judging, "LOOK_EVERY", 0.01)


EVALUATOR = """
import hashlib, os, pathlib, time
import armwright as aw

HERE = pathlib.Path(__file__).parent

@aw.evaluator("reach [m]", "height [m]")
def measured(arm, task):
    name = hashlib.sha256(repr(arm).encode()).hexdigest()[:12]
    with open(HERE / "evaluated", "a") as log:
        log.write(f"{os.getpid()} {name}\\n")
    while (HERE / "hold").exists():
        time.sleep(0.01)
    return sum(link.length for link in arm.links), 1.0 + arm.base[2]
"""


class Place:
    """A folder with an evaluator that is held as long as the file `hold` is there."""

    def __init__(self, folder: Path, storage: str) -> None:
        self.folder = folder
        self.run = folder / "run"
        (folder / "sim.py").write_text(EVALUATOR)
        self._storage = storage
        self.search_: Future[aw.Run] | None = None

    def search(self, n_total: int = 10, at_a_time: int = 2) -> aw.Run:
        problem = aw.Problem(
            TASK.model_copy(update={"reference_point": None}),
            evaluator=aw.load_evaluator(f"{self.folder}/sim.py:measured"),
        )
        return aw.optimize(
            problem, proposer="rules", n_init=5, n_step=5, n_total=n_total, out=self.run,
            workers=aw.Workers(at_a_time, self._storage, heartbeat=1), watch=self._hear,
        )  # fmt: skip

    def _hear(self, progress: Any) -> None:
        self.heard.append(progress.note)
        self.news.set()

    def begin(self, n_total: int = 10, at_a_time: int = 2) -> Future[aw.Run]:
        self.heard: list[str] = []
        self.news = threading.Event()
        self.search_ = ThreadPoolExecutor(1).submit(self.search, n_total, at_a_time)
        return self.search_

    def wait_for(self, there: Callable[[], bool]) -> None:
        """A bounded wait for something that other processes do."""
        gone = threading.Event()
        for _ in range(6000):
            if there():
                return
            if self.search_ is not None and self.search_.done():
                self.search_.result()  # raises what ended it
            gone.wait(0.01)
        raise AssertionError(f"it did not come; heard: {self.heard}, evaluated: {self.evaluated}")

    @contextmanager
    def workers(self, n: int) -> Iterator[list[subprocess.Popen[str]]]:
        self.wait_for(lambda: any("armwright worker" in words for words in self.heard))
        command = [sys.executable, "-m", "armwright", "worker", "run", "--evaluator", "sim.py:measured"]
        started = [
            subprocess.Popen(command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            for _ in range(n)
        ]
        try:
            yield started
        finally:
            for process in started:
                process.kill()
                process.wait()
                assert process.stdout is not None
                process.stdout.close()

    @property
    def evaluated(self) -> list[tuple[int, str]]:
        file = self.folder / "evaluated"
        lines = file.read_text().splitlines() if file.exists() else []
        return [(int(line.split()[0]), line.split()[1]) for line in lines]


@pytest.fixture
def place(tmp_path: Path, postgres: PostgresServer) -> Place:
    return Place(tmp_path, postgres.database())


@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
def test_the_trial_of_a_killed_worker_is_evaluated_by_another(place: Place) -> None:
    (place.folder / "hold").touch()
    search = place.begin()
    with place.workers(2) as workers:
        place.wait_for(lambda: len(place.evaluated) == 2)
        workers[0].kill()
        workers[0].wait()
        (place.folder / "hold").unlink()
        found = search.result()
        words, _ = workers[1].communicate()
        assert workers[1].returncode == 0
        assert "the search is over" in words
    assert any("is not heard any more" in words for words in place.heard)
    (twice,) = [name for name, n in Counter(name for _, name in place.evaluated).items() if n > 1]
    assert {pid for pid, name in place.evaluated if name == twice} == {workers[0].pid, workers[1].pid}
    assert [trial.number for trial in found.trials] == list(range(15))
    with optunas(place.run) as study:
        trials = study.trials
    states = Counter(trial.state.name for trial in trials)
    assert states == {"COMPLETE": 15 - found.summary["same_arms"], "FAIL": 1}
    retry = optuna.storages.RetryHeartbeatStaleTrialCallback
    assert sum(retry.retried_trial_number(trial) is not None for trial in trials) == 1


def test_a_worker_that_is_stopped_gives_its_trial_back_at_once(place: Place) -> None:
    (place.folder / "hold").touch()
    search = place.begin()
    with place.workers(2) as workers:
        place.wait_for(lambda: len(place.evaluated) == 2)
        workers[0].send_signal(signal.SIGTERM)
        words, _ = workers[0].communicate()
        assert workers[0].returncode == 130
        assert "Traceback" not in words
        (place.folder / "hold").unlink()
        assert len(search.result().trials) == 15
    assert not any("is not heard any more" in words for words in place.heard)


def test_a_worker_that_wakes_too_late_changes_nothing(place: Place) -> None:
    (place.folder / "hold").touch()
    search = place.begin()
    with place.workers(2) as workers:
        place.wait_for(lambda: len(place.evaluated) == 2)
        os.kill(workers[0].pid, signal.SIGSTOP)
        (place.folder / "hold").unlink()
        found = search.result()
        os.kill(workers[0].pid, signal.SIGCONT)
        words, _ = workers[0].communicate()
        assert workers[0].returncode == 0
        assert "too late" in words
    assert [trial.number for trial in found.trials] == list(range(15))


def test_a_database_that_is_away_for_a_while_is_waited_for(tmp_path: Path, postgres: PostgresServer) -> None:
    place = Place(tmp_path, postgres.database())
    (place.folder / "hold").touch()
    search = place.begin()
    with place.workers(2) as workers:
        place.wait_for(lambda: len(place.evaluated) == 2)
        postgres.stop("immediate")
        try:
            (place.folder / "hold").unlink()
            place.wait_for(lambda: any("the database does not answer" in words for words in place.heard))
        finally:
            postgres.start()
        found = search.result()
        assert [process.wait() for process in workers] == [0, 0]
    assert any("the database answers again" in words for words in place.heard)
    assert [trial.number for trial in found.trials] == list(range(15))
    assert set(Counter(name for _, name in place.evaluated).values()) == {1}


def test_a_search_that_is_killed_goes_on_with_its_workers(place: Place) -> None:
    """kill -9 of the search itself, at a moment when designs are under way."""
    (place.folder / "hold").touch()
    command = [
        sys.executable, "-m", "armwright", "optimize", "target-1", "--evaluator", "sim.py:measured", "--workers", "2",
        "--proposer", "rules", "--n-init", "5", "--n-step", "5", "--n-total", "10", "--no-figures", "--out", "run",
    ]  # fmt: skip
    environment = {**os.environ, "ARMWRIGHT_STORAGE": place._storage}
    place.heard = ["armwright worker"]
    with subprocess.Popen(command, cwd=place.folder, env=environment, stdout=subprocess.PIPE, text=True) as search:
        assert search.stdout is not None
        next(line for line in search.stdout if "start 2 of: armwright worker run" in line)
        with place.workers(2) as workers:
            place.wait_for(lambda: len(place.evaluated) == 2)
            search.kill()
            search.wait()
            (place.folder / "hold").unlink()
            again = subprocess.run(command, cwd=place.folder, env=environment, capture_output=True, text=True)
            assert again.returncode == 0, again.stderr
            assert [process.wait() for process in workers] == [0, 0]
    assert [record["number"] for record in trials(place.run)] == list(range(15))
    assert set(Counter(name for _, name in place.evaluated).values()) == {1}


# --- at random moments ------------------------------------------------------------------------------------------------

SEARCH = f"""
import sys
import armwright as aw

problem = aw.Problem(
    aw.load_task("target-1").model_copy(update={{"reference_point": None}}),
    evaluator=aw.load_evaluator("sim.py:measured"),
)
out, at_a_time = sys.argv[1], int(sys.argv[2])
workers = aw.Workers(at_a_time, heartbeat=1) if at_a_time else None
aw.optimize(
    problem, proposer="rules", n_init=5, n_step=5, n_total={N_TOTAL}, out=out, workers=workers,
    watch=lambda progress: print(progress.note, flush=True),
)
"""


class Killed:
    """A search and three workers, each a process, begun again when it was killed."""

    def __init__(self, folder: Path, storage: str, at_a_time: int) -> None:
        self._folder = folder
        self._at_a_time = at_a_time
        self._environment = {**os.environ, "ARMWRIGHT_STORAGE": storage}
        self._log = (folder / "words").open("ab")
        self.workers: list[subprocess.Popen[bytes]] = []
        self.search = self._begin("search.py", "run", str(at_a_time))
        self.wait_for(lambda: "start" in self.words)
        self.workers += [self._begin_worker() for _ in range(3)]

    @property
    def words(self) -> str:
        """What all of them said."""
        return (self._folder / "words").read_text()

    def _begin(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, *arguments], cwd=self._folder, env=self._environment, stdin=subprocess.DEVNULL,
            stdout=self._log, stderr=self._log,
        )  # fmt: skip

    def _begin_worker(self) -> subprocess.Popen[bytes]:
        return self._begin("-m", "armwright", "worker", "run", "--evaluator", "sim.py:measured")

    def wait_for(self, there: Callable[[], bool]) -> bool:
        """Until then, or until the search ends; whether it goes on."""
        while self.search.poll() is None and not there():
            threading.Event().wait(0.003)
            self._begin_again()
        return self.search.poll() is None

    def _begin_again(self) -> None:
        """A worker that begins while the database is away ends at once, and says so."""
        for number, worker in enumerate(self.workers):
            if worker.poll() == 1:
                assert "cannot use" in self.words, self.words
                self.workers[number] = self._begin_worker()

    def kill_search(self) -> None:
        self.search.kill()
        self.search.wait()
        self.search = self._begin("search.py", "run", str(self._at_a_time))

    def kill_worker(self, number: int) -> None:
        self.workers[number].kill()
        self.workers[number].wait()
        self.workers[number] = self._begin_worker()

    def end(self) -> None:
        """All come to their end by themselves."""
        self.wait_for(lambda: False)
        assert [process.wait() for process in (self.search, *self.workers)] == [0] * 4, self.words
        self._log.close()


@pytest.mark.parametrize("at_a_time", [1, 3])
def test_whoever_is_killed_each_trial_is_recorded_once(
    tmp_path: Path, postgres: PostgresServer, at_a_time: int, kills: int, record_property: Callable[[str, object], None]
) -> None:
    """Designs one at a time make the run of a search that was never killed and has no workers, to the bit."""
    (tmp_path / "sim.py").write_text(EVALUATOR)
    (tmp_path / "search.py").write_text(SEARCH)
    subprocess.run([sys.executable, "search.py", "whole", "0"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "evaluated").unlink()
    chance = random.Random(at_a_time)
    crew = Killed(tmp_path, postgres.database(), at_a_time)
    fell: Counter[str] = Counter()
    wanted = max(1, kills // 10)
    for _ in range(wanted):
        goal = min(N_TOTAL, n_lines(tmp_path / "run" / "trials.jsonl") + chance.randint(0, 2 * N_TOTAL // wanted))
        if not crew.wait_for(lambda goal=goal: n_lines(tmp_path / "run" / "trials.jsonl") >= goal):
            break
        threading.Event().wait(chance.uniform(0.0, 0.05))
        victim = chance.choice(("search", "worker", "worker", "database"))
        if victim == "search":
            crew.kill_search()
        elif victim == "worker":
            crew.kill_worker(chance.randrange(3))
        else:
            postgres.stop("immediate")
            postgres.start()
        fell[victim] += 1
    crew.end()
    assert "Traceback" not in crew.words
    whole, there = trials(tmp_path / "whole"), trials(tmp_path / "run")
    assert [trial["number"] for trial in there] == list(range(5 + N_TOTAL))
    if at_a_time == 1:
        assert there == whole
    evaluated = Counter(line.split()[1] for line in (tmp_path / "evaluated").read_text().splitlines())
    assert evaluated.total() - len(evaluated) <= fell["worker"]
    with optunas(tmp_path / "run") as study:
        done = [trial.user_attrs["number"] for trial in study.trials if trial.state.name == "COMPLETE"]
    assert sorted(done) == [trial["number"] for trial in there if trial.get("same_as") is None]
    record_property(
        f"workers, {at_a_time} at a time", ", ".join(f"{n} x {who} killed" for who, n in sorted(fell.items()))
    )
