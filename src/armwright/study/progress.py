"""What a study reports while it runs, and its result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from armwright.arrays import Array
from armwright.runs.config import RunConfig
from armwright.runs.history import FrontMember, History
from armwright.runs.trial import FinishedTrial

Activity = Literal["beginning", "proposing", "finished"]


@dataclass(frozen=True)
class Progress:
    """Progress of a study: it begins, requests a proposal, or has finished a trial."""

    doing: Activity
    number: int
    iteration: int  # counted trials finished; 0 during the random ones
    n_total: int  # counted trials of the run
    hypervolume: float | None  # hypervolume of the front, if there is a reference point
    front_size: int  # designs on the front
    source: str  # source of the trial
    n_in_flight: int = 0  # requests to the proposer that run while trials go on
    fault: str | None = None  # kind of the fault of this trial
    faults: Mapping[str, int] = field(default_factory=dict[str, int])  # faults of all trials so far, by kind
    failures: Mapping[str, int] = field(default_factory=dict[str, int])  # failed evaluations so far, by kind
    latest_failures: Mapping[str, str] = field(default_factory=dict[str, str])  # trial and reason of the last, by kind
    note: str = ""  # message for the user, reported once
    reason: str = ""  # reason of the proposer for this trial's design


@dataclass(frozen=True)
class RunResult:
    """Result of a run."""

    history: History  # all trials
    config: RunConfig  # settings of the run
    summary: dict[str, Any]  # content of summary.json
    folder: Path | None  # the run folder, if there is one
    resumed: int  # number of trials of earlier sessions

    @property
    def front(self) -> list[FrontMember]:
        """Pareto set, sorted by the first objective."""
        return self.history.front


class StudyResult(RunResult):
    """Result of a study."""

    @property
    def hypervolume(self) -> Array:
        """(n_total,) hypervolume after each counted trial."""
        return self.history.hypervolume

    @property
    def trials(self) -> Sequence[FinishedTrial]:
        """All trials by number."""
        return self.history.trials
