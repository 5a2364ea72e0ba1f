"""The failed evaluations of a run, and whether the evaluator itself is at fault."""

from collections import Counter
from collections.abc import Iterable

from armwright.problem.failure import Failure
from armwright.runs.trial import FinishedTrial

N_FIRST = 5  # evaluations; if they all fail with the same exception, the evaluator is at fault, not the designs


class FailureWatch:
    """Counts failed evaluations by kind, and compares the first ones of the run.

    Args:
        trials: the trials of earlier sessions.
        n_trials: number of trials of the whole run.

    Attributes:
        counts: number of failed trials by kind.
        latest: trial and reason of the last failure of each kind.
    """

    def __init__(self, trials: Iterable[FinishedTrial], n_trials: int) -> None:
        self.counts: Counter[str] = Counter()
        self.latest: dict[str, str] = {}
        self._n_first = min(N_FIRST, n_trials)
        self._first: list[Failure | None] = []
        for trial in trials:
            self.add(trial)

    def add(self, trial: FinishedTrial) -> bool:
        """Add the next trial; return whether it completes the first evaluations, which all failed in the same way."""
        failure = trial.failure
        if failure is not None:
            self.counts[failure.kind] += 1
            self.latest[failure.kind] = f"trial {trial.number}: {failure.description}"
        if trial.duplicate_of is not None or len(self._first) == self._n_first:
            return False
        self._first.append(failure)
        return (
            len(self._first) == self._n_first
            and failure is not None
            and all(other is not None and other.is_same_exception(failure) for other in self._first)
        )
