"""The search's side of the board: posts trials, and collects what workers make of them."""

import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from optuna.study import StudyDirection
from optuna.trial import TrialState

from armwright.exceptions import EvaluatorError, StorageError
from armwright.judging import Judged, Judging
from armwright.problem import Problem
from armwright.run_config import WorkersRecord
from armwright.sampling import distributions
from armwright.trial import FinishedTrial
from armwright.trials_file import begun_record, read_begun
from armwright.workers.board import SIGNS_MISSED, Board, Posted

MOST_DEATHS = 3  # of workers over one trial in a session
LOOK_EVERY = 0.05  # [s] between two looks at the board
SILENT_EVERY = 1.0  # [s] between two looks for workers that show no sign of life
LONELY = 10.0  # [s] after which the user is told that no worker is there


class ByWorkers(Judging):
    """By workers in other processes (`armwright worker`)."""

    def __init__(self, problem: Problem, url: str, record: WorkersRecord, say: Callable[[str], None]) -> None:
        self.at_a_time = record.at_a_time
        self._space = problem.space
        self._distributions = distributions(problem.space)
        self._say = say
        self._deaths: Counter[int] = Counter()
        self._waited_for: dict[int, Any] = {}  # by number, as they were begun
        self._looked = self._heard = time.monotonic()
        self._told_lonely = False
        self._board = Board(url, record.study, record.heartbeat, [c.words for c in problem.constraints], say)
        names = [objective.name for objective in problem.objectives]
        self._board.create([StudyDirection.MINIMIZE] * len(names), names)

    def begun(self, recorded: int) -> Sequence[FinishedTrial]:
        """What lies on the board beyond the trials that are recorded; what had failed there is posted again."""
        there = {number: posted for number, posted in self._board.posted().items() if number >= recorded}
        trials = [read_begun(there[number].begun, self._space) for number in sorted(there)]
        for number, posted in there.items():
            if posted.state == TrialState.FAIL:
                self._board.post_again(posted)
            self._waited_for[number] = posted.begun
        return trials

    def post(self, trial: FinishedTrial) -> None:
        """Posts it."""
        params = self._space.free_values(trial.design)
        record = json.loads(json.dumps(begun_record(trial)))  # as the database gives it back
        self._board.post(record, params, {name: self._distributions[name] for name in params})
        self._waited_for[trial.number] = record

    def results(self) -> dict[int, Judged]:
        """Those that have come; EvaluatorError where an evaluator failed, or workers die over a trial."""
        now = time.monotonic()
        if now - self._looked >= SILENT_EVERY:
            self._board.fail_silent()
            self._looked = now
        there = self._board.posted(self._waited_for)
        for number, trial in there.items():
            if trial.begun != self._waited_for[number]:
                raise StorageError(
                    f"trial {number} of the database's study is another design than this search's: another search "
                    "uses the study, too. Copies of a run folder need one of their own: begin anew with another --out"
                )
            if trial.state == TrialState.FAIL:
                self._again(trial)
        found = {n: Judged(trial.judgement, trial.seconds) for n, trial in there.items() if trial.judgement is not None}
        for number in found:
            del self._waited_for[number]
        self._listen(bool(found) or any(trial.state == TrialState.RUNNING for trial in there.values()))
        if not found:
            time.sleep(LOOK_EVERY)
        return found

    def finish(self) -> None:
        """Lets the workers end."""
        self._board.finish()

    def close(self) -> None:
        """Ends the connection; workers go on with what is posted."""
        self._board.close()

    def _again(self, trial: Posted) -> None:
        """A failed trial is posted again, where it is not its evaluator that failed."""
        if trial.error:
            raise EvaluatorError(f"trial {trial.number}: {trial.error}. Mend it; the same command goes on")
        if not trial.is_given_back:
            self._deaths[trial.number] += 1
            if self._deaths[trial.number] >= MOST_DEATHS:
                params = dict(read_begun(trial.begun, self._space).design.params)
                raise EvaluatorError(
                    f"{MOST_DEATHS} workers died over trial {trial.number}, or could not be heard for {SIGNS_MISSED} "
                    f"heartbeats; its design is {params}. The same command goes on with it"
                )
            self._say(f"the worker of trial {trial.number} is not heard any more; another one evaluates it")
        self._board.post_again(trial)

    def _listen(self, is_heard: bool) -> None:
        """Tells the user where nobody evaluates anything."""
        now = time.monotonic()
        if is_heard:
            self._heard, self._told_lonely = now, False
        elif now - self._heard >= LONELY and not self._told_lonely and self._waited_for:
            self._told_lonely = True
            self._say(f"{len(self._waited_for)} designs wait for a worker, and none is there")
