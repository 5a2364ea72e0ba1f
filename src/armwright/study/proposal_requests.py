"""Requests to a proposer, and the trials that its designs, or its faults, take."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from armwright.exceptions import DesignError, ProposalError
from armwright.problem.objective import Objective
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.config import Method
from armwright.runs.history import History
from armwright.runs.trial import ScreenedOut
from armwright.seeding import PROPOSING, derived_seed


@dataclass(frozen=True)
class ProposalSlot:
    """A trial reserved for the proposer: its proposal, or the kind of fault that left the trial without one."""

    asked: int  # trial that the proposal was requested for
    feedback: int  # finished trials that the proposer knew
    proposal: Proposal | None = None
    fault: str | None = None
    note: str = ""  # message for the user
    screened: ScreenedOut | None = None  # the proposal, if the surrogate expects too little of it to evaluate it

    def fields(self, number: int) -> dict[str, Any]:
        """Return the fields of trial `number`, which takes the slot."""
        proposal = self.proposal
        return {
            **({} if proposal is None else {"reason": proposal.reason}),
            "proposal": None if proposal is None else proposal.id,
            "fault": self.fault,
            "screened": self.screened,
            "asked": None if self.asked == number else self.asked,
            "feedback": None if self.feedback == number else self.feedback,
        }

    def screened_out(
        self, source: str, rejection: tuple[float, tuple[float, ...]], objectives: Sequence[Objective]
    ) -> "ProposalSlot":
        """Return the slot without its proposal, which is not evaluated."""
        assert self.proposal is not None
        screened = ScreenedOut(source, self.proposal.id, *rejection)
        return replace(self, proposal=None, note=screened.describe(objectives), screened=screened)


class ProposalRequests:
    """Requests proposals, until a fault that another request cannot mend.

    `history` returns the finished trials; `notify` is called with the number of the trial before each request.
    """

    def __init__(
        self,
        proposer: Proposer,
        seed: int,
        method: Method,
        history: Callable[[], History],
        notify: Callable[[int], None] | None = None,
    ) -> None:
        self.method = method
        self.history = history
        self._proposer = proposer
        self._seed = seed
        self._notify = notify
        self._final_fault: str | None = None  # the kind of the fault that ended the requests
        self._lock = threading.Lock()

    def unused(self) -> list[ProposalSlot]:
        """Return the proposals of earlier sessions that no trial has used yet."""
        return [ProposalSlot(p.asked, p.known or 0, p, note=p.note) for p in self._proposer.unused(self.history())]

    def past_slots(self) -> list[ProposalSlot]:
        """Return the slots that the finished trials took."""
        return [
            ProposalSlot(*trial.request, fault=trial.fault) for trial in self.history() if trial.request is not None
        ]

    def request(self, history: History, number: int) -> ProposalSlot:
        """Request a proposal for trial `number` after `history`; the slot holds it, or a fault."""
        known = len(history)
        if self._final_fault is not None:
            return ProposalSlot(number, known, fault=self._final_fault)
        if self._notify is not None:
            self._notify(number)
        try:
            proposal = self._proposer.propose(history, proposal_seed(self._seed, number), number)
        except ProposalError as fault:
            known = known if fault.known is None else fault.known
            return ProposalSlot(number, known, fault=fault.kind, note=self._note(fault))
        known = known if proposal.known is None else proposal.known
        try:
            history.problem.space.design(proposal.design.params)
        except DesignError as fault:
            return ProposalSlot(number, known, fault="answer", note=str(fault))
        return ProposalSlot(number, known, proposal, note=proposal.note)

    def stop(self, kind: str) -> bool:
        """Make no more requests in this session, and return True if none had stopped them before."""
        with self._lock:
            is_first, self._final_fault = self._final_fault is None, self._final_fault or kind
        return is_first

    def cancel(self) -> None:
        """Cancel the requests in flight."""
        self._proposer.cancel()

    def _note(self, fault: ProposalError) -> str:
        """Return the message for the user; only the first request that meets a final fault reports it."""
        if not fault.final:
            return str(fault)
        return f"{fault}; no more requests are made in this session" if self.stop(fault.kind) else ""


def proposal_seed(seed: int, number: int) -> int:
    """Return the seed of the request for trial `number` of a run with this seed."""
    return derived_seed(seed, PROPOSING, number)
