"""What proposes for any Optuna study, and armwright's own proposers in that place."""

import re
import threading
from collections import deque
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol
from weakref import WeakValueDictionary

import optuna
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import DesignError, RunFolderError, SettingsError
from armwright.problem.problem import Problem
from armwright.proposers.for_optuna.parameters import Space, observed_space
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.history import BBO, History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.optuna_distributions import distributions

N_REFERENCE = 10  # the first complete trials, which bound the hypervolume of a task that does not


@dataclass(frozen=True)
class StudyProposal:
    """Parameters to evaluate next; what they leave out the study's sampler draws.

    id: of this proposal alone, within the study.
    reason: in one line.
    expected: the values that the proposer expects, where it says so.
    """

    params: Mapping[str, Any]
    id: str
    reason: str = ""
    expected: tuple[float, ...] | None = None


class StudyProposer(Protocol):
    """Proposes trials for an Optuna study; inherit from it and write `propose`.

    name: the `source` of its trials.
    """

    name: str

    def space(self, study: optuna.Study) -> Space:
        """The distributions that its parameters must lie in: those of the trials so far, if it knows no better."""
        return observed_space(study)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """The next trial; ProposalError where there is none.

        number: that of the trial that is asked for, or thereabouts; ids are made from it. Several threads may ask at
        a time.
        """
        ...


class ArmProposer(StudyProposer):
    """A proposer of arms, for somebody's own Optuna study over an armwright design space.

    folder: where the proposer keeps what was said, in a folder for each study; None: nowhere.

    One proposer may serve one study after the other: each begins anew, with an account of its own.
    """

    def __init__(self, proposer: Proposer, problem: Problem, folder: str | Path | None = None) -> None:
        self.name = proposer.name
        self.proposer = proposer
        self.problem = problem
        self.folder = None if folder is None else Path(folder)
        self._study: optuna.Study | None = None  # that the proposer was opened for
        self._ready: deque[Proposal] = deque()  # of a call that gave several designs
        self._asking = 0
        self._lock = threading.Lock()

    def space(self, study: optuna.Study) -> Space:
        """The design space's."""
        return distributions(self.problem.space)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """What the proposer says to the study's complete trials."""
        history = study_history(study, self.problem)
        with self._opened(study, history):
            try:
                proposal = self._ready.popleft()
            except IndexError:
                made = self.proposer.propose(history, seed, number)
                proposal, *rest = [made] if isinstance(made, Proposal) else list(made)
                self._ready.extend(rest)
        design = self.problem.space.design(proposal.design.params)
        return StudyProposal(dict(design.params), proposal.id, proposal.reason, proposal.expected)

    @contextmanager
    def _opened(self, study: optuna.Study, history: History) -> Generator[None]:
        """While the proposer serves this study, and no other.

        What was said in another study, or in an earlier one of the same name, is not taken for this one's.
        """
        with _opening:
            holder = _holders.get(id(self.proposer))
            if holder is not self or self._study is not study:
                if holder is not None and holder._asking:
                    raise SettingsError(f"proposer {self.name} is asking for another study; make one for each")
                self._open(study, history)
                _holders[id(self.proposer)] = self
            self._asking += 1
        try:
            yield
        finally:
            with _opening:
                self._asking -= 1

    def _open(self, study: optuna.Study, history: History) -> None:
        folder = None if self.folder is None else self.folder / _folder_name(study)
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as fault:
                raise RunFolderError(f"cannot write {folder}: {fault.strerror or fault}") from fault
        self.proposer.open(folder)
        self._study = study
        used = {trial.user_attrs.get("proposal") for trial in study.get_trials(deepcopy=False)}
        self._ready = deque(proposal for proposal in self.proposer.unused(history) if proposal.id not in used)


_opening = threading.Lock()
# Who serves whom: by the id of each proposer the one that opened it last, as two callbacks may hold one proposer.
_holders: WeakValueDictionary[int, ArmProposer] = WeakValueDictionary()


def _folder_name(study: optuna.Study) -> str:
    """The study's name and when it began: a study that was deleted and made again is another one."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "_", study.study_name)[:60]
    began = next((trial.datetime_start for trial in study.get_trials(deepcopy=False) if trial.datetime_start), None)
    return name if began is None else f"{name}-{began:%Y%m%d-%H%M%S-%f}"


def study_history(study: optuna.Study, problem: Problem) -> History:
    """The complete trials of a study over `problem`, numbered without gaps.

    SettingsError where its trials are none of the problem's.
    """
    if study.directions != [StudyDirection.MINIMIZE] * len(problem.objectives):
        names = ", ".join(objective.name for objective in problem.objectives)
        raise SettingsError(
            f"the study has directions {', '.join(d.name.lower() for d in study.directions)}; "
            f"a study over an armwright problem minimises {len(problem.objectives)} objectives: {names}"
        )
    trials: list[FinishedTrial] = []
    refusal: DesignError | None = None
    for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,)):
        try:
            trials.append(_finished(len(trials), trial, problem))
        except DesignError as fault:  # a trial of another space teaches nothing
            refusal = fault
    if refusal is not None and not trials:
        raise SettingsError(f"the study's trials are not of the design space {problem.space.name}: {refusal}")
    reference_point = problem.reference_point
    if reference_point is None and trials:
        reference_point = History(problem, trials, min(N_REFERENCE, len(trials))).found_reference_point()
    return History(problem, tuple(trials), 0, reference_point)


def _finished(number: int, trial: FrozenTrial, problem: Problem) -> FinishedTrial:
    noted = trial.user_attrs
    expected = noted.get("expected")
    missing = [constraint.words for constraint in problem.constraints if constraint.words not in trial.constraints]
    if missing:
        raise SettingsError(
            f'trial {trial.number} of the study does not say how far it breaks "{missing[0]}": '
            f'trial.set_constraint("{missing[0]}", ...) with its value in problem.evaluate([design]).violations'
        )
    return FinishedTrial(
        number,
        str(noted.get("source", BBO)),
        problem.space.design(trial.params),
        tuple(trial.values),
        proposal=noted.get("proposal"),
        reason=str(noted.get("reason", "")),
        expected=None if expected is None else tuple(expected),
        violations=tuple(trial.constraints[constraint.words] for constraint in problem.constraints),
    )
