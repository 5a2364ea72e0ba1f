"""The interface of proposers for Optuna studies, and an adapter for proposers of arms."""

import re
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import optuna
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import DesignError, SettingsError
from armwright.files import naming_write_errors
from armwright.problem.problem import Problem
from armwright.proposers.for_optuna.parameters import Space, stated_space
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.history import BBO, History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.optuna_distributions import distributions

N_REFERENCE = 10  # first complete trials, which give the reference point if the task has none


@dataclass(frozen=True)
class StudyProposal:
    """Parameters to evaluate next; the study's sampler draws those that are missing."""

    params: Mapping[str, Any]  # values by parameter name
    id: str  # unique within the study
    reason: str = ""  # one line


class StudyProposer(Protocol):
    """Proposes trials for an Optuna study; subclass it and implement `propose`."""

    name: str  # the `source` of its trials
    given_space: Space = MappingProxyType({})  # distributions that take precedence over those of the trials so far

    def space(self, study: optuna.Study) -> Space:
        """Return the distributions of the parameters: the given ones, completed by those of the trials so far."""
        return stated_space(study, self.given_space)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Propose the next trial. Several threads may call this at a time.

        Args:
            study: the study so far.
            seed: of all random draws.
            number: approximate number of the next trial, for the id.

        Raises:
            ProposalError: There is no proposal.
        """
        ...


class ArmProposer(StudyProposer):
    """Lets a proposer of arms propose for one Optuna study over an armwright design space.

    Args:
        proposer: proposes the arms.
        problem: gives the design space and the objectives.
        folder: parent of the study's record folder; None to keep no records.
    """

    def __init__(self, proposer: Proposer, problem: Problem, folder: str | Path | None = None) -> None:
        self.name = proposer.name
        self.proposer = proposer
        self.problem = problem
        self.folder = None if folder is None else Path(folder)
        self._opened_for = ""  # name of the study's record folder
        self._ready: deque[Proposal] = deque()  # designs left from a call that returned several
        self._lock = threading.Lock()

    def space(self, study: optuna.Study) -> Space:
        """Return the distributions of the design space."""
        return distributions(self.problem.space)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Ask the proposer for a design, from the study's complete trials."""
        history = study_history(study, self.problem)
        with self._lock:
            if not self._opened_for:
                self._open(study, history)
            elif self._opened_for != _folder_name(study):
                raise SettingsError(f"proposer {self.name} proposes for another study; make one for each")
        try:
            proposal = self._ready.popleft()
        except IndexError:
            made = self.proposer.propose(history, seed, number)
            proposal, *rest = [made] if isinstance(made, Proposal) else list(made)
            self._ready.extend(rest)
        design = self.problem.space.design(proposal.design.params)
        return StudyProposal(dict(design.params), proposal.id, proposal.reason)

    def _open(self, study: optuna.Study, history: History) -> None:
        """Open the proposer with the records of this study; those of an earlier one of the same name are not reused."""
        name = _folder_name(study)
        folder = None if self.folder is None else self.folder / name
        if folder is not None:
            with naming_write_errors(folder):
                folder.mkdir(parents=True, exist_ok=True)
        self.proposer.open(folder)
        self._opened_for = name
        used = {trial.user_attrs.get("proposal") for trial in study.get_trials(deepcopy=False)}
        self._ready.extend(proposal for proposal in self.proposer.unused(history) if proposal.id not in used)


def _folder_name(study: optuna.Study) -> str:
    """Return the study's name and start time, which differs after a study was deleted and created again."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "_", study.study_name)[:60]
    started = next((trial.datetime_start for trial in study.get_trials(deepcopy=False) if trial.datetime_start), None)
    return name if started is None else f"{name}-{started:%Y%m%d-%H%M%S-%f}"


def study_history(study: optuna.Study, problem: Problem) -> History:
    """Return the complete trials of a study over `problem`, numbered without gaps.

    Raises:
        SettingsError: The objectives or trials are not those of the problem.
    """
    if study.directions != [StudyDirection.MINIMIZE] * len(problem.objectives):
        names = ", ".join(objective.name for objective in problem.objectives)
        raise SettingsError(
            f"the study has directions {', '.join(d.name.lower() for d in study.directions)}; "
            f"a study over an armwright problem minimises {len(problem.objectives)} objectives: {names}"
        )
    trials: list[FinishedTrial] = []
    error: DesignError | None = None
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,)):
        try:
            trials.append(_finished(len(trials), trial, problem))
        except DesignError as invalid:  # trials of another space are skipped
            error = invalid
    if error is not None and not trials:
        raise SettingsError(f"the study's trials are not of the design space {problem.space.name}: {error}")
    reference_point = problem.reference_point
    if reference_point is None and trials:
        reference_point = History(problem, trials, min(N_REFERENCE, len(trials))).found_reference_point()
    return History(problem, tuple(trials), 0, reference_point)


def _finished(number: int, trial: FrozenTrial, problem: Problem) -> FinishedTrial:
    attributes = trial.user_attrs
    missing = [
        constraint.description for constraint in problem.constraints if constraint.description not in trial.constraints
    ]
    if missing:
        raise SettingsError(
            f'trial {trial.number} of the study has no constraint "{missing[0]}": '
            f'call trial.set_constraint("{missing[0]}", ...) with its value in problem.evaluate([design]).violations'
        )
    return FinishedTrial(
        number,
        str(attributes.get("source", BBO)),
        problem.space.design(trial.params),
        tuple(trial.values),
        proposal=attributes.get("proposal"),
        reason=str(attributes.get("reason", "")),
        violations=tuple(trial.constraints[constraint.description] for constraint in problem.constraints),
    )
