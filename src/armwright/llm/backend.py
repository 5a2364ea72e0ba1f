"""Whom a proposer asks: a model (chat.py), a recording (recording.py) or people (people.py)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from armwright.exceptions import ProposalError
from armwright.runs.control import Hint

# Turns an answer's JSON into the text that is kept of it; UsageError, in its own words, refuses it.
Reader = Callable[[Mapping[str, Any]], str]
TextReader = Callable[[str], str]  # the same for an answer in free text

MOST_REQUESTS = 3  # of a question: a refused answer goes back with the reason, at most twice
FINAL = frozenset({"key", "quota", "unknown_model", "budget"})  # faults that asking again does not mend


@dataclass(frozen=True)
class Question:
    """What is asked.

    proposal: the id of the proposal it is for.  step: its part of the dialogue.
    known: how many finished trials it was made from.
    most_requests: how often the server may be asked, answers that are refused included; None for no bound.
    hints: that stand in the prompt.
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
    """What came back, and what it took. text: the answer; cost_usd: None where the price is not known."""

    text: str
    requests: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cost_usd: float | None = None
    seconds: float = 0.0


class CallError(ProposalError):
    """A call that gave no usable answer; `reply` says what it cost all the same."""

    def __init__(self, kind: str, message: str, reply: Reply, final: bool | None = None) -> None:
        super().__init__(kind, message, final=kind in FINAL if final is None else final)
        self.reply = reply


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while an answer was waited for; `reply` says what the call cost all the same."""

    kind = "cancelled"

    def __init__(self, reply: Reply) -> None:
        super().__init__("ended by Ctrl-C")
        self.reply = reply


class LlmBackend(Protocol):
    """Answers questions, several at a time if asked from several threads.

    model: who answers, in words.  origin: what answers: `model`, `manual` (people), `scripted` (a stand-in).
    """

    model: str
    origin: str

    def begin(self) -> None:
        """Start a session; an earlier cancellation no longer counts."""
        ...

    def check(self, question: Question = CHECK) -> Reply:
        """One tiny question, before any work is done; CallError where no answers are to be had."""
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
