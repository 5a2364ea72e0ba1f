"""A finding about a task and a design space, with its evidence."""

from collections.abc import Sequence
from dataclasses import dataclass

from armwright.arrays import Array

PROVEN = "proven"  # holds for every design of the space
SUSPECTED = "suspected"  # possible, but hardly meant
MAX_LISTED = 8  # numbers of targets in a message


@dataclass(frozen=True)
class Finding:
    """A fault of a task or a design space."""

    message: str  # what is wrong and how to repair it, on one line
    evidence: str  # PROVEN, SUSPECTED, or the samples that support it, such as "none of 4,000 samples"

    @property
    def is_proven(self) -> bool:
        """True if no design of the space can serve the task as stated."""
        return self.evidence == PROVEN

    def __str__(self) -> str:
        """Return it with its evidence, on one line."""
        return f"{self.message} ({self.evidence})"


def describe_targets(names: Sequence[str], n_targets: int) -> str:
    """Return the targets of these names as the subject of a sentence."""
    if len(names) == 1:
        return f"target {names[0]}"
    if len(names) == n_targets:
        return f"all {n_targets} targets"
    shown = ", ".join(names[:MAX_LISTED]) + (", …" if len(names) > MAX_LISTED else "")
    return f"{len(names)} of {n_targets} targets ({shown})"


def describe_point(point: Array) -> str:
    """Return a point (3,) [m] in brackets with its unit."""
    return "(" + ", ".join(f"{value:g}" for value in point.tolist()) + ") m"
