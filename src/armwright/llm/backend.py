"""Questions, answers, and what answers them: a model (client.py) or a person (proposers/manual.py)."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import Field

from armwright.exceptions import ProposalError

MAX_REQUESTS = 3  # per question: an invalid answer goes back with the reason, at most twice
FINAL = frozenset({"key", "quota", "unknown_model", "budget"})  # faults that a repeated call does not cure

Count = Annotated[int, Field(ge=0, lt=2**53)]
Amount = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


@dataclass(frozen=True)
class Question:
    """A question."""

    proposal: Annotated[str, Field(pattern=r"^(.*-\d{1,9})?$")]  # its id: source and trial's number; empty for a check
    # `check` (is the model available), `reasoning` (the free answer), `parameters` (that answer as values), `answer`
    # (both at once) or `draft` (a task and a space)
    step: str
    prompt: str
    known: Count = 0  # number of finished trials that the prompt was made from

    @property
    def trial(self) -> int:
        """Number of the trial that the proposal is for."""
        return int(self.proposal.rpartition("-")[2])


@dataclass(frozen=True)
class Turn:
    """An earlier question of a conversation and its answer."""

    question: str
    answer: str


@dataclass(frozen=True)
class Reply:
    """An answer and its cost."""

    answer: str = ""
    requests: Count = 0  # requests that the server answered; above 1 if an answer was invalid
    input_tokens: Count = 0
    output_tokens: Count = 0
    cost_usd: Amount | None = None  # None if the price is unknown
    seconds: Amount = 0.0
    output_mode: str = ""  # how the answer was held to its schema: `tool`, `native` or `prompted`; empty for free text

    def plus(self, other: "Reply") -> "Reply":
        """Return another reply with the cost of both."""
        costs = [reply.cost_usd for reply in (self, other) if reply.requests]
        return replace(
            other,
            requests=self.requests + other.requests,
            input_tokens=self.input_tokens + other.input_tokens,
            output_tokens=self.output_tokens + other.output_tokens,
            cost_usd=sum(cost for cost in costs if cost is not None) if costs and None not in costs else None,
            seconds=round(self.seconds + other.seconds, 3),
        )


@dataclass(frozen=True)
class OutputFormat:
    """The form of an answer that is not free text."""

    schema: Mapping[str, Any]  # JSON schema
    read: Callable[[Mapping[str, Any] | str], str]  # turns an answer into the text to record; UsageError refuses it


@dataclass(frozen=True)
class AskOptions:
    """How a question is asked."""

    output: OutputFormat | None = None  # None for free text
    most_requests: int | None = None  # those after invalid answers included; None for no limit
    earlier: Sequence[Turn] | None = None  # of the conversation that it continues; None for a question on its own


FREE_TEXT = AskOptions()

# A tiny question, so that a wrong name, key or address is reported before any work is done. Its structured answer shows
# the output modes that the server supports.
CHECK = Question("", "check", "Answer with one word: ready")
_WORD = {"answer": {"type": "string"}}
_READY = {"type": "object", "properties": _WORD, "required": ["answer"], "additionalProperties": False}
CHECK_FORMAT = OutputFormat(_READY, json.dumps)


class CallError(ProposalError):
    """A call without a usable answer; `reply` holds its cost."""

    def __init__(self, kind: str, message: str, reply: Reply) -> None:
        super().__init__(kind, message, final=kind in FINAL)
        self.reply = reply


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a call; `reply` holds its cost."""

    kind = "cancelled"

    def __init__(self, reply: Reply) -> None:
        super().__init__("ended by Ctrl-C")
        self.reply = reply


class LlmBackend:
    """Answers questions; several threads may ask at a time. This base class is only a name for those of a record."""

    note: str = ""  # message for the user about the output mode; empty for none

    def __init__(self, model: str = "none", origin: str = "model") -> None:
        self.model = model  # who answers, for the user
        self.origin = origin  # what answers: `model`, `manual` (a person) or `scripted` (a stand-in)

    def begin(self) -> None:
        """Start a session; an earlier cancellation no longer counts."""

    def ask(self, question: Question, options: AskOptions = FREE_TEXT) -> Reply:
        """Return the answer, free text by default; raises CallError if there is none.

        Refusals of the answer by the output format go back to the model.
        """
        raise NotImplementedError

    def cancel(self) -> None:
        """Cancel all calls at once; none starts before the next session."""
