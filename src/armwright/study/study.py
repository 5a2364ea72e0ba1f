"""The study: n_init random trials, then blocks of n_step whose first trial is the proposer's.

Every finished trial is on disk before the next begins, and every trial is drawn from (seed, number) and the
trials before it, so a killed run goes on where it stopped and ends as if it had never stopped.
"""

import operator
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from armwright.arrays import Array
from armwright.exceptions import ModelError, SettingsError, StoppedError
from armwright.pareto import FrontTracker
from armwright.problem.problem import Outcome, Problem
from armwright.proposers.factory import choose_proposer
from armwright.proposers.proposer import Proposer
from armwright.runs.config import Method, RunConfig, record_objectives, versions
from armwright.runs.control import Channel
from armwright.runs.folder import RunFolder
from armwright.runs.history import BBO, INITIAL_DESIGN, RANDOM, REFINE, FrontMember, History
from armwright.runs.results import discard_results, read_summary, results_are_there, summarize, write_results
from armwright.runs.trial import FinishedTrial
from armwright.runs.verification import verify_front
from armwright.search.refine import Refinement, refine_one
from armwright.search.samplers import BlackBox, SamplerFactory, sampler_name
from armwright.spaces.parameters import Design
from armwright.study.cluster import Workers
from armwright.study.dask_backend import DaskBackend
from armwright.study.evaluation_backend import Evaluated, EvaluationBackend, InProcessBackend
from armwright.study.overlapping_schedule import request_schedule
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot, past_slots
from armwright.study.schedule import Blocks, NoProposer, ReplaySchedule, Schedule

LARGEST = 2**31 - 1
ON_MODEL_FAILURE = ("stop", "continue")
LOOK_SECONDS = 0.1  # between two looks at what the watcher asks for, while there is nothing else to do


@dataclass(frozen=True)
class Progress:
    """What a study does now: it begins, asks its proposer, is paused by its watcher, or has finished a trial.

    iteration: counted trials finished (0 while the random ones run).
    n_in_flight: questions that wait for their answers while trials go on.
    fault, faults: of this trial; and of all trials so far, by kind.
    note: what the user should be told, once.
    """

    doing: Literal["beginning", "proposing", "paused", "finished"]
    number: int
    iteration: int
    n_total: int
    hypervolume: float | None
    front_size: int
    source: str
    n_in_flight: int = 0
    fault: str | None = None
    faults: Mapping[str, int] = field(default_factory=dict[str, int])
    note: str = ""


@dataclass
class _Pending:
    """A trial that has begun and is not recorded.

    Attributes:
        optuna_trial: Optuna's object.
        trial: the trial as far as it is known; it has values once it is evaluated.
        slot: the proposer's slot, if it was one.
        proposing: seconds spent on the proposal.
        sampling: seconds spent in the sampler.
    """

    optuna_trial: Any
    trial: FinishedTrial
    slot: ProposalSlot | None
    proposing: float
    sampling: float

    @property
    def is_evaluated(self) -> bool:
        return bool(self.trial.values)


@dataclass(frozen=True)
class Run:
    """A study's result."""

    history: History
    config: RunConfig
    summary: dict[str, Any]
    folder: Path | None
    resumed: int  # trials that lay on disk when it began

    @property
    def hypervolume(self) -> Array:
        """Over the counted trials, (n_total,)."""
        return self.history.hypervolume

    @property
    def front(self) -> list[FrontMember]:
        """The Pareto set, by rising position error."""
        return self.history.front

    @property
    def trials(self) -> Sequence[FinishedTrial]:
        """All trials by number."""
        return self.history.trials


def optimize(
    problem: Problem,
    *,
    proposer: str | Proposer | None = "auto",
    sampler: str | SamplerFactory = "tpe",
    n_init: int = 10,
    n_step: int = 10,
    n_total: int = 200,
    in_flight: int | None = None,
    refine_every: int | None = None,
    initial_designs: Sequence[Design] = (),
    on_model_failure: str = "stop",
    verify: bool = True,
    workers: Workers | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    watch: Callable[[Progress], None] | None = None,
) -> Run:
    """Searches `problem` and returns the run; with `out`, every trial is kept there and a second call resumes.

    proposer: "rules", "none", "auto" (a configured model, else the rules), "llm", or any Proposer.
    sampler: "tpe", "tpe-multivariate", "nsga2", "gp", "random", or a factory seed -> Optuna sampler.
    n_init random trials come first, then n_total counted ones in blocks of n_step.
    in_flight: how many questions to the proposer go on while black-box trials run; None: the study waits for each.
    refine_every: after so many counted trials, the next free one refines a design of the front (`search/refine.py`).
    initial_designs: the designs of the first of the n_init trials, such as an existing arm.
    verify: whether the front is verified where results are written (`verification.py`); not with an evaluator.
    workers: processes that evaluate designs in place of this one.
    on_model_failure: before the first trial, "stop" raises ModelError, "continue" goes on with black-box trials; a run
        that has begun always goes on.

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
    if on_model_failure not in ON_MODEL_FAILURE:
        raise SettingsError(f'on_model_failure "{on_model_failure}" is not one of {", ".join(ON_MODEL_FAILURE)}')
    if isinstance(proposer, str):
        proposer = choose_proposer(proposer).proposer
    elif isinstance(proposer, type):
        raise SettingsError(f"proposer = {proposer.__name__} is a class; give an instance of it: {proposer.__name__}()")
    method = study_method(proposer, sampler, n_init, n_step, n_total, in_flight, refine_every, initial_designs)
    for design in method.initial_designs:
        problem.space.design(design)  # says what is wrong before anything is begun
    if problem.evaluator is not None and method.refine_every is not None:
        raise SettingsError("--refine-every does not go with an evaluator: a refinement takes a thousand evaluations")
    if workers is not None and in_flight is not None:
        raise SettingsError("--overlap does not go with --workers: these go on while a question is asked")
    config = study_config(problem, method, seed)
    with ExitStack() as stack:
        folder = None
        if out is not None:
            folder = stack.enter_context(RunFolder(Path(out)))
            config = folder.adopt(config)
        study = Study(problem, config, proposer, sampler, folder, watch, workers)
        return study.run(on_model_failure, verify and problem.evaluator is None)


class Study:
    """The loop. `optimize` is the door to it."""

    def __init__(
        self,
        problem: Problem,
        config: RunConfig,
        proposer: Proposer | None,
        sampler: str | SamplerFactory,
        folder: RunFolder | None,
        watch: Callable[[Progress], None] | None,
        workers: Workers | None = None,
    ) -> None:
        self.problem = problem
        self.workers = workers
        self.config = config
        self.method = config.study
        self.proposer = proposer
        self.folder = folder
        self.watch = watch
        self._channel = Channel(None if folder is None else folder.path)
        overlap = self.method.in_flight is not None
        self._requests = (
            None if proposer is None else ProposalRequests(proposer, config.seed, None if overlap else self._asking)
        )
        n_objectives, names = len(problem.objectives), [constraint.words for constraint in problem.constraints]
        self.black_box = BlackBox(problem.space, sampler, config.seed, n_objectives, names)
        self.trials = folder.open_trials(problem.space, n_objectives, len(names)) if folder is not None else []
        self.black_box.restore(self.trials)
        self._first_of: dict[Design, int] = {}  # the first trial of each design
        for trial in self.trials:
            self._first_of.setdefault(trial.design, trial.number)
        self._faults = Counter(trial.fault for trial in self.trials if trial.fault)
        self._refined = sum(trial.refines is not None for trial in self.trials)
        self._latest = History(problem, (), self.method.n_init, config.reference_point)
        self._tracker = FrontTracker(n_objectives, config.reference_point)
        for row in self._history().masked_objectives:
            self._tracker.add(row)
        self._freeze_reference_point()
        self._backend: EvaluationBackend = InProcessBackend(problem)
        self._pending: dict[int, _Pending] = {}  # by number; a trial is recorded when all before it are
        self._is_paused = False

    @property
    def n_trials(self) -> int:
        """Of the whole study, the random ones included."""
        return self.method.n_trials

    def run(self, on_model_failure: str = "stop", verify: bool = True) -> Run:
        """All trials that are still due, then the results."""
        resumed = len(self.trials)
        try:
            if self.proposer is not None:
                self.proposer.open(None if self.folder is None else self.folder.path)
            if resumed < self.n_trials:
                self._search(on_model_failure)
            run = self._finish(resumed, verify)
        except BaseException as end:
            meant = isinstance(end, (KeyboardInterrupt, StoppedError))
            self._channel.say("stopped", len(self.trials), None if meant else str(end) or type(end).__name__)
            raise
        finally:
            self._backend.close()
        self._channel.finish(len(self.trials))
        return run

    def _search(self, on_model_failure: str) -> None:
        first = len(self.trials)
        self._channel.begin(first)
        if self.proposer is not None:
            self._check(on_model_failure)
        self._begin()
        if self.workers is not None:
            self._backend = DaskBackend(self.problem, self.workers, self._notify)
        with closing(self._new_schedule()) as schedule:
            for number in range(first, self.n_trials):
                self._wait_for_room(number, schedule)
                self._begin_trial(number, schedule)
            while self._pending:
                self._take_results(schedule, LOOK_SECONDS)

    def _wait_for_room(self, number: int, schedule: Schedule) -> None:
        """Take results until trial `number` may begin; StoppedError if the watcher ended the session."""
        self._take_results(schedule, 0.0)
        while not self._may_begin(number):
            self._take_results(schedule, LOOK_SECONDS)
        self._channel.say("evaluating", number)

    def _may_begin(self, number: int) -> bool:
        """Return whether the watcher allows one more trial and a worker is free for it.

        The first counted trial waits for all random ones, on which it depends.
        """
        asked = self._channel.asked()
        if asked.stop:
            if self._pending:
                return False
            assert self.folder is not None
            raise StoppedError(self.folder.path)
        if asked.paused and not self._is_paused:
            self._channel.say("paused", number)
            self._report("paused", number, "", note="paused by its watcher, who can let it go on; Ctrl-C ends it")
        self._is_paused = asked.paused
        if asked.paused or (self._pending and number == self.method.n_init):
            return False
        return sum(not pending.is_evaluated for pending in self._pending.values()) < self._backend.capacity

    def _take_results(self, schedule: Schedule, timeout: float) -> None:
        """Tell the sampler all results that there are, and record what can be.

        Args:
            schedule: asked how many questions are under way.
            timeout: how long to wait for the first result [s].
        """
        while (result := self._backend.next_result(timeout)) is not None:
            number, evaluated = result
            self._tell(self._pending[number], evaluated)
            for pending in self._pending.values():
                if pending.trial.duplicate_of == number and not pending.is_evaluated:
                    self._tell(pending, Evaluated(evaluated.outcome, 0.0))
            self._record_ready(schedule)
            timeout = 0.0
        self._record_ready(schedule)  # duplicates have no result of their own

    def _record_ready(self, schedule: Schedule) -> None:
        """Record the trials before which none is missing."""
        while (pending := self._pending.get(len(self.trials))) is not None and pending.is_evaluated:
            del self._pending[len(self.trials)]
            self._record(pending, schedule)

    def _notify(self, note: str) -> None:
        """Pass on news from the workers."""
        self._report("beginning", len(self.trials), "", note=note)

    def _check(self, on_model_failure: str) -> None:
        """Says what the proposals will take, and makes sure that they are to be had."""
        assert self.proposer is not None
        assert self._requests is not None
        due = Blocks.of(self.method).n_proposals - len(past_slots(self._history()))
        if due <= 0:
            return
        forecast = self.proposer.forecast(self.problem, due)
        if forecast:
            self._report("beginning", len(self.trials), self.proposer.name, note=forecast)
        self._channel.say("asking", len(self.trials))
        try:
            self.proposer.check()
        except ModelError as fault:
            if on_model_failure == "stop" and not self.trials:
                raise
            words = "the run goes on"
            if fault.final is not None:
                self._requests.stop(fault.final)
                words = "no questions are asked in this session"
            self._report("beginning", len(self.trials), self.proposer.name, note=f"{fault}; {words}")
            self._channel.say("evaluating", len(self.trials), str(fault))

    def _asking(self, number: int) -> None:
        assert self.proposer is not None
        self._channel.say("asking", number)
        self._report("proposing", number, self.proposer.name, note=self.proposer.announce(number))

    def _new_schedule(self) -> Schedule:
        if self._requests is None or self.proposer is None:
            return NoProposer()
        blocks, record = Blocks.of(self.method), self.proposer.record()
        if record is not None:
            return ReplaySchedule(self._requests, record, blocks, self._history)
        return request_schedule(self._requests, blocks, self._history, self.method.in_flight)

    def _begin(self) -> None:
        """Before the first new trial: results of fewer trials are taken away, other versions are noted."""
        if self.folder is None:
            return
        discard_results(self.folder.path)
        self.config = self.folder.note_versions(self.config, self.problem.evaluator)

    def _begin_trial(self, number: int, schedule: Schedule) -> None:
        """Choose the design of a trial and start its evaluation; a duplicate takes the values of the first."""
        started = time.perf_counter()
        slot = schedule.next(number)
        self._channel.say("evaluating", number, _fault_words(slot))
        proposed = time.perf_counter()
        refinement = self._refinement(number) if slot is None else None
        optuna_trial, design, source = self._ask(number, slot, refinement)
        sampled = time.perf_counter()
        first = self._first_of.setdefault(design, number)
        trial = _begun(number, source, design, slot)
        if first != number:
            trial = replace(trial, duplicate_of=first, evaluations=0)
        if refinement is not None:
            trial = replace(trial, refines=refinement.refines, evaluations=trial.evaluations + refinement.evaluations)
        pending = _Pending(optuna_trial, trial, slot, proposed - started, sampled - proposed)
        self._pending[number] = pending
        if first == number:
            self._backend.submit(number, design)
            return
        known = self._pending[first].trial if first in self._pending else self.trials[first]
        if known.values:
            self._tell(pending, Evaluated(Outcome(known.values, known.violations, known.failure), 0.0))

    def _tell(self, pending: _Pending, evaluated: Evaluated) -> None:
        """Let the sampler learn from a trial at once, whatever is before it."""
        started = time.perf_counter()
        outcome = evaluated.outcome
        noted = self.black_box.tell(pending.optuna_trial, outcome.values, outcome.violations)
        sampling = pending.sampling + time.perf_counter() - started
        pending.trial = replace(
            pending.trial,
            values=outcome.values,
            violations=outcome.violations,
            failure=outcome.failure,
            sampler_notes=noted,
            seconds={
                "total": round(pending.proposing + sampling + evaluated.seconds, 6),
                "sampling": round(sampling, 6),
                "evaluation": round(evaluated.seconds, 6),
                "proposing": round(pending.proposing, 6),
            },
        )

    def _record(self, pending: _Pending, schedule: Schedule) -> None:
        """Write a trial whose values are known: from now on it is part of the run."""
        finished, slot = pending.trial, pending.slot
        if self.folder is not None:
            self.folder.append(finished)
        self._count(finished)
        self._freeze_reference_point()
        note = "" if slot is None else slot.note
        if finished.failure:
            note = f"trial {finished.number}: {finished.failure}"
        self._report("finished", finished.number, finished.source, schedule, finished.fault, note)

    def _count(self, trial: FinishedTrial) -> None:
        """Takes a new trial into all that is kept of them, so that the next one costs no more after many."""
        self.trials.append(trial)
        if trial.is_feasible:
            self._tracker.add(trial.values)
        if trial.fault:
            self._faults[trial.fault] += 1

    def _refinement(self, number: int) -> Refinement | None:
        """A design of the front refined, where one is due."""
        every = self.method.refine_every
        if every is None:
            return None
        due = (number - self.method.n_init) // every
        if self._refined >= due:
            return None
        history = self._history()
        if not history.front:  # nothing is feasible yet
            return None
        self._refined += 1
        return refine_one(history, self.config.seed)

    def _ask(self, number: int, slot: ProposalSlot | None, refinement: Refinement | None) -> tuple[Any, Design, str]:
        """Optuna's trial with the design to evaluate, and where it comes from."""
        if refinement is not None and refinement.design is not None:
            return *self.black_box.inject(refinement.design, number, REFINE, None), REFINE
        if slot is not None and slot.proposal is not None:
            assert self.proposer is not None
            source = self.proposer.name
            return *self.black_box.inject(slot.proposal.design, number, source, slot.proposal.id), source
        if number < len(self.method.initial_designs):
            given = Design(self.method.initial_designs[number])
            return *self.black_box.inject(given, number, INITIAL_DESIGN, None), INITIAL_DESIGN
        source = RANDOM if number < self.method.n_init else BBO
        return *self.black_box.draw(number, source), source

    def _history(self) -> History:
        """Grown from the one before, so that a proposer's question costs no more after many trials."""
        self._latest = self._latest.grown(tuple(self.trials), self.config.reference_point)
        return self._latest

    def _freeze_reference_point(self) -> None:
        """Writes a reference point that the task left open into config.yaml as soon as it is known."""
        if self.config.reference_point is None and len(self.trials) >= self.method.n_init:
            reference_point = self._history().found_reference_point()
            self.config = self.config.model_copy(update={"reference_point": reference_point})
            self._tracker.set_reference_point(reference_point)
            if self.folder is not None:
                self.folder.write_config(self.config)

    def _report(
        self,
        doing: Literal["beginning", "proposing", "paused", "finished"],
        number: int,
        source: str,
        schedule: Schedule | None = None,
        fault: str | None = None,
        note: str = "",
    ) -> None:
        if self.watch is None:
            return
        self.watch(
            Progress(
                doing=doing,
                number=number,
                iteration=max(0, len(self.trials) - self.method.n_init),
                n_total=self.method.n_total,
                hypervolume=self._tracker.hypervolume,
                front_size=self._tracker.size,
                source=source,
                n_in_flight=0 if schedule is None else schedule.n_in_flight,
                fault=fault,
                faults=self._faults.copy(),
                note=note,
            )
        )

    def _finish(self, resumed: int, verify: bool) -> Run:
        history = self._history()
        record = None if self.proposer is None else self.proposer.summary()
        if self.folder is None:
            return Run(history, self.config, summarize(history, self.config, record), None, resumed)
        folder = self.folder.path
        summary = read_summary(folder)
        if summary is None or not results_are_there(folder, history):
            verification = verify_front(history) if verify else None
            summary = summarize(history, self.config, record, verification)
            write_results(self.folder, history, summary, verification)
        return Run(history, self.config, summary, folder, resumed)


def study_method(
    proposer: Proposer | None,
    sampler: str | SamplerFactory,
    n_init: int,
    n_step: int,
    n_total: int,
    in_flight: int | None,
    refine_every: int | None,
    initial_designs: Sequence[Design] = (),
) -> Method:
    """How `optimize` searches with these arguments; SettingsError where they do not go together."""
    if len(initial_designs) > n_init:
        raise SettingsError(
            f"{len(initial_designs)} initial designs do not fit into the n_init = {n_init} first trials"
        )
    if in_flight is not None and proposer is not None and not proposer.overlaps:
        raise SettingsError(f"--overlap does not go with the proposer {proposer.name}, which is asked one by one")
    return Method(
        proposer=None if proposer is None else {"name": proposer.name, **proposer.settings()},
        sampler=sampler_name(sampler),
        n_init=whole("n_init", n_init, 1),
        n_step=whole("n_step", n_step, 1),
        n_total=whole("n_total", n_total, 1),
        in_flight=None if in_flight is None else whole("in_flight", in_flight, 1),
        refine_every=None if refine_every is None else whole("refine_every", refine_every, 1),
        initial_designs=tuple(dict(design.params) for design in initial_designs),
    )


def study_config(problem: Problem, method: Method, seed: int) -> RunConfig:
    """The settings of a new run."""
    return RunConfig(
        task=problem.task,
        space=problem.space,
        tolerance=problem.tolerance,
        device=problem.device,
        objectives=record_objectives(problem.objectives),
        reference_point=problem.reference_point,
        method=method,
        seed=whole("seed", seed, 0),
        evaluator=None if problem.evaluator is None else problem.evaluator.name,
        versions=versions(problem.evaluator),
    )


def _fault_words(slot: ProposalSlot | None) -> str | None:
    """Why a slot came to nothing; empty where it has a design, None where there is nothing new to say."""
    if slot is None:
        return None
    return "" if slot.proposal is not None else slot.note or None


def _begun(number: int, source: str, design: Design, slot: ProposalSlot | None) -> FinishedTrial:
    """A trial that has no values yet."""
    trial = FinishedTrial(number, source, design, values=())
    if slot is None:
        return trial
    proposal = slot.proposal
    return replace(
        trial,
        proposal=None if proposal is None else proposal.id,
        reason="" if proposal is None else proposal.reason,
        expected=None if proposal is None else proposal.expected,
        fault=slot.fault,
        asked=None if slot.asked == number else slot.asked,
        feedback=None if slot.feedback == number else slot.feedback,
    )


def whole(name: str, value: Any, least: int) -> int:
    """The value as a whole number from `least` on; SettingsError where it is none."""
    try:
        number = operator.index(value)  # numpy's whole numbers, too
    except TypeError:
        number = -1
    if isinstance(value, bool) or not least <= number <= LARGEST:
        raise SettingsError(f"{name} = {value!r}: a whole number from {least} to {LARGEST} is needed")
    return number
