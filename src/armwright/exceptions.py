"""Every error that armwright raises on purpose.

    ArmwrightError
    ├── UsageError              a request that cannot be fulfilled          (exit code 2)
    │   ├── TaskError           a task's name, file or targets
    │   ├── SpaceError          a design space's file or ranges
    │   ├── DesignError         parameter values that are not in their design space
    │   ├── ArmError            a chain that cannot exist, or that the kernels cannot compute yet
    │   ├── SettingsError       the settings of a run
    │   │   └── UnknownQuantityError  a quantity that task and arms leave open
    │   ├── RunConflictError    the run folder holds a run with other settings
    │   └── MissingExtraError   an optional dependency that is not installed
    └── FailureError            something failed during the work            (exit code 1)
        ├── RunFolderError      a run folder that cannot be written, or whose content is damaged
        ├── ModelError          a language model that cannot be used
        ├── ReplayError         a recorded run that cannot be replayed exactly
        ├── ProposalError       a proposer gave no design; the trial becomes a black-box one
        ├── EvaluatorError      a custom evaluator failed, or the workers that ran it were lost
        └── ClusterError        a Dask cluster does not answer, was lost, or has other versions

A message is one line. It names the value with its unit, what is allowed, and the way out. Text quoted from files and
answers is escaped, so that it cannot break the line or control a terminal.
"""

from collections.abc import Iterable
from difflib import get_close_matches

MAX_MESSAGE = 3000  # characters


class ArmwrightError(Exception):
    """The base of all errors that armwright raises on purpose."""

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        super().__init__(_line(message))


class UsageError(ArmwrightError):
    """A request that cannot be fulfilled."""

    exit_code = 2


class TaskError(UsageError):
    """A task's name, file or targets."""


class SpaceError(UsageError):
    """A design space's file or ranges."""


class DesignError(UsageError):
    """Parameter values that are not in their design space."""


class ArmError(UsageError):
    """A chain that cannot exist, or that the kernels cannot compute yet."""


class SettingsError(UsageError):
    """The settings of a run."""


class UnknownQuantityError(SettingsError):
    """A quantity that task and arms leave open."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason  # why, without a way out: for tables and sheets


class RunConflictError(UsageError):
    """The run folder holds a run with other settings."""


class MissingExtraError(UsageError):
    """An optional dependency that is not installed."""


class FailureError(ArmwrightError):
    """Something failed during the work."""


class RunFolderError(FailureError):
    """A run folder that cannot be written, or whose content is damaged."""


class ModelError(FailureError):
    """A language model that cannot be used.

    `final` is the kind of fault if a retry in this session is useless (a wrong key, a spent quota); else None.
    """

    def __init__(self, message: str, *, final: str | None = None) -> None:
        super().__init__(message)
        self.final = final


class ReplayError(FailureError):
    """A recorded run that cannot be replayed exactly."""


class ProposalError(FailureError):
    """A proposer gave no design; the trial becomes a black-box one.

    Attributes:
        kind: One word for statistics: timeout, connection, refused, …
        final: True if a retry in this session is useless (a wrong key, a spent quota).
        known: Number of finished trials that the proposal was based on, if fewer than now.
    """

    known: int | None = None

    def __init__(self, kind: str, message: str, *, final: bool = False) -> None:
        super().__init__(message)
        self.kind = kind
        self.final = final


class EvaluatorError(FailureError):
    """A custom evaluator failed, or the workers that ran it were lost.

    If its code raised, the traceback is a note of the exception (`__notes__`).
    """


class ClusterError(FailureError):
    """A Dask cluster does not answer, was lost, or has other versions than this process."""


def _line(text: str) -> str:
    """Return a text on one line, with invisible characters escaped and the middle of a long text left out."""
    return _cut("".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in _cut(text)))


def _cut(text: str) -> str:
    if len(text) <= MAX_MESSAGE:
        return text
    return f"{text[: MAX_MESSAGE // 2]} […] {text[-MAX_MESSAGE // 3 :]}"


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return ' Did you mean "x"?' for the closest allowed name, or '' if none is close."""
    near = get_close_matches(name, list(allowed), n=1, cutoff=0.6)
    return f' Did you mean "{near[0]}"?' if near else ""
