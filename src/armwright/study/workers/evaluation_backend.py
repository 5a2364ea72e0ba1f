"""Evaluation of a study's designs one at a time; `dask_backend.py` evaluates them on several workers."""

import json
import time
from dataclasses import dataclass

from armwright.problem.outcomes import Outcome
from armwright.problem.problem import Problem
from armwright.spaces.parameters import Design
from armwright.study.workers.evaluation_process import EvaluationProcess, pickle_problem


@dataclass(frozen=True)
class Evaluated:
    """The outcome of one design and the wall time that it took [s]."""

    outcome: Outcome
    seconds: float


class LocalBackend:
    """Evaluates designs in this process; with a timeout [s], a process of its own runs the custom evaluator."""

    capacity = 1  # designs that may be in flight

    def __init__(self, problem: Problem, timeout: float | None = None) -> None:
        self._problem = problem
        self._process = None if timeout is None else EvaluationProcess(pickle_problem(problem), timeout)
        self._result: tuple[int, Evaluated] | None = None

    def submit(self, number: int, design: Design) -> None:
        """Evaluate the design of trial `number` at once."""
        self._result = number, evaluate_design(self._problem, design, self._process)

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return the trial that was submitted; None after `timeout` [s] if none was."""
        result, self._result = self._result, None
        if result is None and timeout:
            time.sleep(timeout)
        return result

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.close()


def evaluate_design(problem: Problem, design: Design, process: EvaluationProcess | None = None) -> Evaluated:
    """Evaluate a design; `process` runs the custom evaluator if there is one."""
    started = time.perf_counter()
    outcomes = problem.evaluate([design], None if process is None else [process.measure(design)])
    return Evaluated(outcomes[0], time.perf_counter() - started)


def describe_design(design: Design) -> str:
    """Return the parameters of a design as JSON on one line."""
    return json.dumps(dict(design.params))
