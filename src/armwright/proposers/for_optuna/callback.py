"""Proposals in somebody's own `study.optimize`: a callback that asks once a block and enqueues the answer."""

import operator
import threading
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import optuna
from optuna.storages import InMemoryStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from armwright.exceptions import DesignError, ModelError, ProposalError, SettingsError
from armwright.problem.problem import Problem
from armwright.proposers.for_optuna.parameters import checked_params, observed_space
from armwright.proposers.for_optuna.proposer import ArmProposer, StudyProposal, StudyProposer
from armwright.proposers.proposer import Proposer
from armwright.search.samplers import quiet_study
from armwright.seeding import PROPOSING, derived_seed

ON_MODEL_FAILURE = ("continue", "stop")

# Below Optuna's own logger: its verbosity and its handlers hold here, too. Not `warnings`, which would end a study
# that runs with warnings as errors, and would show a second fault of the same words to nobody.
_logger = optuna.logging.get_logger("optuna.armwright")


class ProposalCallback:
    """`study.optimize(..., callbacks=[ProposalCallback(proposer, every=10)])`: one trial in `every` is a proposal.

    proposer: what proposes for any study (StudyLlmProposer, or your own StudyProposer); with `problem`, one of
        armwright's that proposes arms (RulesProposer, LlmProposer).
    every: a proposal comes in each block of so many trials.
    first: how many trials come before the first proposal; every - 1 if not given, so that blocks end with one.
    problem: the armwright problem whose design space the study searches.
    folder: with problem, where the proposer keeps every call, in a folder for each study; of several processes each
        needs its own. (StudyLlmProposer has `transcript`.)
    seed: of the proposer's own draws.
    on_model_failure: "continue" goes on without proposals, whatever becomes of the model; "stop" raises ModelError
        from `study.optimize` if a proposal fails before there was any.

    Trial numbers decide who asks, so that there is one proposal a block with n_jobs and with several processes on one
    storage: the callback asks after trial first - 1 and every `every` trials from there, however these ended.

    proposed: how many proposals were enqueued.  faults: what became of the others, by kind.
    """

    def __init__(
        self,
        proposer: StudyProposer | Proposer,
        every: int = 10,
        *,
        first: int | None = None,
        problem: Problem | None = None,
        folder: str | Path | None = None,
        seed: int = 0,
        on_model_failure: str = "continue",
    ) -> None:
        if on_model_failure not in ON_MODEL_FAILURE:
            raise SettingsError(f'on_model_failure "{on_model_failure}" is not one of {", ".join(ON_MODEL_FAILURE)}')
        self.proposer = _study_proposer(proposer, problem, folder)
        self.every = _whole("every", every)
        self.first = max(1, self.every - 1) if first is None else _whole("first", first)
        self.seed = seed
        self.on_model_failure = on_model_failure
        self.proposed = 0
        self.faults: Counter[str] = Counter()
        self._given_up: str | None = None  # the kind of the fault that asking again does not mend
        self._lock = threading.Lock()

    def __call__(self, study: optuna.Study, trial: FrozenTrial) -> None:
        """Optuna calls this after each finished trial, in the thread that ran it."""
        since = trial.number - (self.first - 1)
        if since < 0 or since % self.every:
            return
        if self._given_up is not None:
            with self._lock:
                self.faults[self._given_up] += 1
            return
        number = trial.number + 1
        try:
            proposal = self.proposer.propose(study, derived_seed(self.seed, PROPOSING, number), number)
            params = checked_params(proposal.params, self.proposer.space(study), observed_space(study))
        except ProposalError as fault:
            self._fail(study, fault)
        except DesignError as refusal:
            self._fail(study, ProposalError("design", f"{self.proposer.name}: {refusal}"))
        else:
            enqueue(study, params, _attributes(self.proposer.name, proposal))
            with self._lock:
                self.proposed += 1

    def _fail(self, study: optuna.Study, fault: ProposalError) -> None:
        with self._lock:
            self.faults[fault.kind] += 1
            told = self._given_up is not None  # by another thread, meanwhile
            if fault.final:
                self._given_up = fault.kind
        if self.on_model_failure == "stop" and not _has_proposals(study):
            raise ModelError(str(fault)) from fault
        if not told:
            end = "no more proposals are asked for" if fault.final else "the study goes on without this proposal"
            _logger.warning(f"{fault}; {end}")


def enqueue(study: optuna.Study, params: Mapping[str, Any], attributes: Mapping[str, Any]) -> None:
    """The next free worker evaluates these parameters.

    Genetic samplers pass over trials that have no generation, and give one only to trials whose values they draw. So
    the trial gets its generation before any worker can take it and finish it: in a copy of the study that holds just
    what generations are counted from.
    """
    enlist = getattr(study.sampler, "get_trial_generation", None)
    if enlist is None:
        study.enqueue_trial(dict(params), user_attrs=dict(attributes))
        return
    copy = quiet_study(InMemoryStorage(), study.directions)
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,)):
        copy.add_trial(create_trial(values=trial.values, system_attrs=trial.system_attrs))
    copy.enqueue_trial(dict(params), user_attrs=dict(attributes))
    enlist(copy, copy.get_trials(deepcopy=False)[-1])
    study.add_trial(copy.get_trials()[-1])


def _has_proposals(study: optuna.Study) -> bool:
    """Whether this or another process has enqueued one."""
    return any("proposal" in trial.user_attrs for trial in study.get_trials(deepcopy=False))


def _attributes(source: str, proposal: StudyProposal) -> dict[str, Any]:
    """What is kept with the trial: storages keep it as JSON."""
    attributes: dict[str, Any] = {"source": source, "proposal": proposal.id, "reason": proposal.reason}
    if proposal.expected is not None:
        attributes["expected"] = list(proposal.expected)
    return attributes


def _study_proposer(
    proposer: StudyProposer | Proposer, problem: Problem | None, folder: str | Path | None
) -> StudyProposer:
    if isinstance(proposer, type):
        raise SettingsError(f"proposer = {proposer.__name__} is a class; give an instance of it: {proposer.__name__}()")
    proposes_arms = Proposer in type(proposer).__mro__
    if problem is None:
        if proposes_arms:
            raise SettingsError(
                f"proposer {proposer.name} proposes arms: give the problem too, ProposalCallback(…, problem=…)"
            )
        if folder is not None:
            raise SettingsError(f"folder {folder} goes with problem; StudyLlmProposer(transcript=…) keeps its calls")
        return proposer  # pyright: ignore[reportReturnType]
    if StudyProposer in type(proposer).__mro__:
        raise SettingsError(f"proposer {proposer.name} is for any study: leave out problem")
    return ArmProposer(proposer, problem, folder)  # pyright: ignore[reportArgumentType]


def _whole(name: str, value: Any) -> int:
    try:
        number = operator.index(value)  # numpy's whole numbers, too
    except TypeError:
        number = 0
    if isinstance(value, bool) or number < 1:
        raise SettingsError(f"{name} = {value!r}: a whole number from 1 on is needed")
    return number
