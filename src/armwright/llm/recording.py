"""A recorded transcript, played again: no network, no cost, the same answers to the same questions."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from armwright.exceptions import ReplayError
from armwright.llm.backend import CHECK, CallError, LlmBackend, Question, Reader, Reply
from armwright.llm.transcript import Call


class ReplayBackend(LlmBackend):
    """Answers as the calls of a record did, failures included.

    strict: whether a question in other words than the recorded one is an error.
    differing: ids of the proposals that were asked for in other words.
    """

    def __init__(self, calls: Sequence[Call], source: Path, strict: bool = False) -> None:
        self.source = source
        self.strict = strict
        self.calls = tuple(calls)
        self.model = next((call.model for call in calls), "none")
        self.origin = next((call.origin for call in calls), "model")
        self.differing: list[str] = []

    def begin(self) -> None:
        """Nothing to begin."""

    def check(self, question: Question = CHECK) -> Reply:
        """Return the first recorded check."""
        return self._play(next(call for call in self.calls if call.step == "check"))

    def ask(self, question: Question) -> Reply:
        """Return the recorded answer to this step of the proposal."""
        return self._answer(question)

    def ask_for(self, question: Question, schema: Mapping[str, Any], read: Reader) -> Reply:
        """Return the recorded answer in its stored form."""
        return self._answer(question)

    def cancel(self) -> None:
        """Nothing is ever under way."""

    def _answer(self, question: Question) -> Reply:
        place = question.proposal, question.step
        calls = [call for call in self.calls if (call.proposal, call.step) == place]
        if not calls:
            raise CallError("missing", f"{self.source} holds no {question.step} for {question.proposal}", Reply(""))
        # Of several, one was made by each session of the recorded run; the last is what it came to.
        call = calls[-1]
        if call.prompt != question.prompt:
            if self.strict:
                raise ReplayError(
                    f"the {question.step} prompt for {question.proposal} differs from the recorded one in {self.source}"
                )
            if question.proposal not in self.differing:
                self.differing.append(question.proposal)
        return self._play(call)

    def _play(self, call: Call) -> Reply:
        reply = Reply(call.answer, call.requests, call.input_tokens, call.output_tokens, call.cost_usd, call.seconds)
        if call.fault is not None:
            words = call.error or call.fault
            raise CallError(call.fault, words, reply, final=False)
        return reply
