"""Finished runs side by side: what each method came to on each task, and what may be said of the differences."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import RunFolderError, SettingsError
from armwright.experiments.statistics import Interval, PairedTest, can_reject, holm, interval, paired_test
from armwright.pareto import hypervolume
from armwright.runs.attribution import credit_by_source
from armwright.runs.best_known import known_front
from armwright.runs.config import FrontMethod, RunConfig
from armwright.runs.folder import CONFIG, read_config, read_run
from armwright.runs.history import History
from armwright.runs.results import read_summary
from armwright.runs.trials_file import TRIALS

LEVELS = (0.5, 0.75, 0.9, 0.95)  # of the best known hypervolume, for the time to get there
NAMES = {"rules": "rules", "llm": "LLM", "manual": "people", "scripted": "scripted"}


@dataclass(frozen=True)
class Run:
    """A finished run, as its summary tells of it.

    reference_point: within which its hypervolume counts. Where this is not the one that it ran with, all is computed
        anew from its trials: of a search for the whole front, from the designs that it kept.
    """

    folder: Path
    method: str
    task: str
    seed: int
    config: RunConfig
    summary: Mapping[str, Any]
    reference_point: tuple[float, ...]

    @cached_property
    def curve(self) -> Array:
        """(I,) the hypervolume over the counted trials, without what was refined afterwards.

        Empty for a search for the whole front.
        """
        if isinstance(self.config.method, FrontMethod):
            return np.zeros(0)
        whole = np.array(self.summary["hypervolume"]["history"]) if self._as_it_ran else self.history().hypervolume
        return whole[: self.config.method.n_total]

    @cached_property
    def final(self) -> float:
        """The hypervolume at the end."""
        if len(self.curve):
            return float(self.curve[-1])
        if self._as_it_ran:
            return float(self.summary["hypervolume"]["final"])
        return hypervolume(self.history().masked_objectives, self.reference_point)

    @cached_property
    def gained(self) -> Mapping[str, float]:
        """The share of the final hypervolume by which each source's trials enlarged it when they came."""
        if self._as_it_ran:
            gained = {source: credit["hypervolume_gained"] or 0.0 for source, credit in self.summary["credit"].items()}
        else:
            credits = credit_by_source(self.history())
            gained = {source: credit.hypervolume_gained or 0.0 for source, credit in credits.items()}
        whole = sum(gained.values())
        return {source: share / whole for source, share in gained.items()} if whole else dict.fromkeys(gained, 0.0)

    def history(self) -> History:
        """Its trials, read from its folder."""
        _, history = read_run(self.folder)
        task = history.problem.task.model_copy(update={"reference_point": self.reference_point})
        return replace(history, problem=replace(history.problem, task=task))

    def within(self, reference_point: tuple[float, ...]) -> "Run":
        """The same run, its hypervolume within another box."""
        return replace(self, reference_point=reference_point)

    @property
    def _as_it_ran(self) -> bool:
        return self.reference_point == self.config.reference_point

    @property
    def proposer(self) -> Mapping[str, Any]:
        """What the summary says of the proposer; empty where there was none."""
        return self.summary.get("proposer") or {}

    @property
    def is_flagged(self) -> bool:
        """Whether so many proposals failed that the run does not stand for its method."""
        return bool(self.proposer.get("flagged"))

    @property
    def is_scripted(self) -> bool:
        """Whether what answered was no model, but a stand-in."""
        return self.proposer.get("origin") == "scripted"


@dataclass(frozen=True)
class Row:
    """What a method came to on a task.

    runs: that count. e_hv, deviation: as the paper's table; None for a search for the whole front.
    share: of the best known hypervolume; None where none is known. seconds: a run's, on average.
    """

    method: str
    task: str
    runs: int
    e_hv: Interval | None
    deviation: float | None
    final: Interval
    share: Interval | None
    seconds: float


@dataclass(frozen=True)
class Contrast:
    """A method beside the baseline on a task, seed by seed, in E_hv; p_holm: corrected for the number of contrasts."""

    method: str
    task: str
    test: PairedTest
    p_holm: float


@dataclass(frozen=True)
class Overall:
    """A method beside the baseline over all tasks that both ran, each task counting once.

    ratio: of its mean E_hv to the baseline's, averaged over the tasks. test: of the logarithms of these ratios, task by
        task (Demsar, JMLR 7:1, 2006). p_holm: corrected for the number of methods.
    """

    method: str
    ratio: Interval
    test: PairedTest
    p_holm: float


@dataclass(frozen=True)
class TimeTo:
    """After how many counted trials a share of the best known hypervolume was there.

    median: over the runs; None where fewer than half of them got there. reached: so many did.
    """

    method: str
    task: str
    level: float
    hypervolume: float
    reached: int
    runs: int
    median: float | None


class Comparison:
    """Runs of several methods on the same tasks.

    methods, tasks: in the order in which they are shown. baseline: what the other methods are compared with.
    left_out: runs that are flagged, which stand for nothing.
    widened: the tasks whose runs had reference points of their own; the largest values of these count for all.
    """

    def __init__(self, runs: Iterable[Run], methods: Sequence[str], tasks: Sequence[str], baseline: str) -> None:
        runs = list(runs)
        points: dict[str, tuple[float, ...]] = {}
        for task in tasks:
            same = [run for run in runs if run.task == task]
            if same:
                _check_same_problem(task, same)
                points[task] = tuple(np.max([run.reference_point for run in same], axis=0).tolist())
        self.widened = [
            task for task in points if any(r.reference_point != points[r.task] for r in runs if r.task == task)
        ]
        runs = [run.within(points[run.task]) for run in runs]
        self.left_out = [run for run in runs if run.is_flagged]
        self.runs = [run for run in runs if not run.is_flagged]
        self.methods = [method for method in methods if any(run.method == method for run in self.runs)]
        self.tasks = [task for task in tasks if any(run.task == task for run in self.runs)]
        self.baseline = baseline

    def of(self, method: str, task: str) -> list[Run]:
        """The runs of a method on a task, by seed."""
        found = [run for run in self.runs if (run.method, run.task) == (method, task)]
        return sorted(found, key=lambda run: run.seed)

    def marked(self, method: str) -> str:
        """A method's name; with a mark where what answered was no model, but a stand-in."""
        return f"{method} [scripted]" if any(run.is_scripted for run in self.runs if run.method == method) else method

    def curves(self, method: str, task: str) -> Array:
        """(S, I) their hypervolumes over the counted trials; (0, 0) where there are none."""
        curves = [run.curve for run in self.of(method, task) if len(run.curve)]
        return np.array(curves) if curves else np.zeros((0, 0))

    def reference_point(self, task: str) -> tuple[float, ...]:
        """Of all runs on a task."""
        return next(run for run in self.runs if run.task == task).reference_point

    def best_known(self, task: str) -> float | None:
        """The best known hypervolume of a task, within the runs' reference point."""
        known = known_front(next(run for run in self.runs if run.task == task).config.problem)
        return None if known is None else hypervolume(known.values, self.reference_point(task))

    @cached_property
    def rows(self) -> list[Row]:
        """By task and method."""
        return [self._row(method, task) for task in self.tasks for method in self.methods if self.of(method, task)]

    @cached_property
    def contrasts(self) -> list[Contrast]:
        """Every other method beside the baseline, on every task on which both have the same seeds at least once."""
        found: list[tuple[str, str, PairedTest]] = []
        for task in self.tasks:
            theirs = {run.seed: run.curve.mean() for run in self.of(self.baseline, task) if len(run.curve)}
            for method in self.methods:
                ours = {run.seed: run.curve.mean() for run in self.of(method, task) if len(run.curve)}
                seeds = sorted(ours.keys() & theirs.keys())
                if method != self.baseline and seeds:
                    test = paired_test([ours[seed] for seed in seeds], [theirs[seed] for seed in seeds])
                    found.append((method, task, test))
        corrected = holm([test.p for _, _, test in found])
        return [Contrast(*contrast, float(p)) for contrast, p in zip(found, corrected, strict=True)]

    @cached_property
    def overall(self) -> list[Overall]:
        """Every other method beside the baseline over the tasks; none where fewer than six tasks could say anything."""
        e_hv = {(row.method, row.task): row.e_hv.mean for row in self.rows if row.e_hv is not None}
        found: list[tuple[str, Interval, PairedTest]] = []
        for method in self.methods:
            pairs = [
                (e_hv[method, task], e_hv[self.baseline, task])
                for task in self.tasks
                if method != self.baseline and {(method, task), (self.baseline, task)} <= e_hv.keys()
            ]
            ours, theirs = np.array([pair for pair in pairs if min(pair) > 0.0]).reshape(-1, 2).T
            if can_reject(len(ours)):
                found.append((method, interval(ours / theirs), paired_test(np.log(ours), np.log(theirs))))
        corrected = holm([test.p for *_, test in found])
        return [Overall(*over, float(p)) for over, p in zip(found, corrected, strict=True)]

    @property
    def is_undecidable(self) -> bool:
        """Whether some contrast has too few pairs for any test at 5 %."""
        return any(not can_reject(contrast.test.n) for contrast in self.contrasts)

    @cached_property
    def times(self) -> list[TimeTo]:
        """To shares of the best known hypervolume; where none is known, of the best that any of the runs found."""
        return [
            self._time_to(method, task, level)
            for task in self.tasks
            for method in self.methods
            if len(self.curves(method, task))
            for level in LEVELS
        ]

    def yardstick(self, task: str) -> float:
        """The best known hypervolume, or the best of these runs where none is known."""
        return self.best_known(task) or max(run.final for run in self.runs if run.task == task)

    def trials_to(self, method: str, task: str, level: float) -> list[float]:
        """After how many counted trials each run of a method came to a level of the yardstick; infinite: never."""
        goal = level * self.yardstick(task)
        curves = self.curves(method, task)
        return [float(np.argmax(curve >= goal)) + 1 if curve[-1] >= goal else math.inf for curve in curves]

    def _time_to(self, method: str, task: str, level: float) -> TimeTo:
        there = self.trials_to(method, task, level)
        median = float(np.median(there))
        reached = sum(map(math.isfinite, there))
        goal = level * self.yardstick(task)
        return TimeTo(method, task, level, goal, reached, len(there), median if math.isfinite(median) else None)

    def _row(self, method: str, task: str) -> Row:
        runs, curves = self.of(method, task), self.curves(method, task)
        best = self.best_known(task)
        finals = np.array([run.final for run in runs])
        return Row(
            method=method,
            task=task,
            runs=len(runs),
            e_hv=interval(curves.mean(axis=1)) if len(curves) else None,
            deviation=float(curves.std(axis=0).mean()) if len(curves) else None,
            final=interval(finals),
            share=interval(finals / best) if best else None,
            seconds=float(np.mean([_seconds(run.summary) for run in runs])),
        )


def read_run_record(folder: Path, method: str | None = None) -> Run:
    """A finished run; method: what it is called, else after its settings."""
    config, summary = read_config(folder), read_summary(folder)
    if summary is None:
        raise RunFolderError(f"{folder} is not finished; give the command that began it once more")
    words = method or method_words(config)
    return Run(folder, words, config.task.name, config.seed, config, summary, config.reference_point or ())


def method_words(config: RunConfig) -> str:
    """How a run searched, in a few words: what differs from the usual is named."""
    method = config.method
    if isinstance(method, FrontMethod):
        return "front search"
    words = "BBO" if method.sampler == "tpe" else f"BBO ({method.sampler})"
    if method.proposer is not None:
        name = str(method.proposer["name"])
        words += f"/{NAMES.get(name, name)}"
        words += {"plus": "+", "minus": "-"}.get(str(method.proposer.get("prompt", "")), "")
        if model := method.proposer.get("model"):
            words += f" {model}"
        if method.n_step != 10:
            words += f" (N_step {method.n_step})"
    if method.polish_every:
        words += f" (polish {method.polish_every})"
    if method.n_total != 200:
        words += f" ({method.n_total} trials)"
    return words


def find_runs(places: Iterable[Path]) -> list[Path]:
    """The run folders among these places and below them, by path; what a run holds within is its own."""
    found: list[Path] = []
    for place in places:
        if not place.exists():
            raise RunFolderError(f"there is no {place}")
        if (place / CONFIG).is_file():
            found.append(place)
        elif place.is_dir():
            found += find_runs(sorted(entry for entry in place.iterdir() if entry.is_dir()))
    return found


def list_runs(folders: Sequence[Path]) -> list[dict[str, Any]]:
    """What each run folder holds, and how far it has come; a damaged one says so."""
    return [_listed(folder) for folder in folders]


def _listed(folder: Path) -> dict[str, Any]:
    nothing = {"task": "", "method": "", "seed": "", "trials": 0, "hypervolume": None, "share_of_best_known": None}
    listed: dict[str, Any] = {"folder": str(folder), **nothing}
    try:
        config, summary = read_config(folder), read_summary(folder)
    except RunFolderError:
        return listed | {"state": f"damaged {CONFIG}"}
    listed |= {"task": config.task.name, "method": method_words(config), "seed": config.seed}
    if summary is not None:
        known = summary["best_known"]
        return listed | {
            "trials": summary["n_trials"],
            "hypervolume": summary["hypervolume"]["final"],
            "share_of_best_known": None if known is None else known["share"],
            "state": "finished",
        }
    trials = folder / TRIALS
    n = trials.read_bytes().count(b"\n") if trials.is_file() else 0
    planned = "" if isinstance(config.method, FrontMethod) else f" of {config.method.n_trials}"
    return listed | {"trials": n, "state": f"unfinished, {n}{planned} trials"}


def compare_runs(*places: str | Path, baseline: str | None = None) -> Comparison:
    """The finished runs among these folders and below them, side by side, named after how they searched.

    baseline: the method that the others are compared with; without it, that of the first run.
    """
    finished, _ = finished_runs(places)
    return side_by_side(finished, baseline)


def finished_runs(places: Iterable[str | Path]) -> tuple[list[Run], list[Path]]:
    """The finished runs among these folders and below them, and the folders of those that are not finished."""
    folders = list(dict.fromkeys(find_runs(map(Path, places))))
    finished = [folder for folder in folders if read_summary(folder) is not None]
    return [read_run_record(folder) for folder in finished], [folder for folder in folders if folder not in finished]


def side_by_side(runs: Sequence[Run], baseline: str | None = None) -> Comparison:
    """Runs side by side, in the order given; the first method is the baseline, where none is named."""
    if not runs:
        raise SettingsError("there is no finished run to compare")
    methods = list(dict.fromkeys(run.method for run in runs))
    if baseline is not None and baseline not in methods:
        raise SettingsError(f'no run is of the method "{baseline}"; there are: {", ".join(methods)}')
    seen: dict[tuple[str, str, int], Path] = {}
    for run in runs:
        other = seen.setdefault((run.method, run.task, run.seed), run.folder)
        if other != run.folder:
            raise SettingsError(
                f"{other} and {run.folder} are both {run.method} on {run.task} with seed {run.seed}; leave one out"
            )
    tasks = list(dict.fromkeys(run.task for run in runs))
    return Comparison(runs, methods, tasks, baseline or methods[0])


def _check_same_problem(task: str, runs: Sequence[Run]) -> None:
    """SettingsError where runs under one task's name cannot be compared."""
    first = runs[0]
    for run in runs[1:]:
        for what in ("targets", "space", "tolerance", "objectives"):
            ours, theirs = (getattr(r.config.task if what == "targets" else r.config, what) for r in (first, run))
            if what == "space":
                ours, theirs = (space.model_copy(update={"name": ""}) for space in (ours, theirs))
            if ours != theirs:
                raise SettingsError(f"{first.folder} and {run.folder} cannot be compared on {task}: {what} differ")
    lengths = {len(run.curve) for run in runs if len(run.curve)}
    if len(lengths) > 1:
        raise SettingsError(
            f"the runs on {task} have {' and '.join(map(str, sorted(lengths)))} counted trials; "
            "compare runs of the same length"
        )


def _seconds(summary: Mapping[str, Any]) -> float:
    return float(summary["search"]["seconds"] if "search" in summary else summary["seconds"]["total"])
