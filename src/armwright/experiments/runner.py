"""Run the cells of an experiment, in this process or on workers."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from typing import Any

from armwright.exceptions import ArmwrightError
from armwright.experiments.cells import Cell, CellOutcome
from armwright.extras import missing_packages
from armwright.kinematics.devices import cores, resolve_device
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.problem import Problem
from armwright.proof.results import read_summary
from armwright.runs.config import check_same_run, run_config
from armwright.runs.folder import read_config
from armwright.search.samplers import sampler_factory, sampler_for
from armwright.spaces.design_space import default_space, load_space
from armwright.spaces.tolerance import TOLERANCE
from armwright.study.front.front_run import find_front
from armwright.study.progress import RunResult
from armwright.study.settings import study_method
from armwright.study.study import optimize
from armwright.study.workers.cluster import MAX_LOSSES, Cluster, Finished, Workers
from armwright.tasks.catalogue import load_task

POLL = 1.0  # [s] between two checks of the cluster


def run_cell(cell: Cell) -> CellOutcome:
    """Run one cell, or the rest of it, in this process; a failure is returned, not raised."""
    started, volume, fault = time.perf_counter(), None, ""
    try:
        volume = _run(cell).summary["hypervolume"]["final"]
    except ArmwrightError as error:
        fault = str(error)
    except Exception as error:  # noqa: BLE001 (a failing cell must not stop the others)
        fault = " ".join(f"{type(error).__name__}: {error}".split())
    return CellOutcome(cell, time.perf_counter() - started, volume, fault)


def _run(cell: Cell) -> RunResult:
    plan, problem = cell.plan, _problem(cell)
    if plan.design is not None:
        return find_front(problem, evaluations=plan.design, seed=cell.seed, out=cell.folder)
    return optimize(
        problem,
        proposer=plan.choose_proposer(cell.replay).proposer or "none",
        sampler=plan.sampler,
        n_init=cell.experiment.n_init,
        n_step=plan.n_step,
        n_total=cell.experiment.n_total,
        in_flight=plan.model_options.in_flight,
        seed=cell.seed,
        out=cell.folder,
    )


def _problem(cell: Cell) -> Problem:
    task = load_task(cell.task)
    return Problem(
        task,
        default_space(task.name) if cell.space is None else load_space(cell.space),
        tolerance=TOLERANCE if cell.experiment.robust else 0.0,
        device=resolve_device("auto", many=cell.plan.design is not None),
    )


def is_finished(cell: Cell) -> bool:
    """Return whether a cell is finished with the same settings; a front search is asked again each time."""
    plan, summary = cell.plan, read_summary(cell.folder)
    n_init, n_total = cell.experiment.n_init, cell.experiment.n_total
    if summary is None or plan.design is not None or summary["n_trials"] < n_init + n_total:
        return False
    try:
        problem = _problem(cell)
        proposer, sampler = plan.choose_proposer(cell.replay).proposer, sampler_for(problem, plan.sampler)
        in_flight = plan.model_options.in_flight
        method = study_method(proposer, sampler, n_init, plan.n_step, n_total, in_flight)
        check_same_run(cell.folder, read_config(cell.folder), run_config(problem, method, cell.seed))
    except ArmwrightError:
        return False  # `run_cell` reports it
    return True


def _check_extras(cells: Sequence[Cell]) -> None:
    """Raise MissingExtraError before any cell is run, rather than in each."""
    for cell in cells:
        sampler_factory(sampler_for(_problem(cell), cell.plan.sampler))
        if cell.plan.needs_a_model and cell.replay is None:
            import_module("armwright.llm.client")


def _check_tasks(cells: Sequence[Cell], notify: Callable[[str], None]) -> None:
    """Report what is suspicious about each task and space, once; raise UsageError for what cannot work."""
    for cell in {(cell.task, cell.space): cell for cell in cells}.values():
        findings = [
            replace(finding, message=f"task {cell.task_name}: {finding.message}")
            for finding in check_instantly(_problem(cell))
        ]
        for finding in findings:
            if not finding.is_proven:
                notify(f"warning: {finding}")
        stop_if_proven(findings)


def run_cells(cells: Sequence[Cell], workers: Workers | None, notify: Callable[[str], None]) -> Iterator[CellOutcome]:
    """Run cells, and return the outcome of each as it ends.

    Without workers, they run one after another in this process. A cell whose worker is lost is run again by another
    worker, which resumes from its last finished trial. `notify` is called with messages about the workers for the user.

    Raises:
        ClusterError: The workers did not start, or the scheduler was lost.
        UsageError: No design of the space can serve a task.
    """
    _check_extras(cells)
    _check_tasks(cells, notify)
    if workers is None or not cells:
        return map(run_cell, cells)
    return _run_on(workers, cells, notify)


def _run_on(workers: Workers, cells: Sequence[Cell], notify: Callable[[str], None]) -> Iterator[CellOutcome]:
    with closing(Cluster(workers, notify)) as cluster:
        waiting = deque(cells)
        while waiting or cluster.n_in_flight:
            # One cell per worker: a queued cell would be blamed for the loss of its worker, too.
            while waiting and cluster.n_in_flight < cluster.capacity:
                cell = waiting.popleft()
                cluster.submit(cell, cell.description, run_cell, cell)
            finished = cluster.wait(POLL)
            if finished is not None:
                yield _outcome_of(finished)


def _outcome_of(finished: Finished) -> CellOutcome:
    cell: Any = finished.key
    if finished.is_lost:
        return CellOutcome(cell, 0.0, fault=f"{MAX_LOSSES} workers were lost over it (killed, or out of memory?)")
    return finished.value if finished.error is None else CellOutcome(cell, 0.0, fault=str(finished.error))


def default_workers(n_cells: int) -> Workers | None:
    """Return one local worker per core, but at most one per cell; None without the extra or for a single worker."""
    n_workers = min(cores(), n_cells)
    return None if n_workers < 2 or missing_packages("distributed") else Workers(n_workers)
