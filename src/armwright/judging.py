"""Where the designs of a study are judged: here, one at a time, or by workers."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from armwright.problem import Outcome, Problem
from armwright.trial import FinishedTrial


@dataclass(frozen=True)
class Judged:
    """A design's judgement, and the time that it took [s]."""

    judgement: Outcome
    seconds: float


class Judging(Protocol):
    """Judges trials that were begun.

    at_a_time: how many may be under way.
    """

    at_a_time: int = 1

    def begun(self, recorded: int) -> Sequence[FinishedTrial]:
        """Trials of earlier sessions that were begun and are not recorded, by number; they count as posted.

        recorded: how many are.
        """
        return ()

    def post(self, trial: FinishedTrial) -> None:
        """Has a trial judged."""
        ...

    def results(self) -> dict[int, Judged]:
        """What has been judged since, by the trials' numbers; waits a little where there is nothing."""
        ...

    def finish(self) -> None:
        """There is nothing more to judge."""

    def close(self) -> None:
        """The session is over."""


class Here(Judging):
    """In this process, at once."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._judged: dict[int, Judged] = {}

    def post(self, trial: FinishedTrial) -> None:
        """Judges it."""
        self._judged[trial.number] = judged(self._problem, trial)

    def results(self) -> dict[int, Judged]:
        """The trial that was posted."""
        found, self._judged = self._judged, {}
        return found


def judged(problem: Problem, trial: FinishedTrial) -> Judged:
    """A trial's judgement."""
    started = time.perf_counter()
    judgement = problem.evaluate([trial.design])[0]
    return Judged(judgement, time.perf_counter() - started)
