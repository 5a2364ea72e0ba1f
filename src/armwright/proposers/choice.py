"""Which proposer a run gets."""

from dataclasses import dataclass

from armwright.exceptions import SettingsError, did_you_mean
from armwright.proposers.proposer import Proposer

PROPOSERS = ("auto", "none", "rules", "llm")


@dataclass(frozen=True)
class Choice:
    """A proposer (None: black-box trials only), and why it was chosen, in one line for the user."""

    proposer: Proposer | None
    reason: str


def choose_proposer(name: str) -> Choice:
    from armwright.proposers.rules import RulesProposer
    if name == "none":
        return Choice(None, "")
    return Choice(RulesProposer(), "")
