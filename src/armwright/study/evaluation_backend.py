"""Where the designs of a study are evaluated: the interface, and the backend that uses this process.

`dask_backend.py` has the other backend: worker processes, local ones or those of a cluster.
"""

import json
import time
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from armwright.exceptions import EvaluatorError
from armwright.problem.problem import Outcome, Problem
from armwright.spaces.parameters import Design


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
            EvaluatorError: an evaluator failed, or the workers that ran it were lost.
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
        self._results.append((number, evaluate_trial(self._problem, number, design)))

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return the trial that was submitted."""
        if self._results:
            return self._results.popleft()
        if timeout:
            time.sleep(timeout)  # a paused study looks again then
        return None

    def close(self) -> None:
        """Do nothing: no design is in flight."""


def evaluate_trial(problem: Problem, number: int, design: Design) -> Evaluated:
    """Evaluate the design of a trial.

    Raises:
        EvaluatorError: the evaluator failed. The message names the trial and the design; the traceback of the
            evaluator's code is a note of the exception, which also comes back from other processes.
    """
    started = time.perf_counter()
    try:
        outcome = problem.evaluate([design])[0]
    except EvaluatorError as failure:
        named = EvaluatorError(
            f"trial {number}: {failure}; design: {describe_design(design)}. Fix it and rerun the same command to resume"
        )
        for note in getattr(failure, "__notes__", ()):
            named.add_note(note)
        raise named from failure.__cause__
    return Evaluated(outcome, time.perf_counter() - started)


def describe_design(design: Design) -> str:
    """Return the parameters of a design as JSON on one line."""
    return json.dumps(dict(design.params))
