"""A Dask cluster that runs functions: processes of this machine, or an existing cluster.

It is the one engine for work in other processes: single designs (`dask_backend.py`) and whole runs of an experiment
(`experiments/runner.py`). A task whose worker is lost runs again on another worker.
"""

import json
import logging
import os
import queue
import signal
import subprocess
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Hashable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import Any, cast
from uuid import uuid4

from armwright.child_process import start_module
from armwright.exceptions import ArmwrightError, ClusterError, FailureError, SettingsError
from armwright.extras import check_extra
from armwright.kinematics.devices import find_cache

MAX_WORKERS = 10_000
MAX_LOSSES = 3  # workers lost over the same task before it is given up
CONNECT_SECONDS = 20.0
CLOSE_SECONDS = 5.0
# Versions that the numbers depend on: equal in this process and in every worker.
PACKAGES = ("armwright", "numpy", "warp-lang")
# Read by numpy's libraries and by our kernels.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Workers:
    """Worker processes that evaluate designs; needs the extra `distributed`.

    Raises:
        SettingsError: neither is given, or the number is out of range.
        MissingExtraError: the extra is not installed.
    """

    # Local processes to start, with one thread each. With a scheduler: tasks in flight, by default as many as its
    # workers have threads
    n_workers: int | None = None
    scheduler: str | None = None  # address of the scheduler of an existing Dask cluster, such as tcp://192.168.0.7:8786

    def __post_init__(self) -> None:
        if self.n_workers is None and not self.scheduler:
            raise SettingsError("expected a number of workers or the address of a Dask scheduler, got neither")
        if self.n_workers is not None and not 1 <= self.n_workers <= MAX_WORKERS:
            raise SettingsError(f"expected 1 to {MAX_WORKERS:,} workers, got {self.n_workers}")
        check_extra("distributed", "evaluation by workers")

    @property
    def description(self) -> str:
        """What they are, for messages."""
        return f"the Dask cluster at {self.scheduler}" if self.scheduler else f"{self.n_workers} local workers"


@dataclass(frozen=True)
class Finished:
    """A task that ended with a value, with an error, or because the workers that ran it were lost."""

    key: Hashable
    value: Any = None
    error: ArmwrightError | None = None
    is_lost: bool = False


@dataclass(frozen=True)
class _Task:
    key: Hashable
    name: str
    future: Any


class Cluster:
    """Runs functions on workers; local ones begin and end with it. `notify` is called with news for the user.

    Raises:
        ClusterError: the workers did not start, or the scheduler does not answer.
    """

    def __init__(self, workers: Workers, notify: Callable[[str], None]) -> None:
        self._workers = workers
        self._notify = notify
        self._tasks: dict[str, _Task] = {}  # by the future's key
        self._losses: Counter[str] = Counter()
        # Futures that ended, the keys that a lost worker had, and None for a new worker; filled by Dask's threads.
        self._events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        with ExitStack() as stack:
            self._client = stack.enter_context(_client_of(workers))
            self._client.subscribe_topic("all", self._receive_event)
            self._check_versions()
            waiting = "" if self._n_threads() else ", which has no worker yet"
            notify(f"evaluating on {workers.description}{waiting}")
            self.close = stack.pop_all().close

    @property
    def capacity(self) -> int:
        """Tasks that may be in flight."""
        return self._workers.n_workers or max(1, self._n_threads())

    @property
    def n_in_flight(self) -> int:
        """Tasks that were submitted and have not ended."""
        return len(self._tasks)

    def submit(self, key: Hashable, name: str, function: Callable[..., Any], *arguments: Any) -> None:
        """Run `function(*arguments)`, a function of this package with arguments that can be pickled, on a worker.

        `wait` returns the key with the value. If a worker is lost, the message that the task runs again has its `name`.
        """
        task_name = f"armwright-{uuid4().hex}"
        future = self._client.submit(_run, function, *arguments, key=task_name, pure=False)
        self._tasks[task_name] = _Task(key, name, future)
        future.add_done_callback(self._events.put)

    def wait(self, timeout: float) -> Finished | None:
        """Return a task that ended, or None if none does within `timeout` [s].

        Raises:
            ClusterError: the scheduler was lost, or a worker has other versions than this process.
        """
        try:
            event = self._events.get(timeout=timeout)
        except queue.Empty:
            if self._client.status != "running":
                raise self._connection_error() from None
            return None
        if event is None:
            self._check_versions()
            return None
        return self._count_losses(cast("frozenset[str]", event)) if isinstance(event, frozenset) else self._end(event)

    def _n_threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError) as fault:
            raise self._connection_error() from fault

    def _receive_event(self, event: tuple[float, Any]) -> None:
        """Take an event of the scheduler; called by Dask's thread."""
        content = cast("dict[str, Any]", event[1]) if isinstance(event[1], dict) else {}
        if content.get("action") == "add-worker":
            self._events.put(None)
        if content.get("action") == "remove-worker" and not content.get("expected"):
            self._events.put(frozenset(content["processing-tasks"]))

    def _count_losses(self, keys: frozenset[str]) -> Finished | None:
        for key in keys & self._tasks.keys():
            self._losses[key] += 1
            if self._losses[key] >= MAX_LOSSES:
                return self._give_up(key)
            self._notify(f"a worker was lost; {self._tasks[key].name} runs again on another one")
        return None

    def _give_up(self, key: str) -> Finished:
        task = self._tasks.pop(key)
        task.future.cancel()
        return Finished(task.key, is_lost=True)

    def _end(self, future: Any) -> Finished | None:
        from distributed import CancelledError, KilledWorker

        if future.key not in self._tasks:  # given up
            return None
        try:
            value = future.result()
        except KilledWorker:  # the scheduler's own limit is lower than ours
            return self._give_up(future.key)
        except (CancelledError, OSError, TimeoutError) as fault:
            raise self._connection_error() from fault
        key = self._tasks.pop(future.key).key
        return Finished(key, error=value) if isinstance(value, ArmwrightError) else Finished(key, value)

    def _check_versions(self) -> None:
        """Raise ClusterError if a worker has other versions than this process."""
        try:
            found = self._client.get_versions(packages=PACKAGES)
        except (OSError, TimeoutError) as fault:
            raise self._connection_error() from fault
        own, *others = (_relevant(one["packages"]) for one in (found["client"], *found["workers"].values()))
        for other in others:
            names = [name for name in own if other[name] != own[name]]
            differences = ", ".join(f"{name} {other[name] or 'missing'} instead of {own[name]}" for name in names)
            if differences:
                raise ClusterError(f"a worker has {differences}; install the same versions for every worker")

    def _connection_error(self) -> ClusterError:
        return ClusterError(f"lost the connection to {self._workers.description}; rerun the same command to resume")


def _relevant(packages: Mapping[str, str | None]) -> dict[str, str | None]:
    """Return the versions that have to be equal; those of packages that are missing are None."""
    python = ".".join(str(packages["python"]).split(".")[:2])
    return {"Python": python, **{name: packages[name] for name in PACKAGES}}


def _run(function: Callable[..., Any], *arguments: Any) -> Any:
    """Run a task on the worker; return its value, or an error that survives pickling."""
    try:
        return function(*arguments)
    except ArmwrightError as error:
        error.__cause__ = error.__context__ = None
        return error.with_traceback(None)
    except Exception as fault:  # noqa: BLE001 (raised again by the caller of `wait`)
        error = FailureError(f"{type(fault).__name__}: {fault}")
        error.add_note(traceback.format_exc())
        return error


@contextmanager
def _client_of(workers: Workers) -> Generator[Any]:
    """Connect to the scheduler of local workers, or to an existing one."""
    from distributed import Client, Security
    from distributed.utils import silence_logging_cmgr

    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL + 1))
        address, security = workers.scheduler, None
        if address is None:
            assert workers.n_workers is not None
            address, credentials = stack.enter_context(_local_cluster(workers.n_workers))
            security = Security(require_encryption=True, **credentials)
        try:
            client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False, security=security)
        except (OSError, ValueError, TimeoutError) as fault:
            raise ClusterError(f"no Dask scheduler answers at {address} ({' '.join(str(fault).split())})") from fault
        stack.callback(_close, client)
        yield client


def _close(client: Any) -> None:
    with suppress(OSError, TimeoutError):  # the scheduler may be gone
        client.close(timeout=CLOSE_SECONDS)


@contextmanager
def _local_cluster(n_workers: int) -> Generator[tuple[str, dict[str, str]]]:
    """Start a scheduler and workers (`local_cluster.py`), and kill them all in the end.

    Yields the scheduler's address and the credentials to connect, which no other user of the machine knows.
    """
    find_cache()
    environment = {**dict.fromkeys(THREADS, "1"), "DASK_LOGGING__DISTRIBUTED": "critical"}
    with (
        TemporaryDirectory(prefix="armwright-workers-") as folder,
        start_module(
            "armwright.study.workers.local_cluster", n_workers, folder,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment,
        ) as process,
    ):  # fmt: skip
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            if not line:
                raise ClusterError(f"{n_workers} local workers could not be started; try fewer")
            connection = json.loads(line)
            yield connection["address"], connection["credentials"]
        finally:
            os.killpg(process.pid, signal.SIGKILL)
