"""Evaluations that fail: what is recorded, what samplers learn, when a run stops."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright import child_process
from armwright.exceptions import EvaluatorError
from armwright.llm.feedback import Feedback
from armwright.search.samplers import SAMPLERS
from armwright.study.workers import evaluation_process
from tests.torture.short import armwright

TASK = aw.load_task("target-1").model_copy(update={"reference_point": None})
SPACE = aw.paper_space(joints=3)
SHORT: dict[str, Any] = {"proposer": "rules", "n_init": 6, "n_step": 4, "n_total": 14}


def length_of(arm: aw.Arm) -> float:
    return sum(link.length for link in arm.links)


@aw.evaluator("reach [m]", "height [m]")
def sometimes(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Fail for bases on one side, where the best values would be."""
    if arm.base[0] < 0.0:
        raise ValueError("no licence")
    return length_of(arm), math.nan if arm.base[1] > 0.5 else 1.0 + arm.base[2]


@aw.evaluator("reach [m]", "height [m]")
def never(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Fail for every arm."""
    raise TypeError("wrong argument")


def recorded(run: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (run / "trials.jsonl").read_text(encoding="utf-8").splitlines()]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run with failures of two kinds."""
    out = tmp_path_factory.mktemp("failures") / "run"
    aw.optimize(aw.Problem(TASK, SPACE, evaluator=sometimes), **SHORT, out=out)
    return out


def test_failed_trials_are_recorded_without_values_and_read_as_infinite(run: Path) -> None:
    _, history = aw.read_run(run)
    failed = [trial for trial in recorded(run) if "failure" in trial]
    assert {trial["failure"]["kind"] for trial in failed} == {"exception", "non_finite"}
    assert all(trial["values"] == [] for trial in failed)
    assert [trial["number"] for trial in failed] == np.flatnonzero(history.failed).tolist()
    assert np.isinf(history.values[history.failed]).all()
    assert np.isfinite(history.values[~history.failed]).all()
    raised = next(trial for trial in failed if trial["failure"]["kind"] == "exception")
    assert raised["failure"]["reason"] == "ValueError: no licence"
    assert raised["failure"]["place"].startswith("test_failures.py, line ")


def test_failed_trials_are_in_no_front_and_no_hypervolume(run: Path) -> None:
    _, history = aw.read_run(run)
    assert not history.failed[[member.number for member in history.front]].any()
    assert history.reference_point is not None
    expected = aw.hypervolume(history.values[~history.failed], history.reference_point)
    assert history.hypervolumes[-1] == pytest.approx(expected)
    assert not history.feasible[history.failed].any()


def test_summary_counts_failures_by_kind(run: Path) -> None:
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    kinds = [trial["failure"]["kind"] for trial in recorded(run) if "failure" in trial]
    assert summary["failures"] == {kind: kinds.count(kind) for kind in ("exception", "timeout", "non_finite")}
    table = (run / "trials.csv").read_text(encoding="utf-8")
    assert "inf" not in table
    assert table.splitlines()[0].endswith(",reach,height,failure")


@pytest.mark.slow
def test_pages_figures_and_prompts_show_failures(run: Path) -> None:
    assert aw.write_report(run).is_file()
    assert aw.write_figures(run)
    _, history = aw.read_run(run)
    feedback = Feedback(history, 0)
    feedback_of = {record["number"]: record for record in feedback.records(feedback.others, [0])}
    shown = [record["e_all"] for n, record in feedback_of.items() if n in np.flatnonzero(history.failed)]
    assert shown
    assert all(text.startswith("none, its evaluation failed (") for text in shown)
    assert all("inf" not in str(record["e_all"]) for record in feedback_of.values())


@pytest.mark.parametrize("sampler", [name for name in SAMPLERS if name != "gp"])
def test_run_with_failures_resumes_to_the_bit(tmp_path: Path, sampler: str) -> None:
    problem = aw.Problem(TASK, SPACE, evaluator=sometimes)
    whole = aw.optimize(problem, **SHORT, sampler=sampler)
    aw.optimize(problem, **SHORT | {"n_total": 5}, sampler=sampler, out=tmp_path / "run")
    resumed = aw.optimize(problem, **SHORT, sampler=sampler, out=tmp_path / "run")
    assert [(t.design, t.values, t.failure) for t in resumed.trials] == [
        (t.design, t.values, t.failure) for t in whole.trials
    ]


@pytest.mark.slow
def test_sampler_learns_to_avoid_failures() -> None:
    """TPE proposes fewer failing designs than a random search."""
    problem = aw.Problem(TASK, SPACE, evaluator=sometimes)

    def failed(sampler: str) -> int:
        runs = [aw.optimize(problem, proposer="none", sampler=sampler, n_total=40, seed=seed) for seed in range(3)]
        return sum(int(run.history.failed[10:].sum()) for run in runs)

    assert failed("tpe") < 0.6 * failed("random")


def test_run_stops_if_the_first_evaluations_fail_alike(tmp_path: Path) -> None:
    """The trials are discarded, so that a mended evaluator begins anew."""
    out = tmp_path / "run"
    with pytest.raises(
        EvaluatorError, match=r"^the first 5 evaluations all failed: TypeError: wrong argument"
    ) as raised:
        aw.optimize(aw.Problem(TASK, SPACE, evaluator=never), **SHORT, out=out)
    assert raised.value.exit_code == 1
    (trace,) = raised.value.__notes__
    assert 'test_failures.py", line' in trace
    assert recorded(out) == []
    going_on = aw.optimize(aw.Problem(TASK, SPACE, evaluator=never), **SHORT, out=out, allow_failures=True)
    assert going_on.summary["failures"]["exception"] == len(going_on.trials) == 20
    assert going_on.front == []
    assert going_on.summary["hypervolume"]["final"] is None
    assert aw.write_report(out).is_file()
    assert aw.write_figures(out) == []


def test_run_goes_on_if_one_of_the_first_evaluations_succeeds() -> None:
    calls: list[int] = []

    @aw.evaluator("reach [m]")
    def second(arm: aw.Arm, task: aw.Task) -> float:
        calls.append(1)
        if len(calls) != 2:
            raise TypeError("wrong argument")
        return length_of(arm)

    found = aw.optimize(aw.Problem(TASK, SPACE, evaluator=second), **SHORT)
    assert found.summary["failures"]["exception"] == len(calls) - 1
    assert [member.number for member in found.front] == [1]


def test_reference_point_of_rare_successes_is_the_same_after_a_resumption(tmp_path: Path) -> None:
    @aw.evaluator("reach [m]", "height [m]")
    def rare(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
        if arm.base[0] < 0.3:
            raise ValueError("out of reach")
        return length_of(arm), 1.0 + arm.base[2]

    problem = aw.Problem(TASK, SPACE, evaluator=rare)
    settings: dict[str, Any] = {"proposer": "none", "sampler": "random", "n_init": 6, "allow_failures": True}
    whole = aw.optimize(problem, **settings, n_total=24, out=tmp_path / "whole")
    parts = [aw.optimize(problem, **settings, n_total=n, out=tmp_path / "parts") for n in (2, 8, 24)]
    points = [part.config.reference_point for part in parts]
    assert points[-1] == whole.config.reference_point
    assert points[0] != points[-1]  # fewer than five have succeeded
    assert 0.0 < whole.history.failed.mean() < 1.0


@pytest.mark.slow
def test_idle_process_of_an_evaluator_ends_and_is_replaced() -> None:
    """It ends by itself although one of its threads waits for the end of its parent."""
    evaluator = aw.evaluator("reach [m]")(lambda arm, task: length_of(arm))
    pickled = evaluation_process.pickle_problem(aw.Problem(TASK, SPACE, evaluator=evaluator))
    process = evaluation_process.EvaluationProcess(pickled, timeout=60.0)
    design = SPACE.sample(1, 0)[0]
    command = "import armwright.study.workers.evaluation_process as it; it.IDLE_SECONDS = 0.0; it.main()"

    def start(module: str, connection: int, **options: Any) -> subprocess.Popen[Any]:
        return subprocess.Popen([sys.executable, "-c", command, str(connection)], start_new_session=True, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(child_process, "start_module", start)
        process._start()
        assert process._process is not None
        assert process._process.wait() == evaluation_process.IDLE_EXIT
    assert process.measure(design) == (pytest.approx(length_of(SPACE.arm(design))),)
    process.close()


@pytest.mark.slow
def test_timeout_ends_code_that_holds_the_lock_and_crashes_are_failures() -> None:
    @aw.evaluator("reach [m]")
    def fragile(arm: aw.Arm, task: aw.Task) -> float:
        import ctypes
        import os
        import signal

        if arm.base[0] < -0.5:
            ctypes.PyDLL(None).sleep(1000)
        if arm.base[0] > 0.5:
            os.kill(os.getpid(), signal.SIGSEGV)
        return sum(link.length for link in arm.links)

    problem = aw.Problem(TASK, SPACE, evaluator=fragile)
    found = aw.optimize(problem, proposer="none", n_init=8, n_total=1, evaluation_timeout=1.0)
    for trial in found.trials:
        x = trial.design.origin[0]
        expected = "timeout" if x < -0.5 else "exception" if x > 0.5 else None
        assert (trial.failure.kind if trial.failure else None) == expected
    reasons = {trial.failure.reason for trial in found.trials if trial.failure}
    assert reasons == {"no result within 1 s", "the process of the evaluator was ended by SIGSEGV"}


@pytest.mark.slow
@pytest.mark.parametrize("scale", [-1e60, 5e-324])
def test_values_at_the_limits_of_numbers_are_modelled_and_drawn(tmp_path: Path, scale: float) -> None:
    """Warnings are errors."""
    measure = aw.evaluator("reach [m]", "height [m]")(lambda arm, task: (scale * arm.base[0], scale * arm.base[2]))
    run = aw.optimize(aw.Problem(TASK, SPACE, evaluator=measure), **SHORT, out=tmp_path / "run")
    assert not run.history.failed.any()
    json.dumps(run.summary, allow_nan=False, default=str)
    assert aw.write_report(tmp_path / "run").is_file()
    assert aw.write_figures(tmp_path / "run")


RAISING = """
import armwright as aw, asyncio, os, sys

class Unprintable(Exception):
    def __str__(self):
        raise ValueError

def fork(child):
    if os.fork() == 0:
        child()

def stop(fault):
    raise fault

FAULTS = {
    "CancelledError": lambda: stop(asyncio.CancelledError()),
    "GeneratorExit": lambda: stop(GeneratorExit()),
    "SystemExit: 3": lambda: sys.exit(3),
    "Unprintable: (its __str__ raises ValueError)": lambda: stop(Unprintable()),
    "none, its fork returns": lambda: fork(lambda: None),
    "none, its fork raises": lambda: fork(lambda: stop(ValueError())),
}

@aw.evaluator("reach [m]", "number")
def measure(arm, task):
    number = int(abs(arm.base[0]) * 1e6) % len(FAULTS)
    list(FAULTS.values())[number]()
    return sum(link.length for link in arm.links), number + 1.0
"""


@pytest.mark.slow
def test_faults_of_an_evaluator_are_failed_trials_wherever_it_runs(in_folder: Path) -> None:
    (in_folder / "raising.py").write_text(RAISING, encoding="utf-8")
    faults: dict[str, object] = {}
    exec(RAISING, faults)  # for the names of the faults
    names = list(faults["FAULTS"])  # type: ignore[call-overload]
    runs = {}
    for place, options in (("here", []), ("process", ["--evaluation-timeout", "60"]), ("workers", ["--workers", "2"])):
        done = armwright(
            "optimize", "target-1", "--evaluator", "raising.py:measure", "--proposer", "none", "--sampler", "random",
            "--n-init", "20", "--n-total", "20", "--no-figures", "--allow-failures", "--json", "--out", place, *options,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
        runs[place] = [
            [trial["number"], trial["params"]["origin_x"], trial.get("failure", {}).get("reason", "")]
            for trial in recorded(Path(place))
        ]
        assert json.loads(done.stdout)["n_trials"] == len(runs[place]) == 40
    for number, x, reason in runs["here"]:
        expected = names[int(abs(x) * 1e6) % len(names)]
        assert reason == ("" if expected.startswith("none") else expected), number
    assert runs["here"] == runs["process"] == runs["workers"]
