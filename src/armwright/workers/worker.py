"""A worker: evaluates what a search posts, until that is over. As many as wanted, on any machine with the database."""

import time
from collections.abc import Callable
from pathlib import Path

from armwright.exceptions import ArmwrightError, SettingsError
from armwright.judging import judged
from armwright.measuring import Evaluator
from armwright.problem import Problem
from armwright.run_folder import read_config
from armwright.trials_file import read_begun
from armwright.workers.board import Board, Posted, shown_url

LOOK_EVERY = 0.1  # [s] between two looks for a trial, where none waits


def work(
    run: str | Path,
    evaluator: Evaluator | None = None,
    storage: str | None = None,
    say: Callable[[str], None] = print,
) -> int:
    """Evaluates designs of a run that `optimize` began with `workers`, until its search is over; how many it did.

    run: its folder, or a copy of it: config.yaml is all that is read there, and nothing is written.
    evaluator: that of the search. It is never loaded from the run folder, which may be a stranger's.
    storage: the database's URL; without it, as the run folder says, with the password from where libpq looks for it.
    """
    config = read_config(Path(run))
    if config.workers is None:
        raise SettingsError(f"{run} is evaluated by its search itself: it was not begun with --workers")
    name = None if evaluator is None else evaluator.name
    if name != config.evaluator:
        raise SettingsError(
            f"{run} is evaluated by {config.evaluator or 'armwright itself'}, not by {name or 'armwright itself'}"
            + (f"; give --evaluator FILE.py:{config.evaluator.rpartition(':')[2]}" if config.evaluator else "")
        )
    problem = config.problem_with(evaluator)
    record = config.workers
    url = storage or record.storage
    board = Board(url, record.study, record.heartbeat, [c.words for c in problem.constraints], say)
    board.open()
    say(f"evaluating designs of {run} from {shown_url(url)}")
    done = 0
    try:
        while True:
            posted = board.claim()
            if posted is not None:
                done += _evaluate(board, posted, problem, say)
            elif board.is_finished:
                return done
            else:
                time.sleep(LOOK_EVERY)
    finally:
        board.close()


def _evaluate(board: Board, posted: Posted, problem: Problem, say: Callable[[str], None]) -> bool:
    """Evaluates a trial and tells what came of it; whether its values were needed."""
    try:
        with board.living(posted):
            found = judged(problem, read_begun(posted.begun, problem.space))
    except ArmwrightError as failure:
        board.fail(posted, str(failure))
        say(f"trial {posted.number}: {failure}")
        return False
    except Exception as fault:
        board.fail(posted, f"{type(fault).__name__}: {fault}")  # so that no other worker meets it, too
        raise
    except BaseException:
        board.give_back(posted)  # stopped
        raise
    try:
        is_needed = board.tell(posted, found.judgement, found.seconds)
    except KeyboardInterrupt:
        board.tell(posted, found.judgement, found.seconds)  # what is evaluated is not evaluated again
        raise
    values = ", ".join(f"{value:.4g}" for value in found.judgement.values)
    late = "" if is_needed else "; too late, another worker had told its values"
    say(f"trial {posted.number}: {values} ({found.seconds:.1f} s){late}")
    return is_needed
