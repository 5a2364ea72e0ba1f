"""The study: n_init random trials, then blocks of n_step trials whose first is the proposer's.

Every finished trial is on disk before the next one starts, and every trial depends on (seed, number) and the trials
before it only. A killed run therefore resumes where it stopped and ends as an uninterrupted one.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.checks.requirements import refuse_unread_parameters
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposer
from armwright.runs.config import run_config
from armwright.runs.folder import RunFolder
from armwright.search.samplers import SamplerFactory, sampler_for
from armwright.search.surrogate.cheap_features import FeatureFunction
from armwright.spaces.parameters import Design
from armwright.study.loop import Study
from armwright.study.progress import Progress, StudyResult
from armwright.study.settings import EvaluationOptions, check_proposer, check_settings, study_method
from armwright.study.workers.cluster import Workers


def optimize(
    problem: Problem,
    *,
    proposer: str | Proposer | None = "auto",
    sampler: str | SamplerFactory = "auto",
    features: FeatureFunction | None = None,
    n_init: int = 10,
    n_step: int = 10,
    n_total: int = 200,
    in_flight: int | None = None,
    initial_designs: Sequence[Design] = (),
    screen: bool = True,
    verify: bool = True,
    workers: Workers | None = None,
    evaluation_timeout: float | None = None,
    allow_failures: bool = False,
    seed: int = 0,
    out: str | Path | None = None,
    watch: Callable[[Progress], None] | None = None,
) -> StudyResult:
    """Optimise a problem: n_init random trials, then n_total counted ones in blocks of n_step.

    Args:
        problem: the problem.
        proposer: "rules", "none", "auto" (a configured model, else the rules), "llm", or a Proposer.
        sampler: "auto" (surrogate with an evaluator, else tpe), "surrogate", "tpe", "tpe-multivariate", "nsga2", "gp",
            "random", or a factory seed -> Optuna sampler.
        features: function of a design that gives the surrogate further numbers to learn from; None for none.
        n_init: random trials.
        n_step: trials of a block; its first is the proposer's.
        n_total: counted trials.
        in_flight: requests to the proposer that run while black-box trials go on; None: the study waits for each.
        initial_designs: designs of the first of the n_init trials, such as an existing arm.
        screen: whether the surrogate decides which proposals are evaluated; the sampler replaces the others.
        verify: whether the final front is verified (`proof/verification.py`); never with an evaluator.
        workers: processes that evaluate the designs; None: this process.
        evaluation_timeout: ends a call of the custom evaluator after so many seconds; the design is infeasible then.
        allow_failures: whether the run goes on if its first five evaluations all fail with the same exception.
        seed: of all random numbers.
        out: run folder, which keeps every trial; a second call resumes.
        watch: called with the progress.

    Raises:
        TaskError: it is proven that no design of the space can serve the task.
        ModelError: the model fails before the first trial. A run that has started continues without it.
        EvaluatorError: the first five evaluations all failed with the same exception.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-1"))
        >>> run = aw.optimize(problem, proposer="rules", n_init=5, n_total=20, seed=0)
        >>> len(run.trials), run.hypervolume.shape
        (25, (20,))
        >>> [trial.number for trial in run.trials if trial.source == "rules"]
        [5, 15]
        >>> errors = [member.values[0] for member in run.front]
        >>> errors == sorted(errors)
        True
    """
    proposer = check_proposer(proposer)
    sampler = sampler_for(problem, sampler, features)
    method = study_method(proposer, sampler, n_init, n_step, n_total, in_flight, initial_designs, screen)
    evaluation = EvaluationOptions(workers, evaluation_timeout, allow_failures)
    check_settings(problem, method, evaluation)
    refuse_unread_parameters(problem)
    stop_if_proven(check_instantly(problem))
    config = run_config(problem, method, seed)
    with nullcontext() if out is None else RunFolder(Path(out)) as folder:
        if folder is not None:
            config = folder.adopt(config)
        study = Study(problem, config, proposer, sampler, folder, watch, evaluation)
        return study.run(verify and problem.evaluator is None)
