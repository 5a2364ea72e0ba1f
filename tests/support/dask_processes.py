"""Dask scheduler and workers as shell processes, and an evaluator that tests can hold."""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import psutil

import armwright as aw
from tests.support.command_line import PATIENCE, wait_until

TASK = aw.load_task("target-1").model_copy(update={"reference_point": None})

EVALUATOR = """
import ctypes, hashlib, os, pathlib, signal, time
import armwright as aw

PLACE = pathlib.Path({place!r})

@aw.evaluator("reach [m]", "height [m]")
def measure(arm, task):
    name = hashlib.sha256(repr(arm).encode()).hexdigest()[:12]
    with open(PLACE / "evaluated", "a") as log:
        log.write(f"{{os.getpid()}} {{name}}\\n")
    while (PLACE / "hold").exists():
        time.sleep(0.01)
    if (PLACE / "die").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    if (PLACE / "hang").exists():
        (PLACE / "hang").unlink()
        ctypes.PyDLL(None).sleep(1000)  # code in C that holds Python's lock
    if (PLACE / "fail").exists():
        raise ValueError("no licence")
    return sum(link.length for link in arm.links), 1.0 + arm.base[2]
"""


class Bench:
    """An evaluator's file, and what it was asked to evaluate."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "sim.py"
        self.file.write_text(EVALUATOR.format(place=str(folder)), encoding="utf-8")

    def problem(self) -> aw.Problem:
        return aw.Problem(TASK, evaluator=aw.load_evaluator(f"{self.file}:measure"))

    def ask(self, what: str) -> None:
        """Let evaluations `hold`, `die` or `fail` from now on, or the next one `hang`."""
        (self.folder / what).touch()

    def release(self, what: str) -> None:
        (self.folder / what).unlink()

    @property
    def evaluated(self) -> list[tuple[int, str]]:
        """The process and the name of each design whose evaluation began."""
        file = self.folder / "evaluated"
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        return [(int(line.split()[0]), line.split()[1]) for line in lines]

    @property
    def counts(self) -> Counter[str]:
        """How often each design's evaluation began."""
        return Counter(name for _, name in self.evaluated)


class ShellCluster:
    """`dask scheduler` and `dask worker`, whose working folder holds no evaluator."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._begin("scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard")
        wait_until(lambda: self._file.is_file() and self._file.stat().st_size > 0)
        self.address = str(json.loads(self._file.read_text(encoding="utf-8"))["address"])

    def add_worker(self, **environment: str) -> subprocess.Popen[bytes]:
        flags = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
        self.workers.append(self._begin("worker", *flags, **environment))
        return self.workers[-1]

    def only(self, n: int) -> list[subprocess.Popen[bytes]]:
        """So many workers that live: lost ones are replaced."""
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < n:
            self.add_worker()
        return self.workers

    def _begin(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--scheduler-file", str(self._file)],
            cwd=self._folder, env={**os.environ, "OMP_NUM_THREADS": "1", **environment}, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


def descendants(pid: int) -> list[psutil.Process]:
    """All processes that a process began, directly or not."""
    return psutil.Process(pid).children(recursive=True)


def all_ended(processes: list[psutil.Process]) -> bool:
    """Whether none of them is left after a while."""
    return not psutil.wait_procs(processes, timeout=PATIENCE)[1]
