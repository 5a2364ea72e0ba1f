"""Replay of a transcript: no network, no cost, the same answers to the same questions."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from armwright.exceptions import ReplayError
from armwright.llm.backend import CallError, LlmBackend, OutputFormat, Question, Reply, Turn
from armwright.llm.transcript import Call, tries


class ReplayBackend(LlmBackend):
    """Answer as recorded calls did, failures included.

    Args:
        calls: The recorded calls.
        source: Their file, for messages.
        strict: Treat a prompt that differs from the recorded one as an error.

    Attributes:
        differing: Ids of the proposals whose prompts differ.
    """

    def __init__(self, calls: Sequence[Call], source: Path, strict: bool = False) -> None:
        self.source = source
        self.strict = strict
        self.calls = tuple(calls)
        self.model = next((call.model for call in calls), "none")
        self.origin = next((call.origin for call in calls), "model")
        self.differing: list[str] = []
        self._asked: Counter[tuple[str, str]] = Counter()  # how often each step of a proposal was asked for

    def check(self, output_mode: str = "", most_requests: int | None = None) -> Reply:
        """Return the first recorded check."""
        return self._play(next(call for call in self.calls if call.step == "check"))

    def ask(
        self,
        question: Question,
        output: OutputFormat | None = None,
        most_requests: int | None = None,
        earlier: Sequence[Turn] | None = None,
    ) -> Reply:
        """Return the recorded answer to this step of the proposal, in its stored form.

        A question that was asked several times, because it was too long, fails as often as it did.
        """
        recorded = tries(self.calls, question.proposal, question.step)
        if not recorded:
            raise CallError("missing", f"{self.source} holds no {question.step} for {question.proposal}", Reply())
        n_before = self._asked[question.proposal, question.step]
        self._asked[question.proposal, question.step] += 1
        call = recorded[min(n_before, len(recorded) - 1)]
        if call.prompt != question.prompt:
            if self.strict:
                raise ReplayError(
                    f"the {question.step} prompt for {question.proposal} differs from the recorded one in {self.source}"
                )
            if question.proposal not in self.differing:
                self.differing.append(question.proposal)
        return self._play(call)

    def _play(self, call: Call) -> Reply:
        if call.fault is not None:
            raise CallError(call.fault, call.error or call.fault, call, final=False)
        return call
