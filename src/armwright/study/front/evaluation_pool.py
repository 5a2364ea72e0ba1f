"""Processes that share the evaluations of a direct search: threads of one process wait for each other's Python code.

They run this module: `python -m armwright.study.front.evaluation_pool FD`, where FD is a connection to the process that
searches. They end when it does.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.child_process import start_connected
from armwright.kinematics.chunks import one_thread
from armwright.kinematics.devices import cores
from armwright.problem.estimates import estimates
from armwright.problem.objectives import OBJECTIVES, named_objectives
from armwright.problem.outcomes import Outcomes, joined
from armwright.problem.problem import Problem

MAX_PROCESSES = 8  # with this one; each takes 300 MB
PATIENCE = 60.0  # [s] after the part of this process is done, until another one is given up

Work = Callable[..., Outcomes]


class EvaluationPool:
    """Evaluate designs in this process, and in others as soon as they are ready: the same outcomes to the bit.

    What another process fails to do is done in this one.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._others: list[_Other] = []

    def start(self) -> None:
        """Start one process per further core, unless the problem depends on what a user's code defines."""
        problem = self._problem
        names = [objective.name for objective in problem.objectives]
        is_ours = problem.evaluator is None and all(map(OBJECTIVES.__contains__, names))
        if os.name == "posix" and problem.device == "cpu" and is_ours and named_objectives(names) == problem.objectives:
            content = (problem.task, problem.space, problem.tolerance, names)
            self._others = [_Other(content) for _ in range(min(cores(), MAX_PROCESSES) - 1)]

    def evaluate(self, matrix: Array) -> Outcomes:
        """Return the outcomes of designs (N, P), as `Problem.evaluate` does."""
        return self._share(Problem.evaluate, matrix)

    def estimates(self, matrix: Array, near: Array) -> Outcomes:
        """Return the `estimates` of designs (N, P)."""
        return self._share(estimates, matrix, near)

    def close(self) -> None:
        """End the other processes."""
        for other in self._others:
            other.end()
        self._others = []

    def _share(self, work: Work, *arrays: Array) -> Outcomes:
        ready = [other for other in self._others if other.is_ready()]
        if not ready or len(arrays[0]) <= len(ready):
            return work(self._problem, *arrays)
        bounds = np.linspace(0, len(arrays[0]), len(ready) + 2).astype(int)
        own, *parts = ([array[first:end] for array in arrays] for first, end in pairwise(bounds))
        for other, part in zip(ready, parts, strict=True):
            other.send((work, part))
        with one_thread():
            found = [work(self._problem, *own)]
        for other, part in zip(ready, parts, strict=True):
            found.append(other.receive() or work(self._problem, *part))
        return joined(found)


class _Other:
    """Another process; content: what it makes the problem of."""

    def __init__(self, content: Any) -> None:
        nowhere = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
        self._process, self._connection = start_connected(__name__, env={"OMP_NUM_THREADS": "1"}, **nowhere)
        self._is_ready = False
        self.send(content)

    def is_ready(self) -> bool:
        """Return whether it can evaluate: it says so once it has evaluated a design."""
        if not self._is_ready and not self._connection.closed and self._connection.poll():
            self._is_ready = self.receive() is not None
        return self._is_ready

    def send(self, work: Any) -> None:
        """Send work; if it fails, so does `receive`."""
        with suppress(OSError):
            self._connection.send(work)

    def receive(self) -> Outcomes | None:
        """Return what it has found; None if it fails, and then it is ended."""
        with suppress(EOFError, OSError):
            if self._connection.poll(PATIENCE):
                return self._connection.recv()
        self.end()
        return None

    def end(self) -> None:
        """End it."""
        self._is_ready = False
        self._connection.close()
        self._process.kill()
        self._process.wait()


def main() -> None:
    """Evaluate the designs that arrive, until the connection ends."""
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    with suppress(EOFError, OSError):
        task, space, tolerance, names = connection.recv()
        problem = Problem(task, space, tolerance, "cpu", named_objectives(names))
        found = problem.evaluate(space.matrix(space.sample(1, seed=0)))
        while True:
            connection.send(found)
            work, part = connection.recv()
            found = work(problem, *part)


if __name__ == "__main__":
    main()
