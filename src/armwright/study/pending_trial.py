"""Trials that have started and are not recorded yet."""

from dataclasses import dataclass, replace
from typing import Any

from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design
from armwright.study.proposal_requests import ProposalSlot
from armwright.study.workers.evaluation_backend import Evaluated


@dataclass
class PendingTrial:
    """A trial that has started and is not recorded yet.

    Attributes:
        optuna_trial: trial of Optuna.
        trial: the trial as far as it is known; it has values once it is evaluated.
        slot: the proposer's slot, if the trial is one.
        proposing: time spent on the proposal [s].
        sampling: time spent in the sampler [s].
        traceback: of the custom evaluator's code, if it raised.
    """

    optuna_trial: Any
    trial: FinishedTrial
    slot: ProposalSlot | None
    proposing: float
    sampling: float
    traceback: str = ""

    @property
    def is_evaluated(self) -> bool:
        """True if the trial has values."""
        return bool(self.trial.values)

    def finish(self, evaluated: Evaluated, sampler_notes: dict[str, dict[str, Any]]) -> None:
        """Store the outcome of the trial, the notes of the sampler and the times."""
        outcome, failure = evaluated.outcome, evaluated.outcome.failure
        if failure is not None:
            self.traceback, failure = failure.traceback, replace(failure, traceback="")
        self.trial = replace(
            self.trial,
            values=outcome.values,
            violations=outcome.violations,
            failure=failure,
            sampler_notes=sampler_notes,
            seconds={
                "total": round(self.proposing + self.sampling + evaluated.seconds, 6),
                "sampling": round(self.sampling, 6),
                "evaluation": round(evaluated.seconds, 6),
                "proposing": round(self.proposing, 6),
            },
        )


def new_trial(number: int, source: str, design: Design, slot: ProposalSlot | None) -> FinishedTrial:
    """Return a trial without values."""
    trial = FinishedTrial(number, source, design, values=())
    if slot is None:
        return trial
    proposal = slot.proposal
    return replace(
        trial,
        proposal=None if proposal is None else proposal.id,
        reason="" if proposal is None else proposal.reason,
        fault=slot.fault,
        screened=slot.screened,
        asked=None if slot.asked == number else slot.asked,
        feedback=None if slot.feedback == number else slot.feedback,
    )
