"""Evaluation of a study's designs by Dask workers: local processes, or those of an existing cluster."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from armwright.exceptions import EvaluatorError, SettingsError
from armwright.problem.problem import Problem
from armwright.spaces.parameters import Design
from armwright.study.cluster import MAX_LOSSES, Cluster, Workers
from armwright.study.evaluation_backend import Evaluated, EvaluationBackend, describe_design, evaluate_trial


class DaskBackend(EvaluationBackend):
    """Evaluates designs on workers, which get the problem and its evaluator by value.

    Args:
        problem: the problem.
        workers: the workers.
        notify: called with news for the user.

    Raises:
        SettingsError: the problem cannot be pickled.
        ClusterError: the workers did not start, or the scheduler does not answer.
    """

    def __init__(self, problem: Problem, workers: Workers, notify: Callable[[str], None]) -> None:
        self._problem = _pickled(problem)
        self._designs: dict[int, Design] = {}  # in flight
        self._cluster = Cluster(workers, notify)

    @property
    def capacity(self) -> int:
        """Designs that may be in flight."""
        return self._cluster.capacity

    def submit(self, number: int, design: Design) -> None:
        """Send a design to a worker."""
        self._designs[number] = design
        self._cluster.submit(number, f"trial {number}", evaluate_on_worker, self._problem, number, design)

    def next_result(self, timeout: float) -> tuple[int, Evaluated] | None:
        """Return a trial that finished; errors of evaluators are raised here."""
        finished = self._cluster.wait(timeout)
        if finished is None:
            return None
        number: Any = finished.key
        design = self._designs.pop(number)
        if finished.is_lost:
            raise EvaluatorError(
                f"{MAX_LOSSES} workers were lost over trial {number} (killed, or out of memory?); design: "
                f"{describe_design(design)}. Rerun the same command to resume with it"
            )
        if finished.error is not None:
            raise finished.error
        return number, finished.value

    def close(self) -> None:
        """Abandon what is in flight, and end local workers."""
        self._cluster.close()


def evaluate_on_worker(pickled: bytes, number: int, design: Design) -> Evaluated:
    """Evaluate a design of a pickled problem; called on the worker."""
    return evaluate_trial(_unpickled(pickled), number, design)


def _pickled(problem: Problem) -> bytes:
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(problem))
    except Exception as fault:
        reason = " ".join(str(fault).split())
        raise SettingsError(f"the problem cannot be sent to workers: {type(fault).__name__}: {reason}") from fault


@lru_cache(maxsize=4)  # one per search that the worker serves; the file of an evaluator is loaded once
def _unpickled(pickled: bytes) -> Problem:
    import cloudpickle

    try:
        return cloudpickle.loads(pickled)
    except (ImportError, SettingsError) as fault:
        raise EvaluatorError(
            f"a worker cannot load the problem: {fault}; install the module on every worker, or keep the evaluator in "
            "one file and name it by load_evaluator or --evaluator FILE.py:FUNCTION"
        ) from fault
