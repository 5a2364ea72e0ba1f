"""The interface of proposers. A custom one needs a name and `propose`; the rest has defaults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from armwright.problem.problem import Problem
from armwright.proof.summary_file import ProposerSummary
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design


@dataclass(frozen=True)
class Proposal:
    """A design to evaluate next."""

    design: Design
    id: str  # unique within the run
    reason: str = ""  # one line
    asked: int = 0  # trial that it was requested for; required for proposals of an earlier session
    known: int | None = None  # number of finished trials it was made from, if fewer than the proposer was given
    note: str = ""  # message for the user about its origin


class Proposer(Protocol):
    """Proposes one design for every n_step trials; subclass it and implement `propose`."""

    name: str  # the `source` of its trials
    overlaps: bool = True  # true if other threads may call it while black-box trials run (`in_flight`)

    def settings(self) -> Mapping[str, Any]:
        """Return what is needed to repeat the proposals, for config.yaml; no secrets."""
        return {}

    def open(self, folder: Path | None) -> None:
        """Load earlier work of this run from its folder, if it has one. Called before all other methods."""

    def forecast(self, problem: Problem, n: int) -> str:
        """Estimate what `n` more proposals take, in one line for the user; empty for nothing."""
        return ""

    def announce(self, number: int) -> str:
        """Return a message for the user during the wait for the proposal of trial `number`, or an empty text."""
        return ""

    def check(self) -> str:
        """Check that proposals are possible, and return a message for the user or an empty text.

        Called before the first trial of a session if a proposal is due.

        Raises:
            FailureError: The proposer cannot work.
        """
        return ""

    def unused(self, history: History) -> Sequence[Proposal]:
        """Return proposals of earlier sessions of this run that no trial has used yet; they go first."""
        return ()

    def recorded_trials(self) -> Sequence[FinishedTrial]:
        """Return the trials of the run that is replayed; empty if none is."""
        return ()

    def summary(self) -> ProposerSummary:
        """Return the number, cost and time of the calls so far."""
        return ProposerSummary(self.name)

    def cancel(self) -> None:
        """Cancel calls in other threads, because the study ends or was interrupted."""

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        """Propose the next design.

        The result must depend on the arguments alone, so that a killed run resumes identically. With `in_flight`, other
        threads call this.

        Args:
            history: the finished trials.
            seed: of all random draws.
            number: trial that the proposal is for; ids contain it.

        Raises:
            ProposalError: There is no proposal.
        """
        ...
