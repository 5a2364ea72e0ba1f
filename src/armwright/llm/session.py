"""A session with one backend: each question is recorded with its answer, and none exceeds the budget."""

import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from armwright.llm.backend import CallError, Interrupted, LlmBackend, Question, Reply
from armwright.llm.budget import CallBudget
from armwright.llm.transcript import Call, Transcript
from armwright.runs.summary import ProposerSummary

UNBILLED = ("missing", "cancelled")  # faults of calls that cost nothing unless a request was answered


class LlmSession:
    """Ask one backend, within a budget, and record every call; several threads may ask at a time.

    Args:
        backend: Who answers.
        name: The `source` of its trials.
        budget: Limits of the whole transcript; None for no limits.
    """

    def __init__(self, backend: LlmBackend, name: str, budget: CallBudget | None = None) -> None:
        self.name = name
        self.backend = backend
        self._budget = budget or CallBudget()
        self._transcript = Transcript(None)
        self._over = threading.Event()  # set when no more answers are wanted in this session

    def summary(self) -> ProposerSummary:
        """Return calls, tokens and cost of the whole run, earlier sessions included."""
        return self._summary(self._transcript.calls)

    def _summary(self, calls: Sequence[Call]) -> ProposerSummary:
        costs = [call.cost_usd for call in calls if call.requests]
        return ProposerSummary(
            name=self.name,
            model=self.backend.model,
            origin=self.backend.origin,
            calls=sum(max(1, call.requests) for call in calls),
            call_failures=dict(Counter(call.fault for call in calls if call.fault)),
            input_tokens=sum(call.input_tokens for call in calls),
            output_tokens=sum(call.output_tokens for call in calls),
            cost_usd=sum(cost or 0.0 for cost in costs) if costs and None not in costs else None,
            seconds=round(sum(call.seconds for call in calls), 3),
        )

    def cancel(self) -> None:
        """Cancel all calls and start no more in this session."""
        self._over.set()
        self._budget.wake()
        self.backend.cancel()

    def _begin(self, transcript: Path | None) -> None:
        """Start a session; `transcript` holds the earlier ones."""
        self._transcript = Transcript(transcript)
        self._budget.begin(self._transcript.calls)
        self._over = threading.Event()
        self.backend.begin()

    def _call(self, question: Question, ask: Callable[[Question], Reply], over: threading.Event) -> str:
        """Return the answer; answer and cost are recorded even if Ctrl-C interrupts the call."""
        with self._budget.reserved(over.is_set) as requests:
            try:
                reply = ask(replace(question, most_requests=requests))
            except (CallError, Interrupted) as fault:
                if fault.kind not in UNBILLED or fault.reply.requests:
                    self._keep(self._record(question, fault.reply, fault))
                raise
            self._keep(self._record(question, reply, None))
        return reply.text

    def _keep(self, call: Call) -> None:
        self._budget.spend(call)
        self._transcript.add(call)

    def _record(self, question: Question, reply: Reply, error: CallError | Interrupted | None) -> Call:
        return Call(
            proposal=question.proposal,
            step=question.step,
            known=question.known,
            origin=self.backend.origin,
            model=self.backend.model,
            prompt=question.prompt,
            answer=reply.text,
            requests=reply.requests,
            input_tokens=reply.input_tokens,
            output_tokens=reply.output_tokens,
            cost_usd=reply.cost_usd,
            seconds=round(reply.seconds, 3),
            fault=None if error is None else error.kind,
            error=None if error is None else str(error),
            hints=question.hints,
        )
