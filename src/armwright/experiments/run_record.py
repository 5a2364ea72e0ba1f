"""Finished runs: found in folders, and read from their summaries."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import RunFolderError
from armwright.pareto import hypervolume
from armwright.proof.attribution import attribution_by_source
from armwright.proof.results import read_summary
from armwright.runs.config import FrontMethod, RunConfig, describe_method
from armwright.runs.folder import CONFIG, read_config, read_run
from armwright.runs.history import BBO, RANDOM, History


@dataclass(frozen=True)
class RunSummary:
    """A finished run.

    reference_point: bounds its hypervolume. If it differs from that of the run itself, all hypervolumes are computed
        again from the trials (for a front search, from the designs it kept).
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
        """Hypervolume over the counted trials (I,); empty for a front search."""
        if isinstance(self.config.method, FrontMethod):
            return np.zeros(0)
        if self._has_own_reference_point:
            return np.array(self.summary["hypervolume"]["history"])
        return self.history().hypervolume

    @cached_property
    def final(self) -> float:
        """Hypervolume at the end."""
        if len(self.curve):
            return float(self.curve[-1])
        if self._has_own_reference_point:
            return float(self.summary["hypervolume"]["final"])
        return hypervolume(self.history().masked_objectives, self.reference_point)

    @cached_property
    def gained(self) -> Mapping[str, float]:
        """Share of the final hypervolume that each source's trials added when they were evaluated."""
        attributions: Mapping[str, Any] = self.summary["attribution"]
        if not self._has_own_reference_point:
            attributions = {source: asdict(one) for source, one in attribution_by_source(self.history()).items()}
        gained = {source: one["hypervolume_gained"] or 0.0 for source, one in attributions.items()}
        total = sum(gained.values())
        return {source: share / total for source, share in gained.items()} if total else dict.fromkeys(gained, 0.0)

    @property
    def seconds(self) -> float:
        """Duration of the run [s]."""
        return float(
            self.summary["search"]["seconds"] if "search" in self.summary else self.summary["seconds"]["total"]
        )

    @property
    def proposer(self) -> Mapping[str, Any]:
        """The proposer's part of the summary; empty without a proposer."""
        return self.summary.get("proposer") or {}

    @property
    def is_flagged(self) -> bool:
        """True if too many proposals failed for the run to represent its method."""
        return bool(self.proposer.get("flagged"))

    @property
    def is_scripted(self) -> bool:
        """True if a scripted stand-in answered instead of a model."""
        return self.proposer.get("origin") == "scripted"

    @property
    def _has_own_reference_point(self) -> bool:
        return self.reference_point == self.config.reference_point

    def history(self) -> History:
        """Read the trials from the run's folder."""
        _, history = read_run(self.folder)
        task = history.problem.task.model_copy(update={"reference_point": self.reference_point})
        return replace(history, problem=replace(history.problem, task=task))


def shares_by_source(runs: Sequence[RunSummary]) -> dict[str, dict[str, float]]:
    """Return what the designs of each source contributed, averaged over the runs; random trials and black box first.

    trials: their number. front: share of the final front. gained: as in `RunSummary.gained`. Front searches do not
    count: all their designs have one source.
    """
    runs = [run for run in runs if "attribution" in run.summary]
    sources = dict.fromkeys(source for run in runs for source in run.summary["attribution"])
    shares: dict[str, dict[str, float]] = {}
    for source in sorted(sources, key=lambda source: (source != RANDOM, source != BBO)):
        of_runs = [run.summary["attribution"].get(source, {"trials": 0, "front": 0}) for run in runs]
        shares[source] = {
            "trials": float(np.mean([own["trials"] for own in of_runs])),
            "front": float(
                np.mean([o["front"] / max(1, run.summary["front_size"]) for o, run in zip(of_runs, runs, strict=True)])
            ),
            "gained": float(np.mean([run.gained.get(source, 0.0) for run in runs])),
        }
    return shares


def read_run_summary(folder: Path, method: str | None = None) -> RunSummary:
    """Read a finished run; the name of its method is by default a description of its settings."""
    config, summary = read_config(folder), read_summary(folder)
    if summary is None:
        raise RunFolderError(f"{folder} is not finished; repeat the command that started it")
    label = method or describe_method(config)
    return RunSummary(folder, label, config.task.name, config.seed, config, summary, config.reference_point or ())


def find_runs(folders: Iterable[Path]) -> list[Path]:
    """Return the run folders among these folders and below them, by path; folders inside a run are not searched."""
    runs: list[Path] = []
    for folder in folders:
        if not folder.exists():
            raise RunFolderError(f"there is no {folder}")
        if (folder / CONFIG).is_file():
            runs.append(folder)
        elif folder.is_dir():
            runs += find_runs(sorted(entry for entry in folder.iterdir() if entry.is_dir()))
    return runs


def read_finished_runs(folders: Iterable[str | Path]) -> tuple[list[RunSummary], list[Path]]:
    """Return the finished runs in these folders and below them, and the folders of unfinished runs."""
    runs = list(dict.fromkeys(find_runs(map(Path, folders))))
    unfinished = [run for run in runs if read_summary(run) is None]
    return [read_run_summary(run) for run in runs if run not in unfinished], unfinished
