"""One session of a direct search: generations until the budget is spent or the search stalls, then the results."""

import io
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from armwright.arrays import Array, open_arrays
from armwright.exceptions import RunFolderError
from armwright.kinematics.ik.ik import MANY_ARMS
from armwright.pareto import PENALTY
from armwright.problem.problem import Problem
from armwright.proof.infeasibility import ViolationTally
from armwright.proof.perturbations import Survival
from armwright.proof.recommendation import unsafe_roles
from armwright.proof.results import complete_summary, discard_results, read_summary, summarize_front, write_results
from armwright.proof.verification import Verification, front_survival, verify, verify_front
from armwright.runs.config import RunConfig
from armwright.runs.folder import SEARCH, RunFolder, read_run
from armwright.runs.history import FRONT_SEARCH, History
from armwright.runs.trial import FinishedTrial
from armwright.search.front.front_search import FrontSearch
from armwright.search.front.screening import Screen, pays
from armwright.search.front.variation import offspring
from armwright.study.front.evaluation_pool import EvaluationPool
from armwright.study.front.reference_survey import ReferenceSurvey
from armwright.study.front.reported_front import reported_front
from armwright.study.front.safe_search import find_safe_design
from armwright.study.front.search_budget import SearchProgress
from armwright.study.front.time_plan import MAX_DESIGNS, ChunkSize, TimePlan, files_seconds
from armwright.study.progress import RunResult

SAVE_SECONDS = 5.0
SHORT = 1_200  # evaluations on tasks with a cycle: searches of fewer find more after a smaller first generation
SHORT_FIRST_BATCH = 200  # random designs in that first generation
LONG, LONG_SECONDS = 2_000, 20.0  # evaluations and [s]: searches with cycles and such budgets start other processes
N_MEASURED, LONG_SHARE = (1, 8), 0.02  # designs that verification is timed on: more if one takes a smaller share


class FrontRun(RunResult):
    """Result of a direct search: its history holds the designs of the front only, `resumed` counts evaluations."""


class DirectSearch:
    """One session of a direct search."""

    def __init__(
        self,
        problem: Problem,
        config: RunConfig,
        folder: RunFolder | None,
        matrix: Array,
        plan: TimePlan,
        watch: Callable[[SearchProgress], None] | None,
    ) -> None:
        self.problem = problem
        self.config = config
        self.folder = folder
        self.plan = plan
        self.watch = watch
        self.survey = ReferenceSurvey(problem, config.seed)
        self.pool = EvaluationPool(problem)
        self.screen = Screen(problem, lambda: self.survey.point, self.pool.estimates) if pays(problem) else None
        vary = offspring if self.screen is None else self.screen.offspring
        parameters = problem.space.parameters
        self.search = FrontSearch(parameters, self._evaluate, self.survey.point, config.seed, matrix, vary)
        self.n_known = len(matrix)
        self.seconds = 0.0  # of earlier sessions
        self.resumed = 0  # evaluations of earlier sessions
        self.ended_after = 0.0  # largest time budget that has ended the search [s]
        self.chunk_size = ChunkSize(plan.budget)
        self.asking = 0.0  # of the latest generation: time that screening its designs took [s]
        self.infeasible = 0  # designs of all sessions
        self.tally = ViolationTally(len(problem.constraints))  # of all sessions
        if folder is not None:
            self._restore(folder)

    def run(self, stop_at_stall: bool) -> FrontRun:
        """Search until the budget is spent or the search stalls, then write the results."""
        ended = self._end_reason(stop_at_stall)
        self._load_kernels(not ended)
        self.plan.begin_search()
        if not ended and self.folder is not None:
            discard_results(self.folder.path)
            self.config = self.folder.note_versions(self.config)
        state = None  # after the last complete generation: Ctrl-C may interrupt one
        try:
            if not ended and self._is_long:
                self.pool.start()
            saved = time.monotonic()
            while not (ended := self._end_reason(stop_at_stall)):
                started = self.plan.elapsed
                matrix = self.search.ask()
                self.asking = self.plan.elapsed - started
                values = self._evaluate(matrix)
                self.search.tell(matrix[: len(values)], values)
                if self.survey.close():
                    self._move_reference_point(self.survey.point)
                state = self._state()
                if time.monotonic() - saved >= SAVE_SECONDS:
                    self._save(state)
                    saved = time.monotonic()
                self._report(0)
            budget = self.plan.budget
            if state is not None and budget.seconds is not None and ended == "budget" and not self._is_exhausted:
                self.ended_after = budget.seconds
                state = self._state()
        finally:
            self.pool.close()
            if state is not None:
                self._save(state)
        self._report(0, is_ended=True)
        return self._finish(ended, self.searched)

    @property
    def searched(self) -> float:
        """Search time of all sessions [s]."""
        return self.seconds + self.plan.search_seconds

    def _load_kernels(self, for_results: bool) -> None:
        """Load the kernels. Those of a cycle are loaded by one design: evaluating many of them takes seconds."""
        few = self.problem.space.matrix(self.problem.space.sample(1, 0))
        is_fast = self.problem.task.cycle is None and self.problem.tolerance == 0.0
        outcomes = self.problem.evaluate(np.repeat(few, MANY_ARMS if is_fast else 1, axis=0))
        if for_results and self._is_result_timed:
            self._verify(few, outcomes.values[:1])

    @property
    def _is_result_timed(self) -> bool:
        """True if designs are verified, and there is a limit of time."""
        return self.folder is not None and self.plan.budget.seconds is not None

    def _verify(self, matrix: Array, values: Array) -> None:
        verify(self.problem, matrix, values, self.survey.best_point())

    def _end_reason(self, stop_at_stall: bool) -> str:
        """Return why the search ends; empty if it goes on."""
        if not self.search.evaluations:
            return ""
        is_late = self.plan.search_left <= self.asking or self.ended_after >= (self.plan.budget.seconds or math.inf)
        if self._is_exhausted or is_late:
            return "budget"
        is_settled = not self.survey.is_open
        return "stall" if stop_at_stall and is_settled and self.search.stalled else ""

    @property
    def _is_exhausted(self) -> bool:
        """True if no evaluations are left in the budget."""
        return self.search.evaluations >= (self.plan.budget.evaluations or math.inf)

    @property
    def _is_long(self) -> bool:
        """True if the search saves more time by other processes than they take to start."""
        budget = self.plan.budget
        is_long = (budget.evaluations or math.inf) >= LONG and (budget.seconds or math.inf) >= LONG_SECONDS
        return is_long and self.screen is not None

    def _is_short(self, done: int) -> bool:
        """Return whether the budget leaves few evaluations, by the rate of those that are done."""
        rate = done / max(self.plan.search_seconds, 1e-9)
        affordable = done + rate * max(0.0, self.plan.search_left)
        return min(affordable, self.plan.budget.evaluations or math.inf) - self.n_known < SHORT

    def _state(self) -> dict[str, Any]:
        """Return what a later session needs."""
        times = {"seconds": self.searched, "spent": self.plan.spent, "ended_after": self.ended_after}
        state = {**times, "infeasible": self.infeasible, **self.tally.state()}
        screen = {} if self.screen is None else self.screen.state()
        return {**state, **self.survey.state(), **self.search.state(), **screen}

    @property
    def _n_feasible(self) -> int:
        """Number of feasible designs on the front; the search keeps the nearest to one if there is none."""
        return int(np.all(self.search.values < PENALTY, axis=1).sum())

    def _report(self, evaluated: int, is_ended: bool = False) -> None:
        """Report the progress; evaluated: designs of the generation that is being evaluated."""
        if self.watch is None:
            return
        search, plan = self.search, self.plan
        self.watch(
            SearchProgress(
                evaluations=search.evaluations + evaluated,
                seconds=self.searched,
                hypervolume=None if self.survey.is_open else search.hypervolume,
                front_size=self._n_feasible,
                budget=plan.budget,
                seconds_left=max(0.0, plan.search_left),
                is_ended=is_ended,
            )
        )

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
            with open_arrays(path) as state:
                self.search.restore(state)
                self.seconds = float(state["seconds"])
                self.ended_after = float(state["ended_after"])
                self.resumed = self.search.evaluations
                # The results of an extended search take part of the budget that ended it.
                is_extended = self.ended_after < (self.plan.budget.seconds or math.inf)
                self.plan.earlier = max(float(state["spent"]), self.ended_after * is_extended)
                self.infeasible = int(state["infeasible"])
                self.tally.restore(state)
                self.survey.restore(state)
                if self.screen is not None:
                    self.screen.restore(state)
        except Exception as fault:  # numpy, zipfile, zlib and tokenize raise different ones
            raise RunFolderError(
                f"{path} is damaged ({fault}); delete it to start a new search from the front in {folder.path}"
            ) from fault

    def _evaluate(self, matrix: Array) -> Array:
        """Return the (N, M) objective values of designs, penalties for infeasible ones.

        The rest of a generation is skipped when the time is up. In a short search, so is the rest of the first one.
        """
        parts: list[Array] = []
        done = 0
        cut = self.n_known + SHORT_FIRST_BATCH if self.screen is not None and not self.search.evaluations else 0
        while done < len(matrix) and (not done or self.plan.search_left > 0.0):
            if done == cut > 0 and self._is_short(done):
                break
            if done:
                self._report(done)
            end = done + self.chunk_size.value
            chunk, started = matrix[done : min(end, cut) if done < cut else end], self.plan.elapsed
            outcomes = self.pool.evaluate(chunk)
            self.chunk_size.adapt(len(chunk), self.plan.elapsed - started)
            parts.append(outcomes.penalised)
            done += len(chunk)
            self.tally.add(outcomes.violations)
            self.survey.add(outcomes)
            if self.screen is not None:
                self.screen.learn(chunk, outcomes)
        values = np.vstack(parts)
        self.infeasible += int(np.any(values >= PENALTY, axis=1).sum())
        return values

    def _finish(self, ended: str, seconds: float) -> FrontRun:
        """Write the results; seconds: search time of all sessions."""
        self._settle_reference_point()
        trials, found = self._reported_trials()
        history = History(self.problem, trials, 0, self.config.reference_point)
        statistics = {
            "evaluations": self.search.evaluations,
            **({"infeasible": self.infeasible} if self.problem.constraints else {}),
            "seconds": round(seconds, 3),
            "ended_by": ended,
            "reference_point_from": self.survey.origins,
            "found": found,
            "hypervolume_history": [[int(n), volume] for n, volume in self.search.history.tolist()],
        }

        folder = self.folder
        summary = None if folder is None else complete_summary(folder.path, history)
        if summary is None or summary.get("search", {}).get("ended_by") != ended:
            after = len(trials) * files_seconds(self.problem.task)

            def left() -> float:
                return self.plan.left - after

            history, verification, survival = self._with_safe_design(history, left)
            values = np.vstack([self.search.values, history.masked_objectives])
            summary = summarize_front(
                history, self.config, values, statistics, verification, survival, self.tally, left
            )
            if folder is not None:
                folder.replace_trials(list(history))
                write_results(folder, history, self.config, summary, verification)
        return FrontRun(history, self.config, summary, None if folder is None else folder.path, self.resumed)

    def _with_safe_design(
        self, history: History, left: Callable[[], float]
    ) -> tuple[History, Verification | None, dict[int, Survival]]:
        """Verify the front, and add a design that holds if recommended ones do not; return its survival by number."""
        verification = None if self.folder is None else verify_front(history)
        survival = front_survival(history, verification)
        found, each = None, self.chunk_size.seconds / self.chunk_size.value
        if unsafe_roles(history, survival):
            found = find_safe_design(history, survival, left, each, self.config.seed)
        if found is None:
            return history, verification, survival
        trial, own = found
        grown = History(self.problem, [*history, trial], 0, self.config.reference_point)
        if [member.number for member in grown.front] != [member.number for member in history.front]:
            verification = None if self.folder is None else verify_front(grown)
            survival = front_survival(grown, verification)
        return grown, verification, {**survival, trial.number: own}

    def _settle_reference_point(self) -> None:
        """Store the reference point that the task leaves open; a longer search may still find another."""
        point = self.survey.best_point()
        if point != self.config.reference_point:
            self.config = self.config.model_copy(update={"reference_point": point})
            if self.folder is not None:
                self.folder.write_config(self.config)
        if point != self.survey.point:
            self._move_reference_point(point)

    def _move_reference_point(self, point: tuple[float, ...]) -> None:
        """Bound the hypervolume by another point, what is known of the past included."""
        self.search.move_reference_point(point, self.survey.history(point))

    def _reported_trials(self) -> tuple[list[FinishedTrial], int]:
        """Return the designs that are reported as trials, those of a finished run, and how many were found."""
        stored = None if self.folder is None else read_summary(self.folder.path)
        if self.folder is not None and stored is not None:
            _, history = read_run(self.folder.path)
            if len(history) == stored["n_trials"]:
                return list(history), stored["search"]["found"]
        point, n = self.survey.best_point(), self._affordable_designs()
        front = reported_front(self.problem, self.search.matrix, self.search.values, point, n)
        outcomes = self.problem.evaluate(front.matrix)
        values = outcomes.values if self.problem.constraints else front.values  # penalised with constraints
        designs = self.problem.space.designs(front.matrix)
        trials = [
            FinishedTrial(n, FRONT_SEARCH, design, **vars(replace(outcome, values=tuple(row))))
            for n, (design, row, outcome) in enumerate(zip(designs, values.tolist(), outcomes, strict=True))
        ]
        return trials, front.found

    def _affordable_designs(self) -> int:
        """Return how many designs of the front there is time to verify and write, by the time that some take."""
        if not self._is_result_timed:
            return MAX_DESIGNS
        seconds = 0.0
        for n in N_MEASURED:
            started, matrix = self.plan.elapsed, self.search.matrix[:n]
            self._verify(matrix, self.search.values[:n])
            spent = self.plan.elapsed - started
            seconds = spent / len(matrix)
            if spent > LONG_SHARE * self.plan.session:
                break
        return self.plan.n_designs(seconds + files_seconds(self.problem.task))
