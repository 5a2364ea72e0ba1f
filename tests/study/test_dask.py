"""Designs and cells evaluated by local and remote Dask workers."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import armwright as aw
from armwright.exceptions import ClusterError, EvaluatorError, SettingsError
from armwright.experiments.cells import plan_cells
from armwright.experiments.plan import ExperimentPlan
from armwright.experiments.runner import _outcome_of
from armwright.problem.objective import Objective
from armwright.study.workers.cluster import Finished
from tests.support.command_line import start
from tests.support.dask_processes import (
    TASK,
    Bench,
    ShellCluster,
    all_ended,
    descendants,
    wait_until,
)
from tests.torture.short import trials

PAPER = aw.Problem(aw.load_task("target-1"))
QUANTITIES = ("position_error", "torque", "collision", "path_error", "uncovered_fraction")
MANY = aw.Problem(
    aw.Task.model_validate(
        {
            "name": "many",
            "targets": [{"position": [0.4, 0.1, 0.3], "axis": [0.0, 0.0, -1.0]}, [0.3, -0.2, 0.4]],
            "obstacles": [
                {"kind": "cylinder", "name": "pole", "center": [0.2, 0.3, 0.5], "radius": 0.03, "height": 1.0}
            ],
            "cycle": {"closed": False, "steps": [{"to": 1}, {"to": 2}]},
            "workspace": {"low": [0.3, -0.3, 0.1], "high": [0.6, 0.3, 0.5]},
            "objectives": QUANTITIES,
            "constraints": ["length <= 3.0", "self_clearance >= 0.0", "manipulability >= 0.0"],
        }
    )
)
SHORT: dict[str, Any] = {"proposer": "rules", "n_init": 5, "n_step": 4, "n_total": 8}
ASKED = ("--proposer", "rules", "--n-init", "5", "--n-step", "4", "--n-total", "8", "--no-figures")
N_TRIALS = 13


@pytest.fixture(scope="module")
def shell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShellCluster]:
    """A scheduler and two workers."""
    cluster = ShellCluster(tmp_path_factory.mktemp("elsewhere"))
    cluster.only(2)
    yield cluster
    cluster.close()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    (tmp_path / "bench").mkdir()
    return Bench(tmp_path / "bench")


def on(shell: ShellCluster, n_workers: int | None = None) -> aw.Workers:
    return aw.Workers(n_workers, shell.address)


def begin_search(bench: Bench, out: Path, *more: str) -> subprocess.Popen[str]:
    return start("optimize", "target-1", "--evaluator", f"{bench.file}:measure", *ASKED, "--out", out, *more)


def numbers(run: Path) -> list[int]:
    return [trial["number"] for trial in trials(run)]


# --- the same run, wherever it is evaluated ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings",
    [
        {"problem": PAPER, "sampler": "tpe"},
        {"problem": MANY, "sampler": "random"},
    ],
    ids=["tpe", "many quantities"],
)
def test_one_worker_gives_the_in_process_run(tmp_path: Path, shell: ShellCluster, settings: dict[str, Any]) -> None:
    """Runs are bit-identical, apart from seconds."""
    asked = {**SHORT, **settings}
    problem = asked.pop("problem")
    shell.only(2)
    aw.optimize(problem, **asked, out=tmp_path / "here")
    aw.optimize(problem, **asked, out=tmp_path / "there", workers=on(shell, 1))
    assert trials(tmp_path / "there") == trials(tmp_path / "here")


SCRIPT = """
import armwright as aw

@aw.evaluator("reach [m]", "height [m]")
def measure(arm, task):
    return sum(link.length for link in arm.links), 1.0 + arm.base[2]

task = aw.load_task("target-1").model_copy(update={"reference_point": None})
problem = aw.Problem(task, evaluator=measure)
for out, workers in (("here", None), ("there", aw.Workers(1))):
    aw.optimize(problem, proposer="rules", n_init=5, n_step=4, n_total=8, out=out, workers=workers)
"""


@pytest.mark.slow
def test_script_without_a_main_guard_uses_a_local_worker(in_folder: Path) -> None:
    """The evaluator is pickled by value; the script does not run again on the worker."""
    (in_folder / "script.py").write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert trials(in_folder / "there") == trials(in_folder / "here")
    assert numbers(in_folder / "there") == list(range(N_TRIALS))


def test_evaluator_is_shipped_to_workers_and_designs_evaluated_once(
    tmp_path: Path, shell: ShellCluster, bench: Bench
) -> None:
    shell.only(2)
    problem = bench.problem()
    bench.file.unlink()
    notes: list[str] = []
    found = aw.optimize(
        problem, **{**SHORT, "n_total": 30}, out=tmp_path / "run", workers=on(shell),
        watch=lambda progress: notes.append(progress.note),
    )  # fmt: skip
    assert notes[0] == f"evaluating on the Dask cluster at {shell.address}"
    assert numbers(tmp_path / "run") == list(range(35))
    assert set(bench.counts.values()) == {1}
    assert bench.counts.total() == 35 - found.summary["duplicates"]
    for trial in found.trials[:5]:
        assert trial.values == (sum(trial.design.links), 1.0 + trial.design.origin[2])


# --- what is killed ---------------------------------------------------------------------------------------------------


def test_design_of_a_killed_shell_worker_is_reevaluated(tmp_path: Path, shell: ShellCluster, bench: Bench) -> None:
    victim, other = shell.only(2)
    bench.ask("hold")
    notes: list[str] = []

    def kill() -> None:
        wait_until(lambda: {pid for pid, _ in bench.evaluated} == {victim.pid, other.pid})
        victim.kill()
        bench.release("hold")

    killer = threading.Thread(target=kill)
    killer.start()
    found = aw.optimize(
        bench.problem(), **SHORT, out=tmp_path / "run", workers=on(shell),
        watch=lambda progress: notes.append(progress.note),
    )  # fmt: skip
    killer.join()
    (twice,) = [name for name, n in bench.counts.items() if n > 1]
    assert [pid for pid, name in bench.evaluated if name == twice] == [victim.pid, other.pid]
    assert sum("a worker was lost; trial " in note for note in notes) == 1
    assert numbers(tmp_path / "run") == list(range(N_TRIALS))
    assert bench.counts.total() == N_TRIALS - found.summary["duplicates"] + 1


@pytest.mark.slow
@pytest.mark.parametrize(("more", "n"), [(("--workers", "2"), 2), (("--evaluation-timeout", "1000"), 1)])
def test_killed_search_leaves_no_process_and_is_resumed(
    tmp_path: Path, bench: Bench, more: tuple[str, str], n: int
) -> None:
    out = tmp_path / "run"
    bench.ask("hold")
    search = begin_search(bench, out, *more)
    wait_until(lambda: len(bench.evaluated) == n)
    started = descendants(search.pid)
    assert {pid for pid, _ in bench.evaluated} <= {process.pid for process in started}
    search.kill()
    search.communicate()
    assert all_ended(started)
    bench.release("hold")
    assert trials(out) == []
    search = begin_search(bench, out, *more)
    assert (search.communicate()[1], search.returncode) == ("", 0)
    assert numbers(out) == list(range(N_TRIALS))


@pytest.mark.slow
def test_design_that_kills_three_workers_ends_the_search(tmp_path: Path, bench: Bench) -> None:
    bench.ask("die")
    with pytest.raises(
        EvaluatorError, match=r"3 workers were lost over trial 0 .* design: \{.*\}\. Rerun .* --evaluation"
    ) as raised:
        aw.optimize(bench.problem(), **SHORT, out=tmp_path / "run", workers=aw.Workers(1))
    assert len({pid for pid, _ in bench.evaluated}) == len(bench.evaluated) == 3
    assert '"origin_x": ' in str(raised.value)
    bench.release("die")
    assert numbers(tmp_path / "run") == []
    assert len(aw.optimize(bench.problem(), **SHORT, out=tmp_path / "run").trials) == N_TRIALS


@pytest.mark.slow
def test_version_mismatch_and_lost_scheduler_are_one_line(tmp_path: Path, bench: Bench) -> None:
    (tmp_path / "other" / "armwright-9.9.dist-info").mkdir(parents=True)
    (tmp_path / "other" / "armwright-9.9.dist-info" / "METADATA").write_text(
        "Name: armwright\nVersion: 9.9\n", encoding="utf-8"
    )
    out = tmp_path / "run"
    path = os.pathsep.join([str(tmp_path / "other"), os.environ.get("PYTHONPATH", "")])
    cluster = ShellCluster(tmp_path)
    try:
        other = cluster.add_worker(PYTHONPATH=path)
        with pytest.raises(ClusterError, match=r"^a worker has armwright 9\.9 instead of [^,]*; install the same"):
            aw.optimize(bench.problem(), **SHORT, out=out, workers=on(cluster))
        assert numbers(out) == []
        n_evaluated = len(bench.evaluated)  # by a worker that came late
        other.kill()
        cluster.add_worker()
        bench.ask("hold")
        search = begin_search(bench, out, "--scheduler", cluster.address)
        wait_until(lambda: len(bench.evaluated) > n_evaluated)
        cluster.scheduler.kill()
        said, complained = search.communicate()
    finally:
        cluster.close()
    assert search.returncode == 1
    assert complained == (
        f"armwright: lost the connection to the Dask cluster at {cluster.address}; rerun the same command to resume\n"
    )
    assert f"evaluating on the Dask cluster at {cluster.address}\n" in said
    bench.release("hold")
    assert len(aw.optimize(bench.problem(), **SHORT, out=out).trials) == N_TRIALS


# --- what goes wrong --------------------------------------------------------------------------------------------------


def test_worker_evaluator_exception_has_its_traceback_and_design(
    tmp_path: Path, shell: ShellCluster, bench: Bench
) -> None:
    shell.only(2)
    problem = bench.problem()
    bench.file.unlink()  # its lines are in the traceback all the same

    def search() -> aw.StudyResult:
        return aw.optimize(problem, **SHORT, out=tmp_path / "run", workers=on(shell))

    bench.ask("fail")
    with pytest.raises(EvaluatorError, match=r"^the first 5 evaluations all failed: ValueError: no lic") as raised:
        search()
    words = str(raised.value)
    assert json.loads(words[words.index("{") : words.index("}") + 1]).keys() >= {"origin_x", "joint_1", "link_1"}
    (trace,) = raised.value.__notes__
    assert 'in measure\n    raise ValueError("no licence")\nValueError: no licence' in trace
    bench.release("fail")
    assert len(search().trials) == N_TRIALS


@pytest.mark.slow
def test_hanging_evaluation_is_ended_on_a_worker(tmp_path: Path, shell: ShellCluster, bench: Bench) -> None:
    """The run is that of this process, apart from the design whose evaluation hung."""
    shell.only(2)
    bench.ask("hang")
    notes: list[dict[str, str]] = []
    found = aw.optimize(
        bench.problem(), **SHORT, out=tmp_path / "run", workers=on(shell, 1), evaluation_timeout=2.0,
        watch=lambda progress: notes.append(dict(progress.latest_failures)),
    )  # fmt: skip
    assert found.summary["failures"] == {"exception": 0, "timeout": 1, "non_finite": 0}
    assert notes[-1] == {"timeout": "trial 0: no result within 2 s"}
    bench.ask("hang")
    here = aw.optimize(bench.problem(), **SHORT, evaluation_timeout=2.0)
    assert [(t.design, t.values, t.failure) for t in here.trials] == [
        (t.design, t.values, t.failure) for t in found.trials
    ]


def test_worker_objective_exception_has_its_traceback(shell: ShellCluster) -> None:
    shell.only(1)

    def each(evaluation: aw.Evaluation) -> Any:
        raise ValueError("no such thing")

    own = aw.Problem(TASK, objectives=(Objective("own", "", "own", each),))
    with pytest.raises(aw.FailureError, match="ValueError: no such thing") as raised:
        aw.optimize(own, **SHORT, workers=on(shell))
    assert "in each" in "".join(raised.value.__notes__)


@pytest.mark.parametrize(
    ("settings", "fault", "words"),
    [
        ({}, SettingsError, "expected a number of workers or the address of a Dask scheduler"),
        ({"n": 0}, SettingsError, "expected 1 to 10,000 workers, got 0"),
        ({"n": 1, "in_flight": 1}, SettingsError, "in_flight does not go with --workers"),
        ({"scheduler": "tcp://127.0.0.1:9"}, ClusterError, r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"),
    ],
)
def test_invalid_worker_settings_are_one_line(
    monkeypatch: pytest.MonkeyPatch, settings: dict[str, Any], fault: type[Exception], words: str
) -> None:
    monkeypatch.setattr("armwright.study.workers.cluster.CONNECT_SECONDS", 0.5)

    def search(n: int | None = None, scheduler: str | None = None, in_flight: int | None = None) -> None:
        aw.optimize(PAPER, proposer="rules", in_flight=in_flight, workers=aw.Workers(n, scheduler))

    with pytest.raises(fault, match=words) as raised:
        search(**settings)
    assert "\n" not in str(raised.value)


def test_problem_that_cannot_be_pickled_is_one_line() -> None:
    lock = threading.Lock()

    @aw.evaluator("energy [J]")
    def measure(arm: aw.Arm, task: aw.Task) -> float:
        with lock:
            return 1.0

    words = "^the problem cannot be sent to workers: TypeError: cannot pickle '_thread.lock' object"
    with pytest.raises(SettingsError, match=words):
        aw.optimize(aw.Problem(TASK, evaluator=measure), workers=aw.Workers(1))


# --- cells of an experiment -------------------------------------------------------------------------------------------


def test_cell_that_kills_workers_reports_its_failure(tmp_path: Path) -> None:
    (cell, _) = plan_cells(two_cells(n_total=1), tmp_path, tmp_path)[0]
    assert _outcome_of(Finished(cell, is_lost=True)).fault.startswith("3 workers were lost over it")


def two_cells(n_total: int) -> ExperimentPlan:
    method = {"label": "BBO", "proposer": "none", "sampler": "random"}
    content = {"name": "two", "tasks": ["random-3"], "seeds": 2, "n_init": 4, "n_total": n_total}
    return ExperimentPlan.model_validate({**content, "methods": {"bbo": method}})
