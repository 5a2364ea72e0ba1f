"""What a study reports while it runs, and its result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from armwright.arrays import Array
from armwright.runs.config import RunConfig
from armwright.runs.history import FrontMember, History
from armwright.runs.trial import FinishedTrial

Activity = Literal["beginning", "proposing", "paused", "finished"]


@dataclass(frozen=True)
class Progress:
    """Progress of a study: it begins, requests a proposal, is paused, or has finished a trial.

    Attributes:
        doing: the activity.
        number: number of the trial.
        iteration: counted trials finished; 0 during the random ones.
        n_total: counted trials of the run.
        hypervolume: hypervolume of the front, if there is a reference point.
        front_size: designs on the front.
        source: source of the trial.
        n_in_flight: requests to the proposer that run while trials go on.
        fault: kind of the fault of this trial.
        faults: faults of all trials so far, by kind.
        failures: failed evaluations so far, by kind.
        latest_failures: trial and reason of the last failed evaluation of each kind.
        note: message for the user, reported once.
        reason: reason of the proposer for this trial's design.
    """

    doing: Activity
    number: int
    iteration: int
    n_total: int
    hypervolume: float | None
    front_size: int
    source: str
    n_in_flight: int = 0
    fault: str | None = None
    faults: Mapping[str, int] = field(default_factory=dict[str, int])
    failures: Mapping[str, int] = field(default_factory=dict[str, int])
    latest_failures: Mapping[str, str] = field(default_factory=dict[str, str])
    note: str = ""
    reason: str = ""


@dataclass(frozen=True)
class RunResult:
    """Result of a run.

    Attributes:
        history: all trials.
        config: settings of the run.
        summary: content of summary.json.
        folder: the run folder, if there is one.
        resumed: number of trials of earlier sessions.
    """

    history: History
    config: RunConfig
    summary: dict[str, Any]
    folder: Path | None
    resumed: int

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
