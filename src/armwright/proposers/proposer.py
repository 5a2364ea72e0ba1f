"""What a proposer is. Your own needs a name and `propose`; the rest has defaults."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from armwright.history import History
from armwright.space import Design


@dataclass(frozen=True)
class Proposal:
    """A design to evaluate next, and the reason in one line."""

    design: Design
    id: str
    reason: str = ""


@dataclass(frozen=True)
class ProposerSummary:
    """What a run's proposer did and cost, for summary.json."""

    name: str
    model: str | None = None
    calls: int = 0
    tokens: int = 0
    cost_usd: float | None = None


class Proposer(Protocol):
    """Proposes one design for every n_step trials; inherit from it and write `propose`.

    name: the `source` of its trials.
    """

    name: str

    def settings(self) -> Mapping[str, Any]:
        """What must be known to repeat its proposals; kept in config.yaml. No secrets."""
        return {}

    def open(self, folder: Path | None) -> None:
        """Called first of all, with the run folder where there is one: what it did before in this run lies there."""

    def check(self) -> None:
        """Called before the first trial if a proposal is due; FailureError where the proposer cannot work."""

    def summary(self) -> ProposerSummary:
        """What it did and cost so far."""
        return ProposerSummary(self.name)

    def propose(self, history: History, seed: int) -> Proposal:
        """The next design; ProposalError where there is none (the trial becomes a black-box one).

        Must depend on nothing but `history` and `seed`, so that a killed run goes on as if it had not been.
        """
        ...
