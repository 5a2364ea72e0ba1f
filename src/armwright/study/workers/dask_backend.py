"""Evaluation of a study's designs by Dask workers: local processes, or those of an existing cluster."""

import threading
from collections.abc import Callable
from typing import cast

from armwright.exceptions import EvaluatorError
from armwright.problem.problem import Problem
from armwright.spaces.parameters import Design
from armwright.study.workers.cluster import MAX_LOSSES, Cluster, Workers
from armwright.study.workers.evaluation_backend import Evaluated, describe_design, evaluate_design
from armwright.study.workers.evaluation_process import EvaluationProcess, pickle_problem, unpickle_problem


class DaskBackend:
    """Evaluates designs on workers, which get the problem and its evaluator by value.

    An evaluation may take `timeout` [s]; None for no limit. `notify` is called with news for the user.

    Raises:
        SettingsError: the problem cannot be pickled.
        ClusterError: the workers did not start, or the scheduler does not answer.
    """

    def __init__(
        self, problem: Problem, workers: Workers, timeout: float | None, notify: Callable[[str], None]
    ) -> None:
        self._problem = pickle_problem(problem)
        self._timeout = timeout
        self._cluster = Cluster(workers, notify)

    @property
    def capacity(self) -> int:
        """Designs that may be in flight."""
        return self._cluster.capacity

    def submit(self, number: int, design: Design) -> None:
        """Send a design to a worker."""
        self._cluster.submit(
            (number, design), f"trial {number}", evaluate_on_worker, self._problem, design, self._timeout
        )

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return a trial that finished, or None if none does within `timeout` [s].

        Raises:
            EvaluatorError: an evaluator cannot be loaded, or the workers that ran it were lost.
            ClusterError: the cluster was lost.
        """
        finished = self._cluster.wait(timeout)
        if finished is None:
            return None
        number, design = cast("tuple[int, Design]", finished.key)
        if finished.is_lost:
            way_out = "" if self._timeout is not None else ", with --evaluation-timeout S if the evaluator crashes"
            raise EvaluatorError(
                f"{MAX_LOSSES} workers were lost over trial {number} (killed, or out of memory?); design: "
                f"{describe_design(design)}. Rerun the same command to resume with it{way_out}"
            )
        if finished.error is not None:
            raise finished.error
        return number, finished.value

    def close(self) -> None:
        """Abandon what is in flight, and end local workers."""
        self._cluster.close()


def evaluate_on_worker(pickled: bytes, design: Design, timeout: float | None) -> Evaluated:
    """Evaluate a design of a pickled problem; called on the worker."""
    process = None if timeout is None else _process(pickled, timeout)
    return evaluate_design(unpickle_problem(pickled), design, process)


_own = threading.local()  # a process for each thread of a worker


def _process(pickled: bytes, timeout: float) -> EvaluationProcess:
    """Return the process that runs the evaluator for this thread; it replaces the one of an earlier search."""
    process: EvaluationProcess | None = getattr(_own, "process", None)
    if process is None or (process.pickled, process.timeout) != (pickled, timeout):
        if process is not None:
            process.close()
        process = _own.process = EvaluationProcess(pickled, timeout)
    return process
