"""Runs cells: in this process, or on workers."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from armwright.exceptions import ArmwrightError
from armwright.experiments.plan import Cell
from armwright.extras import missing_packages
from armwright.kinematics.devices import cores, resolve_device
from armwright.problem.problem import Problem
from armwright.runs.config import check_same_run
from armwright.runs.folder import read_config
from armwright.runs.results import read_summary
from armwright.search.samplers import sampler_factory
from armwright.spaces.design_space import load_space, paper_space
from armwright.spaces.tolerance import TOLERANCE
from armwright.study.cluster import MOST_LOSSES, Cluster, Finished, Workers
from armwright.study.front_run import find_front
from armwright.study.study import optimize, study_config, study_method
from armwright.tasks.catalogue import load_task

LOOK_SECONDS = 1.0  # between two looks whether the cluster is still there


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
        proposer=plan.choose_proposer(cell.replay).proposer or "none",
        sampler=plan.sampler,
        n_init=cell.n_init,
        n_step=plan.n_step,
        n_total=cell.n_total,
        in_flight=plan.model_options.in_flight,
        refine_every=plan.refine_every,
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
        proposer = plan.choose_proposer(cell.replay).proposer
        method = study_method(
            proposer,
            plan.sampler,
            cell.n_init,
            plan.n_step,
            cell.n_total,
            plan.model_options.in_flight,
            plan.refine_every,
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
            import_module("armwright.llm.client")


def run_cells(cells: Sequence[Cell], workers: Workers | None, notify: Callable[[str], None]) -> Iterator[Outcome]:
    """Run cells, and return the outcome of each as it ends.

    A cell whose worker is lost is run again by another worker, which resumes from its last finished trial.

    Args:
        cells: what to run.
        workers: where; None for one after another in this process.
        notify: called with news of the workers for the user.

    Raises:
        ClusterError: the workers did not start, or the scheduler was lost.
    """
    _check_extras(cells)
    if workers is None or not cells:
        return map(run_cell, cells)
    return _run_on(workers, cells, notify)


def _run_on(workers: Workers, cells: Sequence[Cell], notify: Callable[[str], None]) -> Iterator[Outcome]:
    with closing(Cluster(workers, notify)) as cluster:
        waiting = deque(cells)
        while waiting or cluster.n_in_flight:
            # A worker has no cell beside the one that it runs, which would be blamed with it for its end.
            while waiting and cluster.n_in_flight < cluster.capacity:
                cell = waiting.popleft()
                cluster.submit(cell, cell.words, run_cell, cell)
            finished = cluster.wait(LOOK_SECONDS)
            if finished is not None:
                yield _outcome_of(finished)


def _outcome_of(finished: Finished) -> Outcome:
    cell: Any = finished.key
    if finished.is_lost:
        return Outcome(cell, 0.0, fault=f"{MOST_LOSSES} workers were lost over it (killed, or out of memory?)")
    return finished.value if finished.error is None else Outcome(cell, 0.0, fault=str(finished.error))


def default_workers(n_cells: int) -> Workers | None:
    """Return one local worker a core, but no more than there are cells; None without the extra or with one."""
    n_workers = min(cores(), n_cells)
    return None if n_workers < 2 or missing_packages("distributed") else Workers(n_workers)
