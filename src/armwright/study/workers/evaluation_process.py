"""A process that runs a custom evaluator, so that an evaluation which hangs or crashes can be ended.

It is started by `python -m armwright.study.workers.evaluation_process FD`, where FD is a connection to the process that
starts it. It leads a process group of its own. The whole group is killed after a timeout, so that programs which the
evaluator started end with it, and when the process that started it ends.
"""

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from functools import lru_cache
from multiprocessing.connection import Connection
from typing import Any

from armwright.child_process import start_connected
from armwright.exceptions import EvaluatorError, SettingsError
from armwright.kinematics.devices import find_cache
from armwright.problem.evaluators import Measurement
from armwright.problem.failure import Failure
from armwright.problem.problem import Problem
from armwright.spaces.parameters import Design

IDLE_SECONDS = 300.0  # after which the process ends; the next design starts another one
IDLE_EXIT = 75
# After the timeout, the system ends a process whose code in C holds Python's lock and that nobody is left to kill.
GRACE_SECONDS = 5.0


def pickle_problem(problem: Problem) -> bytes:
    """Pickle a problem by value, with what a script or a notebook defines; SettingsError if that fails."""
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(problem))
    except Exception as fault:
        reason = " ".join(str(fault).split())
        raise SettingsError(f"the problem cannot be sent to workers: {type(fault).__name__}: {reason}") from fault


@lru_cache(maxsize=4)  # one per search that a worker serves; the file of an evaluator is loaded once
def unpickle_problem(pickled: bytes) -> Problem:
    """Load a problem in another process; EvaluatorError if its evaluator cannot be loaded."""
    import cloudpickle

    try:
        return cloudpickle.loads(pickled)
    except (ImportError, SettingsError) as fault:
        raise EvaluatorError(
            f"a worker cannot load the problem: {fault}; install the module on every worker, or keep the evaluator in "
            "one file and name it by load_evaluator or --evaluator FILE.py:FUNCTION"
        ) from fault


class EvaluationProcess:
    """Measures one design at a time in another process, which is replaced after it was ended.

    The problem is pickled by `pickle_problem`; a design may take `timeout` [s].
    """

    def __init__(self, pickled: bytes, timeout: float) -> None:
        self.pickled = pickled
        self.timeout = timeout
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection[Any, Any] | None = None

    def measure(self, design: Design) -> Measurement:
        """Measure a design; EvaluatorError if the process cannot load the evaluator."""
        if self._process is None or self._process.poll() is not None:
            self._start()
        assert self._connection is not None
        try:
            self._connection.send(design)
            if self._connection.poll(self.timeout):
                return self._connection.recv()
        except (EOFError, OSError):
            return self._after_end(design)
        self.close()
        return Failure("timeout", f"no result within {self.timeout:g} s")

    def close(self) -> None:
        """Kill the process and those that it started."""
        if self._process is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = None

    def _start(self) -> None:
        self.close()
        find_cache()
        module = "armwright.study.workers.evaluation_process"
        self._process, self._connection = start_connected(module, stdin=subprocess.PIPE)
        try:
            self._connection.send((self.pickled, self.timeout))
            failure = self._connection.recv()
        except (EOFError, OSError):
            failure = f"the process of the evaluator {self._end()} before the first design"
        if failure:
            self.close()
            raise EvaluatorError(failure)

    def _after_end(self, design: Design) -> Measurement:
        """Return how a process failed that ended while it had a design; if it was only idle, try another one."""
        end = self._end()
        assert self._process is not None
        is_idle = self._process.returncode == IDLE_EXIT
        self.close()
        if is_idle:
            return self.measure(design)
        return Failure("exception", f"the process of the evaluator {end}", end)

    def _end(self) -> str:
        """Return in words how the process ended."""
        assert self._process is not None
        code = self._process.wait()
        return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def main() -> None:
    """Measure the designs that arrive, until the connection ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.dup2(2, 1)  # what evaluators print must not mix with the output of a command
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    pickled, timeout = connection.recv()
    try:
        problem = unpickle_problem(pickled)
        problem.physics(problem.space.sample(1, seed=0))  # kernels are loaded before the clock starts
    except EvaluatorError as failure:
        connection.send(str(failure))
        return
    connection.send("")
    while connection.poll(IDLE_SECONDS):
        try:
            design = connection.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, timeout + GRACE_SECONDS)
        measured = problem.measure(design)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        connection.send(measured)
    sys.exit(IDLE_EXIT)


def _end_with_parent() -> None:
    while os.read(0, 1):  # not sys.stdin, whose lock this process would need to end by itself
        pass
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main()
