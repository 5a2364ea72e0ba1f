"""The loop of a study: it starts trials, takes their results in any order, and records them in theirs."""

import time
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

from armwright.exceptions import ModelError
from armwright.problem.problem import Problem
from armwright.proof.results import complete_summary, discard_results, summarize, write_results
from armwright.proof.verification import verify_front
from armwright.proposers.proposer import Proposer
from armwright.runs.config import RunConfig
from armwright.runs.folder import RunFolder
from armwright.runs.history import BBO, INITIAL_DESIGN, RANDOM
from armwright.runs.trial import FinishedTrial
from armwright.search.samplers import BlackBox, SamplerFactory
from armwright.search.surrogate.sampler import SurrogateFactory
from armwright.spaces.parameters import Design
from armwright.study.overlapping_schedule import OverlappingSchedule
from armwright.study.progress import Activity, Progress, StudyResult
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot
from armwright.study.record import Record
from armwright.study.schedule import AlternatingSchedule, ReplaySchedule, Schedule
from armwright.study.settings import EvaluationOptions
from armwright.study.workers.dask_backend import DaskBackend
from armwright.study.workers.evaluation_backend import Evaluated, LocalBackend

POLL_SECONDS = 0.1  # of one wait for a result; Ctrl-C takes effect between two


@dataclass
class PendingTrial:
    """A trial that has started and is not recorded yet."""

    optuna_trial: Any
    trial: FinishedTrial  # as far as it is known; it has values once it is evaluated
    note: str  # message for the user
    proposing: float  # time spent on the proposal [s]
    sampling: float  # time spent in the sampler [s]

    @property
    def is_evaluated(self) -> bool:
        """True if the trial has values."""
        return bool(self.trial.values)


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
        self._method = config.study
        self._proposer = proposer
        self._sampler = sampler
        self._folder = folder
        self._watch = watch
        self._record = Record(problem, config, folder, evaluation.allow_failures)
        self._requests: ProposalRequests | None = None
        if proposer is not None:
            notify = self._report_request if self._method.in_flight is None else None
            self._requests = ProposalRequests(proposer, config.seed, self._method, self._record.history, notify)
        names = [constraint.description for constraint in problem.constraints]
        can_fail = problem.evaluator is not None
        self._black_box = BlackBox(problem.space, sampler, config.seed, len(problem.objectives), names, can_fail)
        self._black_box.restore(self._record.trials)
        self._first_of: dict[Design, int] = {}  # the first trial of each design
        for trial in self._record.trials:
            self._first_of.setdefault(trial.design, trial.number)
        self._backend: LocalBackend | DaskBackend
        self._schedule = Schedule()
        self._pending: dict[int, PendingTrial] = {}  # by number; a trial is recorded when all before it are

    def run(self, verify: bool) -> StudyResult:
        """Run the trials that are left, and write the results."""
        resumed = self._n_finished
        if self._proposer is not None:
            self._proposer.open(None if self._folder is None else self._folder.path)
        if resumed < self._method.n_trials:
            self._search()
        return self._finish(resumed, verify)

    def _search(self) -> None:
        first = self._n_finished
        self._check_model()
        if self._folder is not None:
            discard_results(self._folder.path)  # those of fewer trials
            self._record.config = self._folder.note_versions(self._record.config, self._problem.evaluator)
        with closing(self._new_backend()) as self._backend, closing(self._new_schedule()) as self._schedule:
            for number in range(first, self._method.n_trials):
                self._wait_for_start(number)
                self._start_trial(number)
            while self._pending:
                self._take_results(POLL_SECONDS)

    def _new_backend(self) -> LocalBackend | DaskBackend:
        workers, timeout = self._evaluation.workers, self._evaluation.timeout
        if workers is None:
            return LocalBackend(self._problem, timeout)
        return DaskBackend(self._problem, workers, timeout, self._report_beginning)

    def _check_model(self) -> None:
        """Report what the proposals will cost, and check that the proposer works; a run that has begun continues."""
        if self._proposer is None or self._requests is None:
            return
        n_due = self._method.n_proposals - len(self._requests.past_slots())
        if n_due <= 0:
            return
        forecast = self._proposer.forecast(self._problem, n_due)
        if forecast:
            self._report_beginning(forecast)
        try:
            if note := self._proposer.check():
                self._report_beginning(note)
        except ModelError as fault:
            if not self._n_finished:
                raise
            consequence = "the run continues"
            if fault.final is not None:
                self._requests.stop(fault.final)
                consequence = "no requests are made in this session"
            self._report_beginning(f"{fault}; {consequence}")

    def _new_schedule(self) -> Schedule:
        if self._proposer is None or self._requests is None:
            return Schedule()
        record = self._proposer.recorded_trials()
        if record:
            return ReplaySchedule(self._requests, record)
        in_flight = self._method.in_flight
        return (
            AlternatingSchedule(self._requests) if in_flight is None else OverlappingSchedule(self._requests, in_flight)
        )

    def _wait_for_start(self, number: int) -> None:
        """Take results until trial `number` may start."""
        self._take_results(0.0)
        while not self._may_start(number):
            self._take_results(POLL_SECONDS)

    def _may_start(self, number: int) -> bool:
        """Return whether a worker is free for one more trial.

        The first counted trial waits for all random ones, on which it depends.
        """
        if self._pending and number == self._method.n_init:
            return False
        return sum(not pending.is_evaluated for pending in self._pending.values()) < self._backend.capacity

    def _start_trial(self, number: int) -> None:
        """Choose the design of a trial and start its evaluation; a duplicate takes the values of the first."""
        started = time.perf_counter()
        slot = self._screened(self._schedule.next(number), number)
        proposed = time.perf_counter()
        optuna_trial, design, source = self._choose_design(number, slot)
        sampled = time.perf_counter()
        first = self._first_of.setdefault(design, number)
        trial = FinishedTrial(number, source, design, (), **({} if slot is None else slot.fields(number)))
        note = "" if slot is None else slot.note
        pending = self._pending[number] = PendingTrial(
            optuna_trial, trial, note, proposed - started, sampled - proposed
        )
        if first == number:
            self._backend.submit(number, design)
            return
        pending.trial = replace(trial, duplicate_of=first)
        known = self._pending[first].trial if first in self._pending else self._record.trials[first]
        if known.values:
            self._tell(pending, Evaluated(known.outcome, 0.0))

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
        if slot is not None and slot.proposal is not None:
            assert self._proposer is not None
            return *self._black_box.inject(slot.proposal.design, number), self._proposer.name
        if number < len(self._method.initial_designs):
            return *self._black_box.inject(Design(self._method.initial_designs[number]), number), INITIAL_DESIGN
        source = RANDOM if number < self._method.n_init else BBO
        return *self._black_box.draw(number, source), source

    def _take_results(self, timeout: float) -> None:
        """Pass results, the first within `timeout` [s], to the sampler; record trials that no missing one precedes."""
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
        has_failed = outcome.failure is not None
        notes = self._black_box.tell(pending.optuna_trial, outcome.values, outcome.violations, has_failed)
        sampling = pending.sampling + time.perf_counter() - started
        seconds = {
            "total": pending.proposing + sampling + evaluated.seconds,
            "sampling": sampling,
            "evaluation": evaluated.seconds,
            "proposing": pending.proposing,
        }
        pending.trial = replace(
            pending.trial,
            **vars(outcome),
            sampler_notes=notes,
            seconds={part: round(value, 6) for part, value in seconds.items()},
        )

    def _record_ready(self) -> None:
        """Record the evaluated trials that no missing one precedes."""
        while (pending := self._pending.get(self._n_finished)) is not None and pending.is_evaluated:
            trial = self._pending.pop(self._n_finished).trial
            self._record.add(trial)
            self._report(
                "finished", trial.number, trial.source, fault=trial.fault, note=pending.note, reason=trial.reason
            )

    @property
    def _n_finished(self) -> int:
        return len(self._record.trials)

    def _report_beginning(self, note: str) -> None:
        self._report("beginning", self._n_finished, note=note)

    def _report_request(self, number: int) -> None:
        assert self._proposer is not None
        self._report("proposing", number, self._proposer.name, note=self._proposer.announce(number))

    def _report(self, doing: Activity, number: int, source: str = "", **about: Any) -> None:
        """Report the progress; about: fault, note and reason."""
        if self._watch is None:
            return
        record = self._record
        failures = [(trial.number, trial.failure) for trial in record.trials if trial.failure is not None]
        self._watch(
            Progress(
                doing=doing,
                number=number,
                iteration=max(0, self._n_finished - self._method.n_init),
                n_total=self._method.n_total,
                hypervolume=record.front.hypervolume,
                front_size=record.front.size,
                source=source,
                n_in_flight=self._schedule.n_in_flight,
                faults=Counter(trial.fault for trial in record.trials if trial.fault),
                failures=Counter(failure.kind for _, failure in failures),
                latest_failures={failure.kind: f"trial {n}: {failure.description}" for n, failure in failures},
                **about,
            )
        )

    def _finish(self, resumed: int, verify: bool) -> StudyResult:
        history, config, folder = self._record.history(), self._record.config, self._folder
        summary = None if folder is None else complete_summary(folder.path, history)
        if summary is None:
            verification = verify_front(history) if verify and folder is not None else None
            proposer = None if self._proposer is None else self._proposer.summary()
            sampler = self._sampler
            errors = sampler.surrogate.left_out_errors(history) if isinstance(sampler, SurrogateFactory) else None
            summary = summarize(history, config, proposer, verification, errors)
            if folder is not None:
                write_results(folder, history, config, summary, verification)
        return StudyResult(history, config, summary, None if folder is None else folder.path, resumed)
