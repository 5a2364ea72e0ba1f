"""The language model as a proposer: it thinks freely, then its answer is turned into parameters."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from armwright.exceptions import DesignError, ModelError, ProposalError, SettingsError, did_you_mean
from armwright.history import History
from armwright.llm.prompt import PROMPTS, answer_schema, design_of, parameters_prompt, proposal_prompt
from armwright.llm.transcript import Call, Transcript
from armwright.proposers.proposer import Proposal, Proposer, ProposerSummary
from armwright.space import Design, DesignSpace

TRANSCRIPTS = "transcripts.jsonl"


class LlmProposer(Proposer):
    """Asks a language model for each proposal, in two calls, and keeps what was said.

    model: vendor and name, `openai-chat:gpt-4o`.
    base_url: the address of an OpenAI-compatible server, where it is not the vendor's own.
    prompt: "plus" (with instructions on how to analyse the parameters) or "minus".
    """

    name = "llm"

    def __init__(self, model: str, base_url: str | None = None, prompt: str = "plus") -> None:
        from armwright.llm.chat import Chat

        if prompt not in PROMPTS:
            raise SettingsError(
                f'unknown prompt "{prompt}".{did_you_mean(prompt, PROMPTS)} Prompts: {", ".join(PROMPTS)}'
            )
        self.model = model
        self.base_url = base_url
        self.prompt = prompt
        self._chat = Chat(model, base_url)
        self._transcript = Transcript(None)

    def settings(self) -> Mapping[str, Any]:
        """Model, server and prompt."""
        return {"model": self.model, "base_url": self.base_url, "prompt": self.prompt}

    def open(self, folder: Path | None) -> None:
        """Reads what was said before in this run."""
        self._transcript = Transcript(None if folder is None else folder / TRANSCRIPTS)

    def check(self) -> None:
        """Makes sure that the model answers."""
        try:
            self._call("", "check", "", self._chat.check)
        except ProposalError as fault:
            raise ModelError(
                f"{fault}. Check the model, its key and --base-url; --proposer rules needs none"
            ) from fault

    def summary(self) -> ProposerSummary:
        """Calls, tokens and cost of the whole run, earlier sessions included."""
        calls = self._transcript.calls
        costs = [call.cost_usd for call in calls if call.requests]
        known = costs and None not in costs
        return ProposerSummary(
            name=self.name,
            model=self.model,
            calls=len(calls),
            tokens=sum(call.input_tokens + call.output_tokens for call in calls),
            cost_usd=sum(cost or 0.0 for cost in costs) if known else None,
        )

    def propose(self, history: History, seed: int) -> Proposal:
        """The model's next design. An answer that was paid for in a run that was killed is used, not asked again."""
        identity = f"{self.name}-{len(history):04d}"
        space = history.problem.space
        prompt = proposal_prompt(history, self.prompt, seed)
        thoughts = self._transcript.answer(identity, "reasoning")
        if thoughts is None:
            thoughts = self._call(identity, "reasoning", prompt, lambda: self._chat.ask(prompt))
        design, reason = self._parameters(identity, space, thoughts)
        return Proposal(design, identity, reason)

    def _parameters(self, identity: str, space: DesignSpace, thoughts: str) -> tuple[Design, str]:
        schema = answer_schema(space)
        said = self._transcript.answer(identity, "parameters")
        if said is not None:
            with suppress(ValidationError, DesignError):  # a transcript that was changed by hand: ask again
                return design_of(schema.model_validate_json(said), space)
        question = parameters_prompt(space, thoughts)
        said = self._call(
            identity,
            "parameters",
            question,
            lambda: self._chat.ask_for(question, schema, lambda answer: design_of(answer, space)),
        )
        return design_of(schema.model_validate_json(said), space)

    def _call(self, proposal: str, step: str, prompt: str, ask: Callable[[], Any]) -> str:
        from armwright.llm.chat import CallError

        error = None
        try:
            reply = ask()
        except CallError as fault:
            error, reply = fault, fault.reply
        self._transcript.add(
            Call(
                proposal=proposal,
                step=step,
                model=self.model,
                prompt=prompt,
                answer=reply.text,
                requests=reply.requests,
                input_tokens=reply.input_tokens,
                output_tokens=reply.output_tokens,
                cost_usd=reply.cost_usd,
                seconds=round(reply.seconds, 3),
                error=None if error is None else f"{error.kind}: {error}",
            )
        )
        if error is not None:
            raise error
        return reply.text
