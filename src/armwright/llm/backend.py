"""What answers questions: a model (client.py), a recording of one (recording.py) or a person (manual.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from armwright.exceptions import ProposalError
from armwright.runs.control import Hint

# Turn an answer, as JSON or as text, into the text to record; UsageError refuses it.
Reader = Callable[[Mapping[str, Any]], str]
TextReader = Callable[[str], str]

MOST_REQUESTS = 3  # per question: an invalid answer goes back with the reason, at most twice
FINAL = frozenset({"key", "quota", "unknown_model", "budget"})  # faults that a repeated call does not cure


@dataclass(frozen=True)
class Question:
    """A question.

    Attributes:
        proposal: Id of the proposal it is for.
        step: Its part of the session, as in `Call`.
        known: Number of finished trials that the prompt was made from.
        most_requests: Limit of requests, those after invalid answers included; None for no limit.
        hints: Hints in the prompt.
    """

    proposal: str
    step: str
    prompt: str
    known: int = 0
    most_requests: int | None = None
    hints: tuple[Hint, ...] = ()


CHECK = Question("", "check", "Answer with one word: ready")


@dataclass(frozen=True)
class Reply:
    """An answer and its cost; `cost_usd` is None if the price is unknown."""

    text: str
    requests: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cost_usd: float | None = None
    seconds: float = 0.0


class CallError(ProposalError):
    """A call without a usable answer; `reply` holds its cost."""

    def __init__(self, kind: str, message: str, reply: Reply, final: bool | None = None) -> None:
        super().__init__(kind, message, final=kind in FINAL if final is None else final)
        self.reply = reply


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a call; `reply` holds its cost."""

    kind = "cancelled"

    def __init__(self, reply: Reply) -> None:
        super().__init__("ended by Ctrl-C")
        self.reply = reply


class LlmBackend(Protocol):
    """Answer questions; several threads may ask at a time.

    Attributes:
        model: Who answers, for the user.
        origin: What answers: `model`, `manual` (a person) or `scripted` (a stand-in).
    """

    model: str
    origin: str

    def begin(self) -> None:
        """Start a session; an earlier cancellation no longer counts."""
        ...

    def check(self, question: Question = CHECK) -> Reply:
        """Ask one tiny question before any work is done; raises CallError if there is no answer."""
        ...

    def ask(self, question: Question) -> Reply:
        """Return the free answer; raises CallError if there is none."""
        ...

    def ask_for(self, question: Question, schema: Mapping[str, Any], read: Reader) -> Reply:
        """Return an answer as JSON of `schema` that `read` accepts; its refusals are sent back to the model."""
        ...

    def cancel(self) -> None:
        """Cancel all calls at once; none starts before the next session."""
        ...
