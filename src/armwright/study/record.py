"""The finished trials of a study: on disk, as a history, and their front."""

from armwright.pareto import FrontTracker
from armwright.problem.evaluators import evaluator_error
from armwright.problem.problem import Problem
from armwright.runs.config import RunConfig
from armwright.runs.folder import RunFolder
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.study.workers.evaluation_backend import describe_design

N_FIRST = 5  # evaluations; if they all fail with the same exception, the evaluator is at fault, not the designs


class Record:
    """The finished trials of a study, and its configuration, in the run folder if there is one."""

    def __init__(self, problem: Problem, config: RunConfig, folder: RunFolder | None, allow_failures: bool) -> None:
        self.config = config
        self.trials = [] if folder is None else folder.open_trials(config)
        self.front = FrontTracker(len(problem.objectives), config.reference_point)
        self._folder = folder
        self._allow_failures = allow_failures
        self._problem = problem
        self._is_frozen = problem.reference_point is not None
        for trial in self.trials:
            self._track(trial)
        self._freeze_reference_point()

    def history(self) -> History:
        """Return the finished trials."""
        config = self.config
        return History(self._problem, tuple(self.trials), config.study.n_init, config.reference_point, config.study)

    def add(self, trial: FinishedTrial) -> None:
        """Write an evaluated trial, which is part of the run from now on.

        Raises:
            EvaluatorError: The first evaluations all failed with the same exception; their trials are discarded.
        """
        if not self._allow_failures:
            self._check_first(trial)
        if self._folder is not None:
            self._folder.append(trial)
        self.trials.append(trial)
        self._track(trial)
        self._freeze_reference_point()

    def _track(self, trial: FinishedTrial) -> None:
        if trial.is_feasible:
            self.front.add(trial.values)

    def _check_first(self, trial: FinishedTrial) -> None:
        failure = trial.failure
        if failure is None or trial.duplicate_of is not None:
            return
        first = [other.failure for other in self.trials if other.duplicate_of is None]
        if len(first) + 1 != min(N_FIRST, self.config.study.n_trials):
            return
        if not all(other is not None and other.is_same_exception(failure) for other in first):
            return
        if self._folder is not None:
            self._folder.replace_trials([])
        raise evaluator_error(
            f"the first {len(first) + 1} evaluations all failed: {failure.description}; last design: "
            f"{describe_design(trial.design)}. Fix the evaluator and rerun the same command, or go on with "
            "--allow-failures",
            failure,
        )

    def _freeze_reference_point(self) -> None:
        """Store a reference point that the task leaves open: after the random trials, until enough have succeeded."""
        if self._is_frozen or len(self.trials) < self.config.study.n_init:
            return
        history = self.history()
        self._is_frozen = history.has_reference_trials
        reference_point = history.found_reference_point()
        if reference_point is not None and reference_point != self.config.reference_point:
            self.config = self.config.model_copy(update={"reference_point": reference_point})
            self.front.set_reference_point(reference_point)
            if self._folder is not None:
                self._folder.write_config(self.config)
