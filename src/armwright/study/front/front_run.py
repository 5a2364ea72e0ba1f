"""Direct search for the whole front (`armwright design`), kept in a run folder.

search.npz    state of the search, written every few seconds; a killed search loses no more than these
trials.jsonl  designs of the final front; the others are counted only
"""

from collections.abc import Callable
from contextlib import nullcontext
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.checks.requirements import refuse_unread_parameters
from armwright.problem.problem import Problem
from armwright.runs.config import FrontMethod, run_config
from armwright.runs.folder import SEARCH, RunFolder, read_run
from armwright.study.front.direct_search import DirectSearch, FrontRun
from armwright.study.front.search_budget import SearchBudget, SearchProgress
from armwright.study.front.time_plan import TimePlan


def find_front(
    problem: Problem,
    *,
    budget: str | float | TimePlan | None = None,
    evaluations: int | None = None,
    seed: int = 0,
    initial_designs: str | Path | None = None,
    stop_at_stall: bool = True,
    out: str | Path | None = None,
    watch: Callable[[SearchProgress], None] | None = None,
) -> FrontRun:
    """Approximate the Pareto front of a problem within a budget.

    Args:
        problem: the problem.
        budget: wall-clock time of this call, with verification and files: "60s", "5min", "1h" or a number of seconds;
            by default 30 s, or unlimited with `evaluations`. The compilation of kernels does not count. Or the plan of
            a time that began earlier.
        evaluations: number of evaluations, which the last batch may exceed by up to 1000. If it ends the search, the
            result depends on the seed only.
        seed: of all random numbers.
        initial_designs: a run folder, whose designs are all taken.
        stop_at_stall: end early when the hypervolume hardly grows any more.
        out: run folder; a second call resumes.
        watch: called with the progress.

    Raises:
        TaskError: it is proven that no design of the space can serve the task.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-2"))
        >>> run = aw.find_front(problem, evaluations=2000, seed=0)
        >>> volume = aw.hypervolume([member.values for member in run.front], problem.reference_point)
        >>> 0.98 < volume / run.summary["hypervolume"]["final"] <= 1.0  # of designs that a user can tell apart
        True
    """
    plan = budget if isinstance(budget, TimePlan) else TimePlan(SearchBudget.of(budget, evaluations))
    refuse_unread_parameters(problem)
    stop_if_proven(check_instantly(problem))
    matrix, origin = _initial_matrix(problem, initial_designs)  # before a folder is made
    config = run_config(problem, FrontMethod(initial_designs=origin), seed)
    with nullcontext() if out is None else RunFolder(Path(out)) as folder:
        if folder is not None:
            config = folder.adopt(config)
            if not (folder.path / SEARCH).exists():
                stored = problem.space.matrix([trial.design for trial in folder.open_trials(config)])
                matrix = np.vstack([matrix, stored])
        return DirectSearch(problem, config, folder, matrix, plan, watch).run(stop_at_stall)


def _initial_matrix(problem: Problem, initial_designs: str | Path | None) -> tuple[Array, dict[str, Any] | None]:
    """Return the (N, P) designs of a run folder, and a record of their origin."""
    if initial_designs is None:
        return problem.space.matrix([]), None
    _, run = read_run(initial_designs)
    space = run.problem.space.model_copy(update={"name": problem.space.name})
    if space != problem.space or run.problem.task.targets != problem.task.targets:
        raise SettingsError(
            f"{initial_designs} holds a run of another task or design space ({run.problem.task.name}, "
            f"{run.problem.space.name})"
        )
    matrix = problem.space.matrix([trial.design for trial in run])
    return matrix, {"run": str(initial_designs), "designs": len(matrix), "sha256": sha256(matrix.tobytes()).hexdigest()}
