"""The study: n_init random trials, then blocks of n_step trials whose first is the proposer's.

Every finished trial is on disk before the next one starts, and every trial depends on (seed, number) and the trials
before it only. A killed run therefore resumes where it stopped and ends as an uninterrupted one.
"""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from armwright.exceptions import ModelError, StoppedError
from armwright.pareto import FrontTracker
from armwright.problem.checks.custom_parameters import refuse_unread_parameters
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.evaluators import evaluator_error
from armwright.problem.problem import Outcome, Problem
from armwright.proof.results import complete_summary, discard_results, summarize, write_results
from armwright.proof.verification import verify_front
from armwright.proposers.proposer import Proposer
from armwright.runs.config import RunConfig
from armwright.runs.control import Channel
from armwright.runs.folder import RunFolder
from armwright.runs.history import BBO, INITIAL_DESIGN, RANDOM, History
from armwright.search.samplers import BlackBox, SamplerFactory, sampler_for
from armwright.search.surrogate.cheap_features import FeatureFunction
from armwright.search.surrogate.left_out_errors import left_out_errors
from armwright.search.surrogate.sampler import SurrogateFactory
from armwright.spaces.parameters import Design
from armwright.study.overlapping_schedule import request_schedule
from armwright.study.pending_trial import PendingTrial, new_trial
from armwright.study.progress import Activity, Progress, StudyResult
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot, past_slots
from armwright.study.run_settings import run_config
from armwright.study.sampler_advice import sampler_advice
from armwright.study.schedule import ReplaySchedule, Schedule
from armwright.study.settings import EvaluationOptions, check_proposer, check_settings, study_method
from armwright.study.workers.cluster import Workers
from armwright.study.workers.dask_backend import DaskBackend
from armwright.study.workers.evaluation_backend import (
    Evaluated,
    EvaluationBackend,
    InProcessBackend,
    ProcessBackend,
    describe_design,
)
from armwright.study.workers.failure_watch import FailureWatch

POLL_SECONDS = 0.1  # between two checks for requests of the watcher while the study waits


def optimize(
    problem: Problem,
    *,
    proposer: str | Proposer | None = "auto",
    sampler: str | SamplerFactory = "auto",
    features: FeatureFunction | None = None,
    n_init: int = 10,
    n_step: int = 10,
    n_total: int = 200,
    in_flight: int | None = None,
    initial_designs: Sequence[Design] = (),
    screen: bool = True,
    on_model_failure: str = "stop",
    verify: bool = True,
    workers: Workers | None = None,
    evaluation_timeout: float | None = None,
    allow_failures: bool = False,
    seed: int = 0,
    out: str | Path | None = None,
    watch: Callable[[Progress], None] | None = None,
) -> StudyResult:
    """Optimise a problem: n_init random trials, then n_total counted ones in blocks of n_step.

    Args:
        problem: the problem.
        proposer: "rules", "none", "auto" (a configured model, else the rules), "llm", or a Proposer.
        sampler: "auto" (surrogate with an evaluator, else tpe), "surrogate", "tpe", "tpe-multivariate", "nsga2", "gp",
            "random", or a factory seed -> Optuna sampler.
        features: function of a design that gives the surrogate further numbers to learn from; None for none.
        n_init: random trials.
        n_step: trials of a block; its first is the proposer's.
        n_total: counted trials.
        in_flight: requests to the proposer that run while black-box trials go on; None: the study waits for each.
        initial_designs: designs of the first of the n_init trials, such as an existing arm.
        screen: whether the surrogate decides which proposals are evaluated; the sampler replaces the others.
        on_model_failure: if the model fails before the first trial, "stop" raises ModelError, and "continue" runs
            black-box trials only. A run that has started always continues.
        verify: whether the final front is verified (`proof/verification.py`); never with an evaluator.
        workers: processes that evaluate the designs; None: this process.
        evaluation_timeout: ends a call of the custom evaluator after so many seconds; the design is infeasible then.
        allow_failures: whether the run goes on if its first five evaluations all fail with the same exception.
        seed: of all random numbers.
        out: run folder, which keeps every trial; a second call resumes.
        watch: called with the progress.

    Raises:
        TaskError: it is proven that no design of the space can serve the task.
        EvaluatorError: the first five evaluations all failed with the same exception.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-1"))
        >>> run = aw.optimize(problem, proposer="rules", n_init=5, n_total=20, seed=0)
        >>> len(run.trials), run.hypervolume.shape
        (25, (20,))
        >>> [trial.number for trial in run.trials if trial.source == "rules"]
        [5, 15]
        >>> errors = [member.values[0] for member in run.front]
        >>> errors == sorted(errors)
        True
    """
    proposer = check_proposer(proposer)
    sampler = sampler_for(problem, sampler, features)
    method = study_method(proposer, sampler, n_init, n_step, n_total, in_flight, initial_designs, screen)
    evaluation = EvaluationOptions(workers, evaluation_timeout, allow_failures)
    check_settings(problem, method, evaluation, on_model_failure)
    refuse_unread_parameters(problem)
    stop_if_proven(check_instantly(problem))
    config = run_config(problem, method, seed)
    with ExitStack() as stack:
        folder = None
        if out is not None:
            folder = stack.enter_context(RunFolder(Path(out)))
            config = folder.adopt(config)
        study = Study(problem, config, proposer, sampler, folder, watch, evaluation)
        return study.run(on_model_failure, verify and problem.evaluator is None)


class Study:
    """The loop behind `optimize`."""

    def __init__(
        self,
        problem: Problem,
        config: RunConfig,
        proposer: Proposer | None,
        sampler: str | SamplerFactory,
        folder: RunFolder | None,
        watch: Callable[[Progress], None] | None,
        evaluation: EvaluationOptions,
    ) -> None:
        self._problem = problem
        self._evaluation = evaluation
        self._config = config
        self._method = config.study
        self._proposer = proposer
        self._sampler = sampler
        self._folder = folder
        self._watch = watch
        self._channel = Channel(None if folder is None else folder.path)
        self._requests: ProposalRequests | None = None
        if proposer is not None:
            notify = self._report_request if self._method.in_flight is None else None
            self._requests = ProposalRequests(proposer, config.seed, notify)
        n_objectives, names = len(problem.objectives), [constraint.description for constraint in problem.constraints]
        can_fail = problem.evaluator is not None
        self._black_box = BlackBox(problem.space, sampler, config.seed, n_objectives, names, can_fail)
        self._trials = folder.open_trials(config) if folder is not None else []
        self._black_box.restore(self._trials)
        self._first_of: dict[Design, int] = {}  # the first trial of each design
        for trial in self._trials:
            self._first_of.setdefault(trial.design, trial.number)
        self._failures = FailureWatch(self._trials, self._method.n_trials)
        self._faults = Counter(trial.fault for trial in self._trials if trial.fault)
        self._latest = History(problem, (), self._method.n_init, config.reference_point, self._method)
        self._tracker = FrontTracker(n_objectives, config.reference_point)
        self._is_frozen = problem.reference_point is not None
        for values in self._history().masked_objectives:
            self._tracker.add(values)
        self._freeze_reference_point()
        self._backend: EvaluationBackend = InProcessBackend(problem)
        self._schedule: Schedule = Schedule()
        self._pending: dict[int, PendingTrial] = {}  # by number; a trial is recorded when all before it are
        self._is_paused = False

    def run(self, on_model_failure: str, verify: bool) -> StudyResult:
        """Run the trials that are left, and write the results."""
        resumed = len(self._trials)
        try:
            if self._proposer is not None:
                self._proposer.open(None if self._folder is None else self._folder.path)
            if resumed < self._method.n_trials:
                self._search(on_model_failure)
            result = self._finish(resumed, verify)
        except BaseException as end:
            is_deliberate = isinstance(end, (KeyboardInterrupt, StoppedError))
            self._channel.report(
                "stopped", len(self._trials), None if is_deliberate else str(end) or type(end).__name__
            )
            raise
        finally:
            self._backend.close()
        self._channel.finish(len(self._trials))
        return result

    def _search(self, on_model_failure: str) -> None:
        first = len(self._trials)
        self._channel.begin(first)
        self._check_model(on_model_failure)
        if self._folder is not None:
            discard_results(self._folder.path)  # those of fewer trials
            self._config = self._folder.note_versions(self._config, self._problem.evaluator)
        self._backend = self._new_backend()
        self._schedule = self._new_schedule()
        with closing(self._schedule):
            for number in range(first, self._method.n_trials):
                self._wait_for_start(number)
                self._start_trial(number)
            while self._pending:
                self._take_results(POLL_SECONDS)

    def _new_backend(self) -> EvaluationBackend:
        workers, timeout = self._evaluation.workers, self._evaluation.timeout
        if workers is not None:
            return DaskBackend(
                self._problem, workers, timeout, lambda note: self._report("beginning", len(self._trials), note=note)
            )
        return InProcessBackend(self._problem) if timeout is None else ProcessBackend(self._problem, timeout)

    def _check_model(self, on_model_failure: str) -> None:
        """Report what the proposals will cost, and check that the proposer works."""
        if self._proposer is None or self._requests is None:
            return
        n_due = self._method.n_proposals - len(past_slots(self._history()))
        if n_due <= 0:
            return
        forecast = self._proposer.forecast(self._problem, n_due)
        if forecast:
            self._report("beginning", len(self._trials), self._proposer.name, note=forecast)
        self._channel.report("asking", len(self._trials))
        try:
            if note := self._proposer.check():
                self._report("beginning", len(self._trials), self._proposer.name, note=note)
        except ModelError as fault:
            if on_model_failure == "stop" and not self._trials:
                raise
            consequence = "the run continues"
            if fault.final is not None:
                self._requests.stop(fault.final)
                consequence = "no requests are made in this session"
            self._report("beginning", len(self._trials), self._proposer.name, note=f"{fault}; {consequence}")
            self._channel.report("evaluating", len(self._trials), str(fault))

    def _new_schedule(self) -> Schedule:
        if self._proposer is None or self._requests is None:
            return Schedule()
        record = self._proposer.recorded_trials()
        if record:
            return ReplaySchedule(self._requests, record, self._method, self._history)
        return request_schedule(self._requests, self._method, self._history)

    def _wait_for_start(self, number: int) -> None:
        """Take results until trial `number` may start; StoppedError if the watcher ended the session."""
        self._take_results(0.0)
        while not self._may_start(number):
            self._take_results(POLL_SECONDS)
        self._channel.report("evaluating", number)

    def _may_start(self, number: int) -> bool:
        """Return whether the watcher allows one more trial and a worker is free for it.

        The first counted trial waits for all random ones, on which it depends.
        """
        control = self._channel.control()
        if control.stop:
            if self._pending:
                return False
            assert self._folder is not None
            raise StoppedError(self._folder.path)
        if control.paused and not self._is_paused:
            self._channel.report("paused", number)
            self._report("paused", number, note="paused by a watcher, who can resume it; Ctrl-C ends it")
        self._is_paused = control.paused
        if control.paused or (self._pending and number == self._method.n_init):
            return False
        return sum(not pending.is_evaluated for pending in self._pending.values()) < self._backend.capacity

    def _start_trial(self, number: int) -> None:
        """Choose the design of a trial and start its evaluation; a duplicate takes the values of the first."""
        started = time.perf_counter()
        slot = self._screened(self._schedule.next(number), number)
        self._channel.report("evaluating", number, None if slot is None else slot.fault_message)
        proposed = time.perf_counter()
        optuna_trial, design, source = self._choose_design(number, slot)
        sampled = time.perf_counter()
        first = self._first_of.setdefault(design, number)
        trial = new_trial(number, source, design, slot)
        if first != number:
            trial = replace(trial, duplicate_of=first)
        pending = PendingTrial(optuna_trial, trial, slot, proposed - started, sampled - proposed)
        self._pending[number] = pending
        if first == number:
            self._backend.submit(number, design)
            return
        known = self._pending[first].trial if first in self._pending else self._trials[first]
        if known.values:
            self._tell(pending, Evaluated(Outcome(known.values, known.violations, known.failure), 0.0))

    def _screened(self, slot: ProposalSlot | None, number: int) -> ProposalSlot | None:
        """Return a slot without its proposal if the surrogate expects too little of it; else the slot."""
        if not self._method.screen or slot is None or slot.proposal is None:
            return slot
        assert self._proposer is not None
        rejection = self._black_box.rejection(slot.proposal.design, number)
        if rejection is None:
            return slot
        return slot.screened_out(self._proposer.name, rejection, self._problem.objectives)

    def _choose_design(self, number: int, slot: ProposalSlot | None) -> tuple[Any, Design, str]:
        """Return Optuna's trial, the design to evaluate, and its source."""
        source, proposal_id = RANDOM if number < self._method.n_init else BBO, None
        if slot is not None and slot.proposal is not None:
            assert self._proposer is not None
            source, given, proposal_id = self._proposer.name, slot.proposal.design, slot.proposal.id
        elif number < len(self._method.initial_designs):
            source, given = INITIAL_DESIGN, Design(self._method.initial_designs[number])
        else:
            return *self._black_box.draw(number, source), source
        return *self._black_box.inject(given, number, source, proposal_id), source

    def _take_results(self, timeout: float) -> None:
        """Pass all finished evaluations to the sampler, and record the trials that no missing one precedes.

        Args:
            timeout: how long to wait for the first result [s].
        """
        while (result := self._backend.next_result(timeout)) is not None:
            number, evaluated = result
            self._tell(self._pending[number], evaluated)
            for pending in self._pending.values():
                if pending.trial.duplicate_of == number and not pending.is_evaluated:
                    self._tell(pending, Evaluated(evaluated.outcome, 0.0))
            self._record_ready()
            timeout = 0.0
        self._record_ready()  # duplicates have no result of their own

    def _tell(self, pending: PendingTrial, evaluated: Evaluated) -> None:
        """Pass the result of a trial to the sampler at once, even if earlier trials are missing."""
        started = time.perf_counter()
        outcome = evaluated.outcome
        notes = self._black_box.tell(
            pending.optuna_trial, outcome.values, outcome.violations, outcome.failure is not None
        )
        pending.sampling += time.perf_counter() - started
        pending.finish(evaluated, notes)

    def _record_ready(self) -> None:
        """Record the evaluated trials that no missing one precedes."""
        while (pending := self._pending.get(len(self._trials))) is not None and pending.is_evaluated:
            del self._pending[len(self._trials)]
            self._record(pending)

    def _record(self, pending: PendingTrial) -> None:
        """Write an evaluated trial, which is part of the run from now on."""
        trial = pending.trial
        if self._failures.add(trial) and not self._evaluation.allow_failures:
            self._stop_failing(pending)
        if self._folder is not None:
            self._folder.append(trial)
        self._trials.append(trial)
        if trial.is_feasible:
            self._tracker.add(trial.values)
        if trial.fault:
            self._faults[trial.fault] += 1
        self._freeze_reference_point()
        note = sampler_advice(self._problem, self._method, self._trials)
        if pending.slot is not None and pending.slot.note:
            note = pending.slot.note
        self._report("finished", trial.number, trial.source, fault=trial.fault, note=note, reason=trial.reason)

    def _stop_failing(self, pending: PendingTrial) -> None:
        """Discard the trials, whose evaluations all failed in the same way, and raise EvaluatorError."""
        failure = pending.trial.failure
        assert failure is not None
        if self._folder is not None:
            self._folder.replace_trials([])
        n = 1 + sum(trial.duplicate_of is None for trial in self._trials)
        raise evaluator_error(
            f"the first {n} evaluations all failed: {failure.description}; last design: "
            f"{describe_design(pending.trial.design)}. Fix the evaluator and rerun the same command, or go on with "
            "--allow-failures",
            replace(failure, traceback=pending.traceback),
        )

    def _history(self) -> History:
        """Return the finished trials; extends the last history, so that the cost does not grow with the trials."""
        self._latest = self._latest.grown(tuple(self._trials), self._config.reference_point)
        return self._latest

    def _freeze_reference_point(self) -> None:
        """Store a reference point that the task leaves open, once the random trials give it.

        It follows the trials until enough of them have succeeded.
        """
        if self._is_frozen or len(self._trials) < self._method.n_init:
            return
        history = self._history()
        self._is_frozen = history.has_reference_trials
        reference_point = history.found_reference_point()
        if reference_point is not None and reference_point != self._config.reference_point:
            self._config = self._config.model_copy(update={"reference_point": reference_point})
            self._tracker.set_reference_point(reference_point)
            if self._folder is not None:
                self._folder.write_config(self._config)

    def _report_request(self, number: int) -> None:
        assert self._proposer is not None
        self._channel.report("asking", number)
        self._report("proposing", number, self._proposer.name, note=self._proposer.announce(number))

    def _report(
        self,
        doing: Activity,
        number: int,
        source: str = "",
        *,
        fault: str | None = None,
        note: str = "",
        reason: str = "",
    ) -> None:
        if self._watch is None:
            return
        self._watch(
            Progress(
                doing=doing,
                number=number,
                iteration=max(0, len(self._trials) - self._method.n_init),
                n_total=self._method.n_total,
                hypervolume=self._tracker.hypervolume,
                front_size=self._tracker.size,
                source=source,
                n_in_flight=self._schedule.n_in_flight,
                fault=fault,
                faults=self._faults.copy(),
                failures=self._failures.counts.copy(),
                latest_failures=self._failures.latest.copy(),
                note=note,
                reason=reason,
            )
        )

    def _finish(self, resumed: int, verify: bool) -> StudyResult:
        history = self._history()
        record = None if self._proposer is None else self._proposer.summary()
        if self._folder is None:
            summary = summarize(history, self._config, record, surrogate=self._surrogate_errors(history))
            return StudyResult(history, self._config, summary, None, resumed)
        summary = complete_summary(self._folder.path, history)
        if summary is None:
            verification = verify_front(history) if verify else None
            summary = summarize(history, self._config, record, verification, self._surrogate_errors(history))
            write_results(self._folder, history, summary, verification)
        return StudyResult(history, self._config, summary, self._folder.path, resumed)

    def _surrogate_errors(self, history: History) -> dict[str, Any] | None:
        """Return the errors of the surrogate's predictions; None with another sampler."""
        if not isinstance(self._sampler, SurrogateFactory):
            return None
        return left_out_errors(self._sampler.surrogate, history)
