"""Direct search for the whole front (`armwright design`), kept in a run folder.

search.npz    state of the search, written every few seconds; a killed search loses no more than these
trials.jsonl  designs of the final front; the others are counted only
proposals/    the run in which a proposer gave the initial designs, if one did
"""

import io
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import RunFolderError, SettingsError
from armwright.kinematics.ik import MANY_ARMS
from armwright.pareto import PENALTY
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposer
from armwright.runs.config import FrontMethod, RunConfig
from armwright.runs.folder import PROPOSALS, SEARCH, RunFolder, read_run
from armwright.runs.history import FRONT_SEARCH, History
from armwright.runs.infeasibility import ViolationTally
from armwright.runs.results import complete_summary, discard_results, summarize_front, write_results
from armwright.runs.trial import FinishedTrial
from armwright.runs.verification import verify_front
from armwright.search.front_search import FrontSearch
from armwright.study.progress import RunResult
from armwright.study.reference_survey import ReferenceSurvey
from armwright.study.search_budget import SearchBudget, SearchProgress
from armwright.study.settings import run_config
from armwright.study.study import optimize

SAVE_SECONDS = 5.0
MAX_DESIGNS = 300  # of the front that become trials: those with the largest hypervolume contributions
N_PROPOSED = 20  # initial designs requested from a proposer


class FrontRun(RunResult):
    """Result of a direct search: its history holds the designs of the front only, `resumed` counts evaluations."""


def find_front(
    problem: Problem,
    *,
    budget: str | int | SearchBudget = "5s",
    seed: int = 0,
    initial_designs: str | Path | Proposer | None = None,
    stop_at_stall: bool = True,
    out: str | Path | None = None,
    watch: Callable[[SearchProgress], None] | None = None,
) -> FrontRun:
    """Approximate the Pareto front of a problem within a budget.

    Args:
        problem: the problem.
        budget: a time such as "5s", without the loading of the kernels, or a number of evaluations, which the last
            batch may exceed by up to 1000. With a number the result depends on the seed only.
        seed: of all random numbers.
        initial_designs: a run folder, whose designs are all taken, or a proposer.
        stop_at_stall: end early when the hypervolume hardly grows any more.
        out: run folder; a second call resumes.
        watch: called with the progress.

    Raises:
        TaskError: it is proven that no design of the space can serve the task.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-2"))
        >>> run = aw.find_front(problem, budget=2000, seed=0)
        >>> volume = aw.hypervolume([member.values for member in run.front], problem.reference_point)
        >>> round(volume, 6) == round(run.summary["hypervolume"]["final"], 6)
        True
    """
    budget = budget if isinstance(budget, SearchBudget) else SearchBudget.parse(str(budget))
    stop_if_proven(check_instantly(problem))
    matrix, origin = _initial_matrix(problem, initial_designs)  # before a folder is made
    config = run_config(problem, FrontMethod(initial_designs=origin), seed)
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(RunFolder(Path(out)))
        if folder is not None:
            config = folder.adopt(config)
        if folder is None or not (folder.path / SEARCH).exists():
            # A proposer is asked, and paid, only after the folder was checked.
            if initial_designs is not None and not isinstance(initial_designs, (str, Path)):
                matrix = _proposed_matrix(
                    problem, initial_designs, config.seed, None if folder is None else folder.path
                )
            if folder is not None:
                matrix = np.vstack([matrix, _matrix(problem, folder.open_trials(config))])
        return _DirectSearch(problem, config, folder, matrix, watch).run(budget, stop_at_stall)


class _DirectSearch:
    """One session of a direct search."""

    def __init__(
        self,
        problem: Problem,
        config: RunConfig,
        folder: RunFolder | None,
        matrix: Array,
        watch: Callable[[SearchProgress], None] | None,
    ) -> None:
        self.problem = problem
        self.config = config
        self.folder = folder
        self.watch = watch
        self.survey = ReferenceSurvey(problem, config.seed)
        self.search = FrontSearch(problem.space.parameters, self._evaluate, self.survey.point, config.seed, matrix)
        self.seconds = 0.0  # of all sessions
        self.infeasible = 0  # designs of all sessions
        self.tally = ViolationTally(len(problem.constraints))  # of all sessions
        if folder is not None:
            self._restore(folder)

    def run(self, budget: SearchBudget, stop_at_stall: bool) -> FrontRun:
        """Search until the budget is spent or the search stalls, then write the results."""
        resumed = self.search.evaluations
        few = self.problem.space.matrix(self.problem.space.sample(1, 0))
        self.problem.evaluate_matrix(np.repeat(few, MANY_ARMS, axis=0))  # loads all kernels
        ended = self._end_reason(budget, stop_at_stall)
        if not ended and self.folder is not None:
            discard_results(self.folder.path)
            self.config = self.folder.note_versions(self.config)
        state = None  # after the last complete generation: Ctrl-C may interrupt one
        try:
            before, saved = self.seconds, time.monotonic()
            started = saved
            while not (ended := self._end_reason(budget, stop_at_stall)):
                self.search.step()
                if self.survey.close():
                    self.search.move_reference_point(self.survey.point)
                now = time.monotonic()
                self.seconds = before + now - started
                state = {"seconds": self.seconds, "infeasible": self.infeasible, **self.tally.state()}
                state |= {**self.survey.state(), **self.search.state()}
                if now - saved >= SAVE_SECONDS:
                    self._save(state)
                    saved = now
                if self.watch is not None:
                    search = self.search
                    front_size = len(search.matrix)
                    self.watch(SearchProgress(search.evaluations, self.seconds, search.hypervolume, front_size, budget))
        finally:
            if state is not None:
                self._save(state)
        return self._finish(ended, resumed)

    def _end_reason(self, budget: SearchBudget, stop_at_stall: bool) -> str:
        """Return why the search ends; empty if it goes on."""
        if budget.is_spent(self.search.evaluations, self.seconds):
            return "budget"
        is_settled = self.search.evaluations and not self.survey.is_open
        return "stall" if stop_at_stall and is_settled and self.search.stalled else ""

    def _save(self, state: Mapping[str, Any]) -> None:
        if self.folder is None:
            return
        content = io.BytesIO()
        np.savez_compressed(content, **state)
        self.folder.write_bytes(SEARCH, content.getvalue())

    def _restore(self, folder: RunFolder) -> None:
        path = folder.path / SEARCH
        if not path.exists():
            return
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as state:
                self.search.restore(state)
                self.seconds = float(state["seconds"])
                self.infeasible = int(state["infeasible"])
                self.tally.restore(state)
                self.survey.restore(state)
        except Exception as fault:  # numpy, zipfile, zlib and tokenize raise different ones
            raise RunFolderError(
                f"{path} is damaged ({fault}); delete it to start a new search from the front in {folder.path}"
            ) from fault

    def _evaluate(self, matrix: Array) -> Array:
        """Return the (N, M) objective values of designs; penalties for infeasible ones."""
        outcomes = self.problem.evaluate_matrix(matrix)
        values = outcomes.penalised
        self.tally.add(outcomes.violations)
        self.survey.add(outcomes)
        self.infeasible += int(np.any(values >= PENALTY, axis=1).sum())
        return values

    def _finish(self, ended: str, resumed: int) -> FrontRun:
        self._settle_reference_point()
        trials = self._front_trials()
        history = History(self.problem, trials, 0, self.config.reference_point)
        statistics = {
            "evaluations": self.search.evaluations,
            **({"infeasible": self.infeasible} if self.problem.constraints else {}),
            "seconds": round(self.seconds, 3),
            "ended_by": ended,
            "reference_point_from": self.survey.origins,
            "hypervolume_history": [[int(n), volume] for n, volume in self.search.history.tolist()],
        }
        values = self.search.values
        if self.folder is None:
            summary = summarize_front(history, self.config, values, statistics, None, self.tally)
            return FrontRun(history, self.config, summary, None, resumed)
        summary = complete_summary(self.folder.path, history)
        if summary is None or summary.get("search", {}).get("ended_by") != ended:
            self.folder.replace_trials(trials)
            verification = verify_front(history)
            summary = summarize_front(history, self.config, values, statistics, verification, self.tally)
            write_results(self.folder, history, summary, verification)
        return FrontRun(history, self.config, summary, self.folder.path, resumed)

    def _settle_reference_point(self) -> None:
        """Store the reference point that the task leaves open; a longer search may still find another."""
        point = self.survey.best_point()
        if point != self.config.reference_point:
            self.config = self.config.model_copy(update={"reference_point": point})
            if self.folder is not None:
                self.folder.write_config(self.config)
        if point != self.survey.point:
            self.search.move_reference_point(point)

    def _front_trials(self) -> list[FinishedTrial]:
        """Return the best designs of the front as trials."""
        kept = self.search.best(MAX_DESIGNS)
        matrix, values = self.search.matrix[kept], self.search.values[kept]
        violations = np.empty((len(matrix), 0))
        if self.problem.constraints:  # the search knows penalised values only
            outcomes = self.problem.evaluate_matrix(matrix)
            values, violations = outcomes.values, outcomes.violations
        return [
            FinishedTrial(number, FRONT_SEARCH, design, tuple(row), violations=tuple(violations[number].tolist()))
            for number, (design, row) in enumerate(
                zip(self.problem.space.designs(matrix), values.tolist(), strict=True)
            )
        ]


def _matrix(problem: Problem, trials: Iterable[FinishedTrial]) -> Array:
    """Return the (N, P) designs of trials."""
    return problem.space.matrix([trial.design for trial in trials]).reshape(-1, len(problem.space.parameters))


def _initial_matrix(
    problem: Problem, initial_designs: str | Path | Proposer | None
) -> tuple[Array, dict[str, Any] | None]:
    """Return the (N, P) designs of a run folder, and a record of their origin; none yet if a proposer gives them."""
    nothing = _matrix(problem, ())
    if initial_designs is None:
        return nothing, None
    if not isinstance(initial_designs, (str, Path)):
        return nothing, {"proposer": {"name": initial_designs.name, **initial_designs.settings()}}
    _, run = read_run(initial_designs)
    space = run.problem.space.model_copy(update={"name": problem.space.name})
    if space != problem.space or run.problem.task.target_specs != problem.task.target_specs:
        raise SettingsError(
            f"{initial_designs} holds a run of another task or design space ({run.problem.task.name}, "
            f"{run.problem.space.name})"
        )
    matrix = _matrix(problem, run)
    return matrix, {"run": str(initial_designs), "designs": len(matrix), "sha256": sha256(matrix.tobytes()).hexdigest()}


def _proposed_matrix(problem: Problem, proposer: Proposer, seed: int, out: Path | None) -> Array:
    """Return (N, P) designs of a proposer, from a study whose counted trials are all its own."""
    folder = None if out is None else out / PROPOSALS
    study = optimize(problem, proposer=proposer, n_step=1, n_total=N_PROPOSED, seed=seed, out=folder)
    return _matrix(problem, study.history)
