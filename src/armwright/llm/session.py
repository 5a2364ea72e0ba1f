"""A session with one backend: each question is recorded with its answer, and none exceeds the budget."""

import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from armwright.exceptions import ModelError, ProposalError
from armwright.llm.backend import (
    CHECK,
    CHECK_FORMAT,
    MAX_REQUESTS,
    AskOptions,
    CallError,
    Interrupted,
    LlmBackend,
    OutputFormat,
    Question,
    Reply,
    Turn,
)
from armwright.llm.budget import CallBudget
from armwright.llm.conversation import conversation, new_part
from armwright.llm.model_options import ModelOptions, PromptOptions
from armwright.llm.transcript import FIRST_STEPS, Call, Transcript, n_requests, total_cost
from armwright.proof.summary_file import ProposerSummary


class LlmSession:
    """Ask one backend, within a budget, and record every call; several threads may ask at a time.

    Its trials have the source `name`. With memory `chat`, the proposals are one conversation, in which each question is
    sent with the turns before it. The limits of ModelOptions hold for the whole transcript.
    """

    def __init__(self, backend: LlmBackend, name: str, options: PromptOptions) -> None:
        self.name = name
        self.backend = backend
        self.options = options
        self.chat = options.memory == "chat"
        limits = options if isinstance(options, ModelOptions) else ModelOptions()
        self._budget = CallBudget(limits.max_calls, limits.max_cost)
        self._transcript = Transcript(None)
        self._over = threading.Event()  # set when no more answers are wanted in this session

    def identity(self, number: int) -> str:
        """Return the id of the question for trial `number` and of its proposal."""
        return f"{self.name}-{number:04d}"

    def summary(self) -> ProposerSummary:
        """Return calls, tokens and cost of the whole run, earlier sessions included."""
        calls = self._calls()
        modes = [call.output_mode for call in calls if call.output_mode]
        return ProposerSummary(
            name=self.name,
            model=self.backend.model,
            origin=self.backend.origin,
            calls=n_requests(calls),
            call_failures=dict(Counter(call.fault for call in calls if call.fault)),
            input_tokens=sum(call.input_tokens for call in calls),
            output_tokens=sum(call.output_tokens for call in calls),
            cost_usd=total_cost(calls) if any(call.requests for call in calls) else None,
            call_seconds=round(sum(call.seconds for call in calls), 3),
            notes={"output_mode": modes[0]} if modes else {},
        )

    def cancel(self) -> None:
        """Cancel all calls and start no more in this session."""
        self._over.set()
        self.backend.cancel()

    def check(self) -> str:
        """Ask a test question, and return a message for the user or an empty text.

        An exhausted budget is reported at the first real question instead.

        Raises:
            ModelError: There is no answer, or its price is unknown under a cost limit.
        """
        try:
            self._call(CHECK, CHECK_FORMAT, self._over)
        except ProposalError as fault:
            if fault.kind == "budget":
                return ""
            advice = "Check the model, its key and base_url; --proposer rules needs none"
            raise ModelError(f"{fault}. {advice}", final=fault.kind if fault.final else None) from fault
        if self._budget.max_cost is not None and total_cost(self._calls()) is None:
            reason = f"the price of {self.backend.model} is unknown, so max_cost cannot hold; use max_calls"
            raise ModelError(reason, final="budget")
        return self.backend.note

    def _begin(self, transcript: Path | None) -> None:
        """Start a session; `transcript` holds the earlier ones."""
        self._transcript = Transcript(transcript)
        self._over = threading.Event()
        self.backend.begin()

    def _calls(self) -> Sequence[Call]:
        """Return the calls that the budget and the summary count."""
        return self._transcript.calls

    def _question(self, number: int, prompt: str, known: int) -> Question:
        """Return the question for trial `number`, to be followed by a second one if the answer is in two steps."""
        step = "reasoning" if self.options.answer == "two-step" else "answer"
        return Question(self.identity(number), step, prompt, known)

    def _ask(self, question: Question, output: OutputFormat, extraction: Callable[[str], str] = str) -> str:
        """Return the answer in the format `output`.

        If the question's step is "reasoning", `extraction` makes the second question from its free answer.
        """
        over = self._over  # of this session, even if another one begins meanwhile
        if question.step == "reasoning":
            thoughts = self._call(question, None, over)
            question = replace(question, step="parameters", prompt=extraction(thoughts))
        return self._call(question, output, over)

    def _earlier(self, question: Question) -> Sequence[Turn] | None:
        """Return the turns that go with a question; None for the check and for second questions, which stand alone."""
        is_turn = self.chat and question.step in FIRST_STEPS
        return conversation(self._transcript.calls, question.trial) if is_turn else None

    def _part_to_ask(self, prompt: str, trial: int) -> str:
        """Return what a question for a trial says of a prompt: in a chat, what the turns before it do not."""
        return new_part(prompt, conversation(self._transcript.calls, trial)) if self.chat else prompt

    def _call(self, question: Question, output: OutputFormat | None, over: threading.Event) -> str:
        """Return the answer; answer and cost are recorded even if Ctrl-C interrupts the call.

        A question that is too long is repeated without the oldest turns. `over` is set once no answer is wanted any
        more.
        """
        with self._budget.reserved(self._calls, over) as left:
            while True:
                earlier = self._earlier(question)
                try:
                    reply = self.backend.ask(question, AskOptions(output, left, earlier))
                except (CallError, Interrupted) as fault:
                    if fault.kind != "cancelled" or fault.reply.requests:
                        self._keep(question, fault.reply, fault)
                    left = (MAX_REQUESTS if left is None else left) - max(1, fault.reply.requests)
                    if left < 1 or fault.kind != "context" or self._earlier(question) == earlier:
                        raise
                else:
                    self._keep(question, reply)
                    return reply.answer

    def _keep(self, question: Question, reply: Reply, error: CallError | Interrupted | None = None) -> None:
        fault, message = (None, None) if error is None else (error.kind, str(error))
        origin, model = self.backend.origin, self.backend.model
        self._transcript.add(
            Call(**vars(question), **vars(reply), origin=origin, model=model, fault=fault, error=message)
        )
