"""Runs cells: here in a pool of processes, or on the workers of a Dask cluster."""

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any, cast

from armwright.exceptions import ArmwrightError, FailureError
from armwright.experiment.plan import Cell
from armwright.extras import needed
from armwright.front import find_front
from armwright.kinematics.devices import cores, resolve_device
from armwright.problem import Problem
from armwright.proposers.choice import choose_proposer
from armwright.results import read_summary
from armwright.run_config import check_same_run
from armwright.run_folder import read_config
from armwright.sampling import sampler_factory
from armwright.space import load_space, paper_space
from armwright.study import optimize, study_config, study_method
from armwright.task import load_task
from armwright.tolerance import TOLERANCE

MOST_DEATHS = 3  # of workers that had the same cell; with the last one it is alone
THREADS = "OMP_NUM_THREADS"  # which our kernels obey, too
CONNECT_SECONDS = 20.0


@dataclass(frozen=True)
class Outcome:
    """What became of a cell.

    fault: why it failed; empty where it is finished. resumed: whether all of it lay there before.
    """

    cell: Cell
    seconds: float
    hypervolume: float | None = None
    fault: str = ""
    resumed: bool = False


def run_cell(cell: Cell) -> Outcome:
    """Runs one cell, or what is left of it, in this process; what goes wrong is told, not raised."""
    started = time.perf_counter()
    try:
        summary, resumed = _run(cell)
    except ArmwrightError as fault:
        return Outcome(cell, time.perf_counter() - started, fault=str(fault))
    except Exception as fault:  # noqa: BLE001 (a cell must not stop the others, whatever is wrong with it)
        words = " ".join(f"{type(fault).__name__}: {fault}".split())
        return Outcome(cell, time.perf_counter() - started, fault=words)
    return Outcome(cell, time.perf_counter() - started, summary["hypervolume"]["final"], resumed=resumed)


def _run(cell: Cell) -> tuple[dict[str, Any], bool]:
    plan, problem = cell.plan, _problem(cell)
    if plan.front is not None:
        found = find_front(problem, budget=plan.front, seed=cell.seed, out=cell.folder)
        return found.summary, found.resumed == found.summary["search"]["evaluations"]
    run = optimize(
        problem,
        proposer=choose_proposer(plan.wishes(cell.replay)).proposer or "none",
        sampler=plan.sampler,
        n_init=cell.n_init,
        n_step=plan.n_step,
        n_total=cell.n_total,
        in_flight=plan.in_flight,
        polish_every=plan.polish_every,
        seed=cell.seed,
        out=cell.folder,
    )
    return run.summary, run.resumed == len(run.trials)


def _problem(cell: Cell) -> Problem:
    return Problem(
        load_task(cell.task),
        paper_space() if cell.space is None else load_space(cell.space),
        tolerance=TOLERANCE if cell.robust else 0.0,
        device=resolve_device("auto", many=cell.plan.front is not None),
    )


def finished_before(cell: Cell) -> Outcome | None:
    """What a cell came to that was finished before with the same settings; None where there is anything to do."""
    summary = read_summary(cell.folder)
    if summary is None or cell.plan.front is not None or summary["n_trials"] < cell.n_init + cell.n_total:
        return None
    plan = cell.plan
    try:
        proposer = choose_proposer(plan.wishes(cell.replay)).proposer
        method = study_method(
            proposer, plan.sampler, cell.n_init, plan.n_step, cell.n_total, plan.in_flight, plan.polish_every
        )
        check_same_run(cell.folder, read_config(cell.folder), study_config(_problem(cell), method, cell.seed))
    except ArmwrightError:
        return None  # `run_cell` tells of it
    return Outcome(cell, 0.0, summary["hypervolume"]["final"], resumed=True)


def _check_extras(cells: Sequence[Cell]) -> None:
    """MissingExtraError before any cell is run, rather than in each."""
    for cell in cells:
        sampler_factory(cell.plan.sampler)
        if cell.plan.asks_a_model and cell.replay is None:
            import_module("armwright.llm.chat")


def run_here(cells: Sequence[Cell], jobs: int) -> Iterator[Outcome]:
    """Runs cells in `jobs` processes with one thread each, and tells of each as it ends.

    A cell whose worker is killed is run again, and goes on from its last finished trial.
    """
    _check_extras(cells)
    deaths: Counter[Cell] = Counter()
    waiting = list(cells)
    while waiting:
        trusted = [cell for cell in waiting if deaths[cell] < MOST_DEATHS - 1]
        # What was there when workers died more than once is run alone, so that it alone is to blame.
        batch, size = (trusted, jobs) if trusted else (waiting[:1], 1)
        done: set[Cell] = set()
        for cell, outcome in _in_pool(batch, size):
            if outcome is not None:
                done.add(cell)
                yield outcome
                continue
            deaths[cell] += 1
            if deaths[cell] == MOST_DEATHS:
                done.add(cell)
                yield Outcome(cell, 0.0, fault=f"its process was killed {MOST_DEATHS} times (out of memory?)")
        waiting = [cell for cell in waiting if cell not in done]


def _in_pool(cells: Sequence[Cell], jobs: int) -> Generator[tuple[Cell, Outcome | None]]:
    """The outcomes of one pool's life; None for those that ran when a worker was killed, nothing for those after."""
    others = set(multiprocessing.active_children())
    futures: dict[Future[Outcome], Cell] = {}
    waiting = iter(cells)
    with _one_thread_each():
        pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=_begin_worker)
        try:
            # No more at a time than there are workers, so that what was given is what ran.
            _give(pool, futures, waiting, jobs)
            while futures:
                future = next(as_completed(futures))
                outcome = future.result()
                yield futures.pop(future), outcome
                _give(pool, futures, waiting, 1)
            pool.shutdown()
        except BrokenProcessPool:
            yield from ((cell, None) for cell in futures.values())
        finally:
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()  # finished trials are on disk
            pool.shutdown(wait=False, cancel_futures=True)


def _give(pool: ProcessPoolExecutor, futures: dict[Future[Outcome], Cell], cells: Iterator[Cell], n: int) -> None:
    for _, cell in zip(range(n), cells, strict=False):
        futures[pool.submit(run_cell, cell)] = cell


def _begin_worker() -> None:
    """A worker ends with Ctrl-C, and with the process that it works for, at once: nothing can be lost."""
    signal.signal(signal.SIGINT, _end_at_once)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_at_once(*_: object) -> None:
    os._exit(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _one_thread_each() -> Generator[None]:
    """Processes that begin within have one thread each for numbers."""
    before = os.environ.get(THREADS)
    os.environ[THREADS] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[THREADS]
        else:
            os.environ[THREADS] = before


def run_on_dask(cells: Sequence[Cell], address: str) -> Iterator[Outcome]:
    """Runs cells on the workers of the Dask scheduler at `address`, which must see the same files.

    Dask gives the cells of a worker that died to another one, which goes on from the last finished trial.
    """
    with needed("distributed", "--scheduler"):
        from distributed import Client, as_completed
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as fault:
        raise FailureError(f"no Dask scheduler answers at {address} ({' '.join(str(fault).split())})") from fault
    with client:
        futures: dict[Any, Cell] = {client.submit(run_cell, cell, pure=False): cell for cell in cells}
        for future in cast("Iterator[Any]", as_completed(list(futures), loop=client.loop)):
            if future.status == "finished":
                yield future.result()
            else:
                yield Outcome(futures[future], 0.0, fault=f"Dask gave it up: {future.exception()}")


def most_jobs() -> int:
    """How many cells run at a time where nothing else is said: one a core."""
    return cores()
