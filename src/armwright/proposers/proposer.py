"""What a proposer is. Your own needs a name and `propose`; the rest has defaults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from armwright.problem.problem import Problem
from armwright.runs.history import History
from armwright.runs.summary import ProposerSummary
from armwright.spaces.parameters import Design


@dataclass(frozen=True)
class Proposal:
    """A design to evaluate next.

    reason: in one line.
    expected: the objectives that the proposer expects of it, where it says so.
    asked: the trial that it was asked for; needed of proposals that were made in an earlier session.
    known: how many finished trials it was made from, where fewer than the proposer was given.
    note: what the user should know of how it came about.
    """

    design: Design
    id: str
    reason: str = ""
    expected: tuple[float, ...] | None = None
    asked: int = 0
    known: int | None = None
    note: str = ""


@dataclass(frozen=True)
class RecordedTurn:
    """A proposer's turn in a run that is played again.

    asked: the trial that it was asked for.  feedback: how many finished trials were known then.
    proposal: the proposal's id; None where there was a fault instead.
    """

    asked: int
    feedback: int
    proposal: str | None


@dataclass(frozen=True)
class Record:
    """A recorded run: the proposer's turns by trial number, and how many trials it has."""

    turns: Mapping[int, RecordedTurn]
    n_trials: int


class Proposer(Protocol):
    """Proposes one design for every n_step trials; inherit from it and write `propose`.

    name: the `source` of its trials.
    per_call: how many designs one call of `propose` gives, at most.
    overlaps: whether it can be asked while black-box trials go on (--overlap), from other threads.
    """

    name: str
    per_call: int = 1
    overlaps: bool = True

    def settings(self) -> Mapping[str, Any]:
        """What must be known to repeat its proposals; kept in config.yaml. No secrets."""
        return {}

    def open(self, folder: Path | None) -> None:
        """Called first of all, with the run folder where there is one: what it did before in this run lies there."""

    def forecast(self, problem: Problem, n: int) -> str:
        """About what `n` more proposals will take, in one line for the user; empty where that is nothing."""
        return ""

    def announce(self, number: int) -> str:
        """What the user should know while the proposal for trial `number` is waited for; empty for nothing."""
        return ""

    def check(self) -> None:
        """Called before the first trial if a proposal is due; FailureError where the proposer cannot work."""

    def unused(self, history: History) -> Sequence[Proposal]:
        """Proposals of earlier sessions of this run that no trial has used yet; they go first."""
        return ()

    def record(self) -> Record | None:
        """Of a run that is played again: when its proposals entered."""
        return None

    def summary(self) -> ProposerSummary:
        """What it did and cost so far."""
        return ProposerSummary(self.name)

    def cancel(self) -> None:
        """Ends what is under way in other threads (the study ends, or was interrupted)."""

    def propose(self, history: History, seed: int, number: int) -> Proposal | Sequence[Proposal]:
        """The next design, or several to be evaluated in turn; ProposalError where there is none.

        history: the finished trials; number: the trial that is asked for (ids are made from it).

        Must depend on nothing but these, so that a killed run goes on as if it had not been. With --overlap it is
        called from other threads.
        """
        ...
