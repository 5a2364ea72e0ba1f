"""Questions to one speaker: each is kept with its answer, and none goes beyond the budget."""

import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from armwright.exceptions import ProposalError
from armwright.llm.speaker import CallError, Question, Reply, Speaker
from armwright.llm.transcript import Call, Transcript
from armwright.proposers.proposer import ProposerSummary

NEVER_MADE = ("missing", "cancelled")  # faults of calls that nobody answered, and that cost nothing


class Dialogue:
    """What all that ask have in common; several threads may ask at a time.

    name: the `source` of its trials.
    max_calls, max_cost: after so many calls, or [USD], of the whole transcript it asks no more.
    """

    def __init__(
        self, speaker: Speaker, name: str, *, max_calls: int | None = None, max_cost: float | None = None
    ) -> None:
        self.name = name
        self.speaker = speaker
        self.max_calls = max_calls
        self.max_cost = max_cost
        self._transcript = Transcript(None)
        self._over = threading.Event()  # of the session, set when nothing more is wanted
        self._under_way = 0
        self._lock = threading.Lock()

    def summary(self) -> ProposerSummary:
        """Calls, tokens and cost of the whole run, earlier sessions included."""
        calls = self._transcript.calls
        costs = [call.cost_usd for call in calls if call.requests]
        return ProposerSummary(
            name=self.name,
            model=self.speaker.model,
            origin=self.speaker.origin,
            calls=sum(max(1, call.requests) for call in calls),
            call_failures=dict(Counter(call.fault for call in calls if call.fault)),
            input_tokens=sum(call.input_tokens for call in calls),
            output_tokens=sum(call.output_tokens for call in calls),
            cost_usd=sum(cost or 0.0 for cost in costs) if costs and None not in costs else None,
            seconds=round(sum(call.seconds for call in calls), 3),
        )

    def cancel(self) -> None:
        """Ends the calls under way, and begins no more in this session."""
        self._over.set()
        self.speaker.cancel()

    def _begin(self, transcript: Path | None) -> None:
        """A session begins; what was said before lies in `transcript`."""
        self._transcript = Transcript(transcript)
        self._over = threading.Event()
        self.speaker.begin()

    def _call(self, question: Question, ask: Callable[[Question], Reply], over: threading.Event) -> str:
        if over.is_set():
            raise ProposalError("cancelled", "the study is over")
        question = self._within_budget(question)
        error = None
        try:
            reply = ask(question)
        except CallError as fault:
            error, reply = fault, fault.reply
        finally:
            with self._lock:
                self._under_way -= 1
        if error is None or error.kind not in NEVER_MADE:
            self._transcript.add(self._record(question, reply, error))
        if error is not None:
            raise error
        return reply.text

    def _record(self, question: Question, reply: Reply, error: CallError | None) -> Call:
        return Call(
            proposal=question.proposal,
            step=question.step,
            known=question.known,
            origin=self.speaker.origin,
            model=self.speaker.model,
            prompt=question.prompt,
            answer=reply.text,
            requests=reply.requests,
            input_tokens=reply.input_tokens,
            output_tokens=reply.output_tokens,
            cost_usd=reply.cost_usd,
            seconds=round(reply.seconds, 3),
            fault=None if error is None else error.kind,
            error=None if error is None else str(error),
        )

    def _within_budget(self, question: Question) -> Question:
        """The question, bounded by what is left of the budget; ProposalError where nothing is left."""
        with self._lock:
            spent = self.summary()
            if self.max_calls is not None:
                left = self.max_calls - spent.calls - self._under_way
                if left <= 0:
                    raise ProposalError("budget", f"--max-calls {self.max_calls} is used up", final=True)
                question = replace(question, most_requests=left)
            if self.max_cost is not None:
                each = (spent.cost_usd or 0.0) / max(1, spent.calls)
                if (spent.cost_usd or 0.0) + each * (1 + self._under_way) > self.max_cost:
                    raise ProposalError("budget", f"--max-cost {self.max_cost:g} USD is used up", final=True)
            self._under_way += 1
        return question
