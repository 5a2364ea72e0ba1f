"""Under way."""

from armwright.history import History
from armwright.proposers.proposer import Proposal, Proposer


class RulesProposer(Proposer):
    """Under way."""

    name = "rules"

    def propose(self, history: History, seed: int) -> Proposal:
        return Proposal(history.problem.space.sample(1, seed)[0], f"rules-{len(history):04d}", "stub")
