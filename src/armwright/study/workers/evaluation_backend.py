"""Where the designs of a study are evaluated: the interface, and the backends that evaluate one design at a time.

`dask_backend.py` has another backend: several worker processes, local ones or those of a cluster.
"""

import json
import time
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from armwright.problem.problem import Outcome, Problem
from armwright.spaces.parameters import Design
from armwright.study.workers.evaluation_process import EvaluationProcess, pickle_problem


@dataclass(frozen=True)
class Evaluated:
    """The outcome of one design and the wall time that it took [s]."""

    outcome: Outcome
    seconds: float


class EvaluationBackend(Protocol):
    """Evaluates the designs of trials, in any order.

    A backend is owned by one study, which submits no more than `capacity` designs before it takes results.
    """

    @property
    def capacity(self) -> int:
        """Designs that may be in flight."""
        ...

    def submit(self, number: int, design: Design) -> None:
        """Start the evaluation of trial `number`."""
        ...

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return the number of a trial that finished and its outcome.

        Args:
            timeout: how long to wait for one [s].

        Returns:
            One result, or None if there is none yet.

        Raises:
            EvaluatorError: an evaluator cannot be loaded, or the workers that ran it were lost.
            ClusterError: the cluster was lost.
        """
        ...

    def close(self) -> None:
        """Abandon what is in flight."""
        ...


class InProcessBackend(EvaluationBackend):
    """Evaluates in this process, one design at a time."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._results: deque[tuple[int, Evaluated]] = deque()

    @property
    def capacity(self) -> int:
        """One design."""
        return 1

    def submit(self, number: int, design: Design) -> None:
        """Evaluate the design at once."""
        self._results.append((number, evaluate_design(self._problem, design)))

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return the trial that was submitted."""
        if self._results:
            return self._results.popleft()
        if timeout:
            time.sleep(timeout)  # a paused study looks again then
        return None

    def close(self) -> None:
        """Do nothing: no design is in flight."""


class ProcessBackend(EvaluationBackend):
    """Runs the custom evaluator in a process of its own, one design at a time, and ends it after a timeout.

    Args:
        problem: the problem.
        timeout: for one evaluation [s].
    """

    def __init__(self, problem: Problem, timeout: float) -> None:
        self._problem = problem
        self._process = EvaluationProcess(pickle_problem(problem), timeout)
        self._current: tuple[int, Design] | None = None
        self._started = 0.0

    @property
    def capacity(self) -> int:
        """One design."""
        return 1

    def submit(self, number: int, design: Design) -> None:
        """Send a design to the process."""
        self._process.submit(design)
        self._current, self._started = (number, design), time.perf_counter()

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return the trial that was submitted, if it finished."""
        if self._current is None:
            time.sleep(timeout)  # a paused study looks again then
            return None
        measured = self._process.result(timeout)
        if measured is None:
            return None
        (number, design), self._current = self._current, None
        outcome = self._problem.evaluate([design], [measured])[0]
        return number, Evaluated(outcome, time.perf_counter() - self._started)

    def close(self) -> None:
        """End the process."""
        self._process.close()


def evaluate_design(problem: Problem, design: Design, process: EvaluationProcess | None = None) -> Evaluated:
    """Evaluate a design; `process` runs the custom evaluator if there is one."""
    started = time.perf_counter()
    outcomes = problem.evaluate([design], None if process is None else [process.measure(design)])
    return Evaluated(outcomes[0], time.perf_counter() - started)


def describe_design(design: Design) -> str:
    """Return the parameters of a design as JSON on one line."""
    return json.dumps(dict(design.params))
