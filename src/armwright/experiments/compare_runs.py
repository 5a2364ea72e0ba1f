"""Compare finished runs by method, task and seed: means, intervals and paired tests."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.experiments.run_record import RunSummary, read_finished_runs
from armwright.experiments.statistics import Interval, PairedTest, can_reject, holm, interval, paired_test
from armwright.proof.front_gap import known_front


@dataclass(frozen=True)
class MethodResult:
    """Results of a method on a task."""

    task: str
    method: str
    seeds: tuple[int, ...]  # of the runs that count
    e_hv: Interval | None  # as in the paper's table; None for a front search
    sigma_hv: float | None  # likewise; None also for a single run
    final: Interval
    share_of_best_known: Interval | None  # None if no front is known


@dataclass(frozen=True)
class Contrast:
    """E_hv of a method against another one, its baseline: on a task, or over all tasks that both ran."""

    task: str  # empty for all tasks
    method: str
    baseline: str
    test: PairedTest  # paired by seed; over all tasks, of the logarithms by task (Demsar, JMLR 7:1, 2006)
    p_holm: float | None  # corrected for the number of contrasts; None with too few pairs for a test
    ratio: Interval | None = None  # over all tasks: mean E_hv divided by the baseline's


class Comparison:
    """Runs of several methods on the same tasks.

    methods, tasks: in display order. baseline: the method that others are compared with, unless `against` names the
        methods that they are compared with.
    excluded: flagged runs, which do not count.
    widened: tasks whose runs had different reference points; their componentwise maximum is used for all.
    published: E_hv and σ_hv of a publication by method and task, shown next to these. published_in: the publication.
    """

    def __init__(
        self,
        runs: Iterable[RunSummary],
        methods: Sequence[str],
        tasks: Sequence[str],
        baseline: str,
        against: Mapping[str, Sequence[str]] | None = None,
        published: Mapping[tuple[str, str], tuple[float, float]] | None = None,
        published_in: str = "",
    ) -> None:
        runs = list(runs)
        points: dict[str, tuple[float, ...]] = {}
        self.widened: list[str] = []
        for task in dict.fromkeys(run.task for run in runs):
            of_task = [run for run in runs if run.task == task]
            _check_same_problem(task, of_task)
            points[task] = tuple(np.max([run.reference_point for run in of_task], axis=0).tolist())
            if any(run.reference_point != points[task] for run in of_task):
                self.widened.append(task)
        runs = [replace(run, reference_point=points[run.task]) for run in runs]
        self.excluded = [run for run in runs if run.is_flagged]
        self.runs = [run for run in runs if not run.is_flagged]
        self.methods = [method for method in methods if any(run.method == method for run in self.runs)]
        self.tasks = [task for task in tasks if any(run.task == task for run in self.runs)]
        self.baseline = baseline if baseline in self.methods or not self.methods else self.methods[0]
        self.against = against or {}
        self.published = published or {}
        self.published_in = published_in

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Each method with each other one that it is compared with."""
        return [
            (method, other)
            for method in self.methods
            for other in self.against.get(method, (self.baseline,))
            if other != method
        ]

    def runs_of(self, method: str, task: str) -> list[RunSummary]:
        """Return the runs of a method on a task, by seed."""
        return sorted((run for run in self.runs if (run.method, run.task) == (method, task)), key=lambda run: run.seed)

    def label(self, method: str) -> str:
        """Return a method's name, marked if a scripted stand-in answered instead of a model."""
        return f"{method} [scripted]" if any(run.is_scripted for run in self.runs if run.method == method) else method

    def curves(self, method: str, task: str) -> Array:
        """Return the hypervolumes of a method's runs over the counted trials (S, I); (0, 0) without runs."""
        curves = [run.curve for run in self.runs_of(method, task) if len(run.curve)]
        return np.array(curves) if curves else np.zeros((0, 0))

    def reference_point(self, task: str) -> tuple[float, ...]:
        """Return the common reference point of all runs on a task."""
        return self.first_run(task).reference_point

    def best_known(self, task: str) -> float | None:
        """Return the best known hypervolume of a task within the common reference point; None if unknown."""
        known = known_front(self.first_run(task).config.problem)
        return None if known is None else known.hypervolume(self.reference_point(task))

    def first_run(self, task: str) -> RunSummary:
        """Return one of the runs on a task, for what they have in common."""
        return next(run for run in self.runs if run.task == task)

    @cached_property
    def rows(self) -> list[MethodResult]:
        """Results by task and method."""
        return [
            self._result(method, task) for task in self.tasks for method in self.methods if self.runs_of(method, task)
        ]

    @cached_property
    def contrasts(self) -> list[Contrast]:
        """The pairs of methods on each task with common seeds."""
        tests: list[Contrast] = []
        for task in self.tasks:
            for method, other in self.pairs:
                e_hv, baseline = self._e_hv_by_seed(method, task), self._e_hv_by_seed(other, task)
                seeds = sorted(e_hv.keys() & baseline.keys())
                if seeds:
                    test = paired_test([e_hv[seed] for seed in seeds], [baseline[seed] for seed in seeds])
                    tests.append(Contrast(task, method, other, test, None))
        return _corrected(tests)

    @cached_property
    def overall(self) -> list[Contrast]:
        """The pairs of methods over the tasks; empty with too few tasks for a test."""
        e_hv = {(row.method, row.task): row.e_hv.mean for row in self.rows if row.e_hv is not None}
        tests: list[Contrast] = []
        for method, other in self.pairs:
            pairs = [
                (e_hv[method, task], e_hv[other, task])
                for task in self.tasks
                if {(method, task), (other, task)} <= e_hv.keys()
            ]
            own, baseline = np.array([pair for pair in pairs if min(pair) > 0.0]).reshape(-1, 2).T
            if can_reject(len(own)):
                test = paired_test(np.log(own), np.log(baseline))
                tests.append(Contrast("", method, other, test, None, interval(own / baseline)))
        return _corrected(tests)

    def _e_hv_by_seed(self, method: str, task: str) -> dict[int, float]:
        return {run.seed: float(run.curve.mean()) for run in self.runs_of(method, task) if len(run.curve)}

    def _result(self, method: str, task: str) -> MethodResult:
        runs, curves = self.runs_of(method, task), self.curves(method, task)
        best = self.best_known(task)
        finals = np.array([run.final for run in runs])
        return MethodResult(
            task=task,
            method=method,
            seeds=tuple(run.seed for run in runs),
            e_hv=interval(curves.mean(axis=1)) if len(curves) else None,
            sigma_hv=float(curves.std(axis=0).mean()) if len(curves) > 1 else None,
            final=interval(finals),
            share_of_best_known=interval(finals / best) if best else None,
        )


def compare_runs(*places: str | Path, baseline: str | None = None) -> Comparison:
    """Compare the finished runs in these folders and below them; methods are named after their settings.

    Args:
        places: Folders.
        baseline: The method that the others are compared with; by default that of the first run.
    """
    return compare_summaries(read_finished_runs(places)[0], baseline)


def compare_summaries(runs: Sequence[RunSummary], baseline: str | None = None) -> Comparison:
    """Compare runs in the given order; by default the first method is the baseline."""
    if not runs:
        raise SettingsError("there is no finished run to compare")
    methods = list(dict.fromkeys(run.method for run in runs))
    if baseline is not None and baseline not in methods:
        raise SettingsError(f'no run has the method "{baseline}"; available: {", ".join(methods)}')
    seen: dict[tuple[str, str, int], Path] = {}
    for run in runs:
        other = seen.setdefault((run.method, run.task, run.seed), run.folder)
        if other != run.folder:
            raise SettingsError(
                f"{other} and {run.folder} are both {run.method} on {run.task} with seed {run.seed}; leave one out"
            )
    tasks = list(dict.fromkeys(run.task for run in runs))
    return Comparison(runs, methods, tasks, baseline or methods[0])


def _corrected(contrasts: Sequence[Contrast]) -> list[Contrast]:
    """Return the contrasts with p corrected for those that have enough pairs for a test."""
    corrected = iter(holm([found.test.p for found in contrasts if can_reject(found.test.n)]).tolist())
    return [replace(found, p_holm=next(corrected)) if can_reject(found.test.n) else found for found in contrasts]


def _check_same_problem(task: str, runs: Sequence[RunSummary]) -> None:
    """Raise SettingsError if runs of tasks with the same name cannot be compared."""
    first = runs[0]
    for run in runs[1:]:
        for what in ("targets", "space", "tolerance", "objectives"):
            values = [getattr(r.config.task if what == "targets" else r.config, what) for r in (first, run)]
            if what == "space":
                values = [space.model_copy(update={"name": ""}) for space in values]
            if values[0] != values[1]:
                raise SettingsError(f"{first.folder} and {run.folder} cannot be compared on {task}: {what} differ")
    lengths = {len(run.curve) for run in runs if len(run.curve)}
    if len(lengths) > 1:
        raise SettingsError(
            f"the runs on {task} have {' and '.join(map(str, sorted(lengths)))} counted trials; "
            "compare runs of the same length"
        )
