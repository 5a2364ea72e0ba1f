"""A callback for `study.optimize` that asks a proposer once per block of trials and enqueues the proposal."""

import threading
from collections import Counter
from collections.abc import Mapping
from typing import Any

import optuna
from optuna.samplers import BaseSampler, GridSampler
from optuna.storages import InMemoryStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from armwright.exceptions import DesignError, ProposalError, SettingsError
from armwright.proposers.for_optuna.parameters import checked_params, observed_space
from armwright.proposers.for_optuna.proposer import StudyProposer
from armwright.search.samplers import quiet_study
from armwright.seeding import PROPOSING, derived_seed
from armwright.validation_messages import check_integer

# A child of Optuna's logger, for its verbosity and handlers. `warnings` would end a study that runs with warnings as
# errors, and would hide repeated messages.
_logger = optuna.logging.get_logger("optuna.armwright")


class ProposalCallback:
    """Makes one trial in `every` a proposal: `study.optimize(..., callbacks=[ProposalCallback(proposer, every=10)])`.

    The callback asks after trial first - 1 and every `every` trials from there, in any final state. Trial numbers
    decide, so that there is one proposal per block with n_jobs and with several processes on one storage.

    Args:
        proposer: a StudyProposer such as StudyLlmProposer.
        every: trials per block.
        first: trials before the first proposal; by default every - 1, so that each block ends with a proposal.
        seed: of the proposer's random draws.

    Attributes:
        proposed: number of enqueued proposals.
        faults: number of failed proposals by kind.
    """

    def __init__(
        self,
        proposer: StudyProposer,
        every: int = 10,
        *,
        first: int | None = None,
        seed: int = 0,
    ) -> None:
        if StudyProposer not in type(proposer).__mro__:
            raise SettingsError(f"expected an instance of StudyProposer, got {proposer!r}")
        self.proposer = proposer
        self.every = check_integer("every", every, 1)
        self.first = max(1, self.every - 1) if first is None else check_integer("first", first, 1)
        self.seed = seed
        self.proposed = 0
        self.faults: Counter[str] = Counter()
        self._given_up: str | None = None  # kind of the final error, after which no proposals are requested
        self._lock = threading.Lock()

    def __call__(self, study: optuna.Study, trial: FrozenTrial) -> None:
        """Ask for a proposal if one is due; Optuna calls this after each trial, in the trial's thread."""
        check_sampler(study.sampler)
        offset = trial.number - (self.first - 1)
        if offset < 0 or offset % self.every:
            return
        if self._given_up is not None:
            with self._lock:
                self.faults[self._given_up] += 1
            return
        number = trial.number + 1
        try:
            proposal = self.proposer.propose(study, derived_seed(self.seed, PROPOSING, number), number)
            params = checked_params(proposal.params, self.proposer.space(study), observed_space(study))
        except ProposalError as error:
            self._fail(error)
        except DesignError as error:
            self._fail(ProposalError("design", f"{self.proposer.name}: {error}"))
        else:
            enqueue(study, params, {"source": self.proposer.name, "proposal": proposal.id, "reason": proposal.reason})
            with self._lock:
                self.proposed += 1

    def _fail(self, error: ProposalError) -> None:
        with self._lock:
            self.faults[error.kind] += 1
            reported = self._given_up is not None  # by another thread in the meantime
            if error.final:
                self._given_up = error.kind
        if not reported:
            outcome = "no more proposals are requested" if error.final else "the study continues without this proposal"
            _logger.warning(f"{error}; {outcome}")


def check_sampler(sampler: BaseSampler) -> None:
    """Raise SettingsError if a sampler cannot work with enqueued trials.

    GridSampler counts only the cells that it assigned itself: a proposal in the last trials ends the study with a
    KeyError, and one that leaves a parameter out with a ValueError.
    """
    base = getattr(sampler, "_base_sampler", sampler)  # of a PartialFixedSampler
    if isinstance(base, GridSampler):
        raise SettingsError(
            f"sampler {type(base).__name__}: expected one that accepts proposals; BruteForceSampler searches a grid too"
        )


def enqueue(study: optuna.Study, params: Mapping[str, Any], attributes: Mapping[str, Any]) -> None:
    """Enqueue parameters for the next free worker.

    Genetic samplers ignore trials without a generation, and assign one only to trials whose values they draw. So the
    trial gets its generation before any worker can take it: in a copy of the study with the complete trials, from which
    generations are counted.
    """
    assign_generation = getattr(study.sampler, "get_trial_generation", None)
    if assign_generation is None:
        study.enqueue_trial(dict(params), user_attrs=dict(attributes))
        return
    copy = quiet_study(InMemoryStorage(), study.directions)
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,)):
        copy.add_trial(create_trial(values=trial.values, system_attrs=trial.system_attrs))
    copy.enqueue_trial(dict(params), user_attrs=dict(attributes))
    assign_generation(copy, copy.get_trials(deepcopy=False)[-1])
    study.add_trial(copy.get_trials()[-1])
