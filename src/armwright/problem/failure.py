"""Why an evaluation failed: the evaluator raised, did not end in time, or returned numbers that are not finite."""

from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

from pydantic import Field, PlainSerializer

from armwright.files import replace_surrogates

FailureKind = Literal["exception", "timeout", "non_finite"]
FAILURE_KINDS: tuple[FailureKind, ...] = get_args(FailureKind)

_Text = Annotated[str, PlainSerializer(replace_surrogates)]


@dataclass(frozen=True)
class Failure:
    """A failed evaluation, which gives no objectives."""

    kind: FailureKind
    reason: _Text  # the exception or the values, on one line
    error: _Text = ""  # type of the exception, such as `ValueError`; empty without one
    place: _Text = ""  # where it was raised, such as `sim.py, line 12`; empty without an exception
    # Traceback of the evaluator's code. Run folders do not keep it
    traceback: Annotated[str, Field(exclude=True)] = field(default="", compare=False, repr=False)

    @property
    def description(self) -> str:
        """The reason and the place, on one line."""
        return f"{self.reason} ({self.place})" if self.place else self.reason

    def is_same_exception(self, other: "Failure") -> bool:
        """Return whether both are exceptions of one type, raised at one place."""
        mine, its = ((one.kind, one.error, one.place) for one in (self, other))
        return mine == its and self.kind == "exception"
