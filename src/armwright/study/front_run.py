"""The whole front at once: our own search over the batched kernels, kept in a run folder.

search.npz    where the search stands, written every few seconds: a killed search loses no more than these
trials.jsonl  the designs of the final front; those that were evaluated on the way are counted only
proposals/    the run in which a proposer gave the first designs, where one did
"""

import io
import re
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import RunFolderError, SettingsError
from armwright.kinematics.ik import MANY_ARMS
from armwright.pareto import PENALTY
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposer
from armwright.runs.config import FrontMethod, RunConfig, record_objectives, versions
from armwright.runs.folder import PROPOSALS, SEARCH, RunFolder, read_run
from armwright.runs.history import FRONT_SEARCH, FrontMember, History, found_reference_point
from armwright.runs.results import discard_results, read_summary, results_are_there, summarize_front, write_results
from armwright.runs.trial import FinishedTrial
from armwright.runs.verification import verify_front
from armwright.search.front_search import FrontSearch
from armwright.study.study import optimize, whole

SAVE_SECONDS = 5.0
MOST_DESIGNS = 300  # of the front that become trials: those that the hypervolume would lose most without
N_SAMPLE = 10  # random designs that give the reference point, where the task states none
N_PROPOSED = 20  # designs of a proposer that the search begins with
LARGEST_BUDGET = 10**12
_BUDGET = re.compile(r"(\d+(?:\.\d+)?(?:e\d+)?)(s|min|h)?")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Budget:
    """How much a search may spend, over all its sessions; None where there is no bound."""

    evaluations: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        """SettingsError for a budget that nothing can be done with."""
        for name, bound in (("evaluations", self.evaluations), ("seconds", self.seconds)):
            if bound is not None and not 0.0 < bound <= LARGEST_BUDGET:
                raise SettingsError(f"a budget of {bound} {name}: above 0 and at most {LARGEST_BUDGET:g}")

    @classmethod
    def of(cls, words: str) -> "Budget":
        """`5s`, `2min`, `1h`, or a number of evaluations such as `100000` or `1e6`."""
        match = _BUDGET.fullmatch(words.strip().replace("_", ""))
        amount = float(match[1]) if match else 0.0
        if match is None or not 0.0 < amount <= LARGEST_BUDGET or (match[2] is None and amount != int(amount)):
            raise SettingsError(
                f'budget = "{words}" is neither a time above 0 (5s, 2min, 1h) nor a number of evaluations (100000, 1e6)'
            )
        return cls(evaluations=int(amount)) if match[2] is None else cls(seconds=amount * _SECONDS[match[2]])

    def is_spent(self, evaluations: int, seconds: float) -> bool:
        """Whether that much is all, or more."""
        bounds = ((evaluations, self.evaluations), (seconds, self.seconds))
        return any(bound is not None and spent >= bound for spent, bound in bounds)


@dataclass(frozen=True)
class FrontProgress:
    """What a search has come to so far; seconds: of all its sessions."""

    evaluations: int
    seconds: float
    hypervolume: float
    front_size: int
    budget: Budget


@dataclass(frozen=True)
class FrontRun:
    """A search's result: its history holds the designs of the front alone."""

    history: History
    config: RunConfig
    summary: dict[str, Any]
    folder: Path | None
    resumed: int  # evaluations of earlier sessions

    @property
    def front(self) -> list[FrontMember]:
        """The Pareto set, by rising position error."""
        return self.history.front


def find_front(
    problem: Problem,
    *,
    budget: str | int | Budget = "5s",
    seed: int = 0,
    initial_designs: str | Path | Proposer | None = None,
    stop_at_stall: bool = True,
    out: str | Path | None = None,
    watch: Callable[[FrontProgress], None] | None = None,
) -> FrontRun:
    """The Pareto front of `problem`, as nearly as the budget allows; with `out` a second call goes on.

    budget: a time such as "5s" (loading the kernels not included), or a number of evaluations, of which the last batch
        may go beyond it by up to 1000. With a number the result depends on the seed alone.
    initial_designs: a run folder, all of whose designs are taken, or a proposer, who gives the first designs.
    stop_at_stall: whether to end early when the hypervolume hardly grows any more.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-2"))
        >>> run = aw.find_front(problem, budget=2000, seed=0)
        >>> volume = aw.hypervolume([member.values for member in run.front], problem.reference_point)
        >>> round(volume, 6) == round(run.summary["hypervolume"]["final"], 6)
        True
    """
    budget = budget if isinstance(budget, Budget) else Budget.of(str(budget))
    seed = whole("seed", seed, 0)
    rows, origin = _beginning(problem, initial_designs)  # before a folder is made
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(RunFolder(Path(out)))
        config = RunConfig(
            task=problem.task,
            space=problem.space,
            tolerance=problem.tolerance,
            device=problem.device,
            objectives=record_objectives(problem.objectives),
            reference_point=problem.reference_point or _reference_point(problem, seed),
            method=FrontMethod(initial_designs=origin),
            seed=seed,
            versions=versions(),
        )
        if folder is not None:
            config = folder.adopt(config)
        if folder is None or not (folder.path / SEARCH).exists():
            # A proposer is asked, and paid, only once the folder is known to be ours.
            if initial_designs is not None and not isinstance(initial_designs, (str, Path)):
                rows = _proposed(problem, initial_designs, seed, None if folder is None else folder.path)
            if folder is not None:
                rows = np.vstack([rows, _rows(problem, _trials_of(problem, folder))])
        return _Search(problem, config, folder, rows, watch).run(budget, stop_at_stall)


class _Search:
    """One session of a search."""

    def __init__(
        self,
        problem: Problem,
        config: RunConfig,
        folder: RunFolder | None,
        rows: Array,
        watch: Callable[[FrontProgress], None] | None,
    ) -> None:
        self.problem = problem
        self.config = config
        self.folder = folder
        self.watch = watch
        assert config.reference_point is not None
        self.search = FrontSearch(problem.space.parameters, self._ranked, config.reference_point, config.seed, rows)
        self.seconds = 0.0  # of earlier sessions, then of all
        self.infeasible = 0  # designs, likewise
        if folder is not None:
            self._restore(folder)

    def run(self, budget: Budget, stop_at_stall: bool) -> FrontRun:
        """Searches as long as the budget lasts, then writes what was found."""
        resumed = self.search.evaluations
        few = self.problem.space.matrix(self.problem.space.sample(1, 0))
        self.problem.evaluate_matrix(np.repeat(few, MANY_ARMS, axis=0))  # so many load all kernels that are used
        ended = self._end(budget, stop_at_stall)
        if not ended and self.folder is not None:
            discard_results(self.folder.path)
            self.config = self.folder.note_versions(self.config)
        state = None  # after the last whole generation, as a Ctrl-C may fall into the midst of one
        try:
            before, saved = self.seconds, time.monotonic()
            started = saved
            while not (ended := self._end(budget, stop_at_stall)):
                self.search.step()
                now = time.monotonic()
                self.seconds = before + now - started
                state = {"seconds": self.seconds, "infeasible": self.infeasible, **self.search.state()}
                if now - saved >= SAVE_SECONDS:
                    self._save(state)
                    saved = now
                if self.watch is not None:
                    self.watch(self._progress(budget))
        finally:
            if state is not None:
                self._save(state)
        return self._finish(ended, resumed)

    def _end(self, budget: Budget, stop_at_stall: bool) -> str:
        """Why the search ends; empty where it goes on."""
        if budget.is_spent(self.search.evaluations, self.seconds):
            return "budget"
        return "stall" if stop_at_stall and self.search.evaluations and self.search.stalled else ""

    def _progress(self, budget: Budget) -> FrontProgress:
        search = self.search
        return FrontProgress(search.evaluations, self.seconds, search.hypervolume, len(search.matrix), budget)

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
        except Exception as fault:  # numpy, zipfile, zlib and tokenize each have their own
            raise RunFolderError(
                f"{path} is damaged ({fault}); delete it, and the search begins anew with the front in {folder.path}"
            ) from fault

    def _ranked(self, rows: Array) -> Array:
        """(N, M) what the search compares designs by."""
        ranks = self.problem.evaluate_matrix(rows).penalised
        self.infeasible += int(np.any(ranks >= PENALTY, axis=1).sum())
        return ranks

    def _finish(self, ended: str, resumed: int) -> FrontRun:
        kept = self.search.best(MOST_DESIGNS)
        designs, values = self.problem.space.designs(self.search.matrix[kept]), self.search.values[kept]
        broken = np.empty((len(designs), 0))
        if self.problem.constraints:  # the search knows their ranks alone
            outcomes = self.problem.evaluate_matrix(self.search.matrix[kept])
            values, broken = outcomes.values, outcomes.violations
        trials = [
            FinishedTrial(
                number, FRONT_SEARCH, design, tuple(values[number].tolist()), violations=tuple(broken[number].tolist())
            )
            for number, design in enumerate(designs)
        ]
        history = History(self.problem, trials, 0, self.config.reference_point)
        searched = {
            "evaluations": self.search.evaluations,
            **({"infeasible": self.infeasible} if self.problem.constraints else {}),
            "seconds": round(self.seconds, 3),
            "ended_by": ended,
            "hypervolume_history": [[int(n), volume] for n, volume in self.search.history.tolist()],
        }
        found = self.search.values
        if self.folder is None:
            summary = summarize_front(history, self.config, found, searched, None)
            return FrontRun(history, self.config, summary, None, resumed)
        path = self.folder.path
        there = read_summary(path)
        ended_before = None if there is None else there.get("search", {}).get("ended_by")
        if there is None or not results_are_there(path, history) or ended_before != ended:
            self.folder.replace_trials(trials)
            verification = verify_front(history)
            there = summarize_front(history, self.config, found, searched, verification)
            write_results(self.folder, history, there, verification)
        return FrontRun(history, self.config, there, path, resumed)


def _reference_point(problem: Problem, seed: int) -> tuple[float, ...]:
    """For a task that states none: from a few random designs."""
    found = problem.evaluate(problem.space.sample(N_SAMPLE, seed))
    return found_reference_point(found.values, found.violations)


def _trials_of(problem: Problem, folder: RunFolder) -> list[FinishedTrial]:
    """That lie in the folder."""
    return folder.open_trials(problem.space, len(problem.objectives), len(problem.constraints))


def _rows(problem: Problem, trials: Iterable[FinishedTrial]) -> Array:
    """(N, P) their designs."""
    return problem.space.matrix([trial.design for trial in trials]).reshape(-1, len(problem.space.parameters))


def _beginning(problem: Problem, initial_designs: str | Path | Proposer | None) -> tuple[Array, dict[str, Any] | None]:
    """(N, P) designs that are there already, and where they come from; none yet where a proposer is to give them."""
    nothing = _rows(problem, ())
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
    rows = _rows(problem, run)
    return rows, {"run": str(initial_designs), "designs": len(rows), "sha256": sha256(rows.tobytes()).hexdigest()}


def _proposed(problem: Problem, proposer: Proposer, seed: int, out: Path | None) -> Array:
    """(N, P) a proposer's designs, from a study whose counted trials are all its own: kept and paid for as in any."""
    folder = None if out is None else out / PROPOSALS
    study = optimize(problem, proposer=proposer, n_step=1, n_total=N_PROPOSED, seed=seed, out=folder)
    return _rows(problem, study.history)
