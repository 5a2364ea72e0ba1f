"""Processes that share the evaluations of a direct search."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import psutil
import pytest

from armwright import Problem, evaluator, find_front, load_task
from armwright.problem.estimates import estimates
from armwright.problem.outcomes import Outcomes
from armwright.spaces.design_space import default_space
from armwright.spaces.tolerance import TOLERANCE
from armwright.study.front import direct_search, evaluation_pool
from armwright.study.front.evaluation_pool import EvaluationPool
from tests.support.command_line import PATIENCE, wait_until

PROBLEM = Problem(load_task("dispensing"), default_space("dispensing"))
MATRIX = PROBLEM.space.matrix(PROBLEM.space.sample(25, seed=3))
PARENT = """
from armwright.study.front import evaluation_pool
from tests.study.test_evaluation_pool import PROBLEM
evaluation_pool.cores = lambda: 2
evaluation_pool.EvaluationPool(PROBLEM).start()
print("started", flush=True)
input()
"""

pytestmark = pytest.mark.slow


def children(of: int | None = None) -> list[psutil.Process]:
    return [each for each in psutil.Process(of).children() if evaluation_pool.__name__ in each.cmdline()]


START, SHARE = EvaluationPool.start, EvaluationPool._share


def start(pool: EvaluationPool) -> None:
    """Start the other processes, and wait until they are ready."""
    START(pool)
    wait_until(lambda: all(other.is_ready() for other in pool._others))


@pytest.fixture
def pool(monkeypatch: pytest.MonkeyPatch) -> Iterator[EvaluationPool]:
    """A pool with two other processes."""
    monkeypatch.setattr(evaluation_pool, "cores", lambda: 3)
    pool = EvaluationPool(PROBLEM)
    start(pool)
    assert len(children()) == 2
    yield pool
    pool.close()
    assert not children()


def assert_same(found: Outcomes, expected: Outcomes) -> None:
    for name in ("values", "violations", "entry", "q"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name


def test_outcomes_are_those_of_one_process_to_the_bit(pool: EvaluationPool) -> None:
    expected = PROBLEM.evaluate(MATRIX)
    assert expected.entry is not None
    for n in (0, 1, 2, 3, len(MATRIX)):
        assert_same(pool.evaluate(MATRIX[:n]), PROBLEM.evaluate(MATRIX[:n]))
    assert_same(pool.estimates(MATRIX, expected.entry), estimates(PROBLEM, MATRIX, expected.entry))


def test_work_of_a_process_that_is_killed_or_hangs_is_done_by_others(
    pool: EvaluationPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = PROBLEM.evaluate(MATRIX)
    killed, stopped = children()
    killed.kill()
    assert_same(pool.evaluate(MATRIX), expected)
    assert children() == [stopped]
    monkeypatch.setattr(evaluation_pool, "PATIENCE", 0.1)
    stopped.send_signal(signal.SIGSTOP)
    assert_same(pool.evaluate(MATRIX), expected)
    assert not children()
    assert_same(pool.evaluate(MATRIX), expected)


def test_processes_end_with_the_one_that_started_them() -> None:
    command = [sys.executable, "-c", PARENT]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        started = children(parent.pid)
        parent.kill()
    assert started
    assert psutil.wait_procs(started, PATIENCE)[1] == []


def test_search_finds_the_same_with_other_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = find_front(PROBLEM, evaluations=300, seed=1)
    shares = list[int]()

    def share(pool: EvaluationPool, *work: Any) -> Outcomes:
        shares.append(len(children()))
        return SHARE(pool, *work)

    monkeypatch.setattr(EvaluationPool, "start", start)
    monkeypatch.setattr(EvaluationPool, "_share", share)
    monkeypatch.setattr(evaluation_pool, "cores", lambda: 2)
    monkeypatch.setattr(direct_search, "LONG", 300)
    shared = find_front(PROBLEM, evaluations=300, seed=1)
    assert set(shares) == {1}
    assert np.array_equal(shared.history.values, alone.history.values)
    assert shared.summary["hypervolume"] == alone.summary["hypervolume"]
    assert not children()


@evaluator("reach [m]")
def reach(arm: Any, task: Any) -> float:
    return sum(link.length for link in arm.links)


@pytest.mark.parametrize(
    "problem",
    [
        Problem(PROBLEM.task, PROBLEM.space, evaluator=reach),
        replace(PROBLEM, objectives=(replace(PROBLEM.objectives[0], name="mine"), *PROBLEM.objectives[1:])),
    ],
    ids=["evaluator", "objective"],
)
def test_what_the_users_code_defines_stays_in_this_process(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation_pool, "cores", lambda: 3)
    pool = EvaluationPool(problem)
    pool.start()
    assert not children()


def test_copies_within_the_tolerance_are_evaluated_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation_pool, "cores", lambda: 2)
    robust = replace(PROBLEM, tolerance=TOLERANCE)
    pool = EvaluationPool(robust)
    start(pool)
    assert_same(pool.evaluate(MATRIX[:3]), robust.evaluate(MATRIX[:3]))
    pool.close()
