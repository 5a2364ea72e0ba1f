"""The study: n_init random trials, then blocks of n_step whose first trial is the proposer's.

Every finished trial is on disk before the next begins, and every trial is drawn from (seed, number) and the
trials before it, so a killed run goes on where it stopped and ends as if it had never stopped.
"""

import operator
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from armwright.exceptions import ProposalError, SettingsError
from armwright.history import BBO, RANDOM, FinishedTrial, FrontMember, History
from armwright.pareto import Array, FrontTracker, default_reference_point
from armwright.problem import Problem
from armwright.proposers.choice import choose_proposer
from armwright.proposers.proposer import Proposal, Proposer
from armwright.results import discard_results, results_are_there, summarize, write_results
from armwright.run_folder import Method, RunConfig, RunFolder, versions
from armwright.sampling import BlackBox, SamplerFactory, sampler_factory
from armwright.seeding import derived_seed

LARGEST = 2**31 - 1
PROPOSING = 2  # the place of the proposals' seeds under the run's seed


@dataclass(frozen=True)
class Progress:
    """What a study does now: it asks its proposer, or has finished a trial.

    iteration: counted trials finished (0 while the random ones run).
    """

    doing: Literal["proposing", "finished"]
    number: int
    iteration: int
    n_total: int
    hypervolume: float | None
    front_size: int
    source: str
    fault: str | None = None


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
    seed: int = 0,
    out: str | Path | None = None,
    watch: Callable[[Progress], None] | None = None,
) -> Run:
    """Searches `problem` and returns the run; with `out`, every trial is kept there and a second call resumes.

    proposer: "rules", "none", "auto" (a configured model, else the rules), "llm", or any Proposer.
    sampler: "tpe", "random", or a factory seed -> Optuna sampler.
    n_init random trials come first, then n_total counted ones in blocks of n_step.
    """
    if isinstance(proposer, str):
        proposer = choose_proposer(proposer).proposer
    elif isinstance(proposer, type):
        raise SettingsError(f"proposer = {proposer.__name__} is a class; give an instance of it: {proposer.__name__}()")
    config = RunConfig(
        task=problem.task,
        space=problem.space,
        reference_point=problem.reference_point,
        method=_method(proposer, sampler, n_init, n_step, n_total),
        seed=_whole("seed", seed, 0),
        versions=versions(),
    )
    with ExitStack() as stack:
        folder = None
        if out is not None:
            folder = stack.enter_context(RunFolder(Path(out)))
            config = folder.adopt(config)
        study = Study(problem, config, proposer, sampler, folder, watch)
        return study.run()


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
    ) -> None:
        self.problem = problem
        self.config = config
        self.method = config.method
        self.proposer = proposer
        self.folder = folder
        self.watch = watch
        self.black_box = BlackBox(problem.space, sampler, config.seed, len(problem.objectives))
        self.trials = folder.open_trials(problem.space) if folder is not None else []
        self.black_box.restore(self.trials)
        self._tracker = FrontTracker(len(problem.objectives), config.reference_point)
        for trial in self.trials:
            self._tracker.add(trial.values)
        self._freeze_reference_point()

    @property
    def n_trials(self) -> int:
        """Of the whole study, the random ones included."""
        return self.method.n_init + self.method.n_total

    def run(self) -> Run:
        """All trials that are still due, then the results."""
        resumed = len(self.trials)
        if self.proposer is not None:
            self.proposer.open(None if self.folder is None else self.folder.path)
            if any(self._is_proposers(number) for number in range(resumed, self.n_trials)):
                self.proposer.check()
        if resumed < self.n_trials:
            self._begin()
        for number in range(resumed, self.n_trials):
            self._step(number)
        return self._finish(resumed)

    def _begin(self) -> None:
        """Before the first new trial: results of fewer trials are taken away, other versions are noted."""
        if self.folder is None:
            return
        discard_results(self.folder.path)
        now = versions()
        if self.config.versions != now:
            earlier = [*self.config.earlier_versions, self.config.versions]
            self.config = self.config.model_copy(update={"versions": now, "earlier_versions": earlier})
            self.folder.write_config(self.config)

    def _is_proposers(self, number: int) -> bool:
        counted = number - self.method.n_init
        return self.proposer is not None and counted >= 0 and counted % self.method.n_step == 0

    def _step(self, number: int) -> None:
        started = time.perf_counter()
        proposal, fault = self._propose(number) if self._is_proposers(number) else (None, None)
        proposed = time.perf_counter()
        if proposal is not None and self.proposer is not None:
            source = self.proposer.name
            trial, design = self.black_box.inject(proposal.design, number, source, proposal.id)
        else:
            source = RANDOM if number < self.method.n_init else BBO
            trial, design = self.black_box.draw(number, source)
        sampled = time.perf_counter()
        values = tuple(self.problem.evaluate([design])[0].tolist())
        evaluated = time.perf_counter()
        noted = self.black_box.tell(trial, values)
        told = time.perf_counter()
        finished = FinishedTrial(
            number=number,
            source=source,
            design=design,
            values=values,
            proposal=proposal.id if proposal is not None else None,
            reason=proposal.reason if proposal is not None else "",
            fault=fault,
            sampler_notes=noted,
            seconds={
                "total": round(told - started, 6),
                "sampling": round(sampled - proposed + told - evaluated, 6),
                "evaluation": round(evaluated - sampled, 6),
                "proposing": round(proposed - started, 6),
            },
        )
        if self.folder is not None:
            self.folder.append(finished)
        self.trials.append(finished)
        self._tracker.add(values)
        self._freeze_reference_point()
        self._report("finished", number, source, fault)

    def _propose(self, number: int) -> tuple[Proposal | None, str | None]:
        """The proposal for this trial, or the kind of fault that left it without one."""
        assert self.proposer is not None
        self._report("proposing", number, self.proposer.name)
        try:
            proposal = self.proposer.propose(self._history(), derived_seed(self.config.seed, PROPOSING, number))
        except ProposalError as fault:
            if not any(trial.source == self.proposer.name for trial in self.trials):
                raise ProposalError(
                    fault.kind, f"{fault}; no proposal has come from {self.proposer.name} yet"
                ) from fault
            return None, fault.kind
        return proposal, None

    def _history(self) -> History:
        return History(self.problem, tuple(self.trials), self.method.n_init, self.config.reference_point)

    def _freeze_reference_point(self) -> None:
        """Writes a reference point that the task left open into config.yaml as soon as it is known."""
        if self.config.reference_point is None and len(self.trials) >= self.method.n_init:
            reference_point = default_reference_point(self._history().values[: self.method.n_init])
            self.config = self.config.model_copy(update={"reference_point": reference_point})
            self._tracker.set_reference_point(reference_point)
            if self.folder is not None:
                self.folder.write_config(self.config)

    def _report(
        self, doing: Literal["proposing", "finished"], number: int, source: str, fault: str | None = None
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
                fault=fault,
            )
        )

    def _finish(self, resumed: int) -> Run:
        history = self._history()
        summary = summarize(history, self.config, None if self.proposer is None else self.proposer.summary())
        folder = None
        if self.folder is not None:
            folder = self.folder.path
            if not results_are_there(folder, history):
                write_results(self.folder, history, summary)
        return Run(history, self.config, summary, folder, resumed)


def _method(proposer: Proposer | None, sampler: str | SamplerFactory, n_init: int, n_step: int, n_total: int) -> Method:
    factory = sampler_factory(sampler)
    name = sampler if isinstance(sampler, str) else getattr(factory, "__qualname__", type(factory).__qualname__)
    return Method(
        proposer=None if proposer is None else {"name": proposer.name, **proposer.settings()},
        sampler=name,
        n_init=_whole("n_init", n_init, 1),
        n_step=_whole("n_step", n_step, 1),
        n_total=_whole("n_total", n_total, 1),
    )


def _whole(name: str, value: Any, least: int) -> int:
    try:
        number = operator.index(value)  # numpy's whole numbers, too
    except TypeError:
        number = -1
    if isinstance(value, bool) or not least <= number <= LARGEST:
        raise SettingsError(f"{name} = {value!r}: a whole number from {least} to {LARGEST} is needed")
    return number
