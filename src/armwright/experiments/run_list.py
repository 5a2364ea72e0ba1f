"""Find run folders, and list their progress."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from armwright.exceptions import RunFolderError
from armwright.experiments.run_record import RunSummary, read_run_summary
from armwright.proof.results import read_summary
from armwright.runs.config import FrontMethod, describe_method
from armwright.runs.folder import CONFIG, read_config
from armwright.runs.trials_file import TRIALS, count_trials


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


def list_runs(folders: Sequence[Path]) -> list[dict[str, Any]]:
    """Return the content and progress of each run folder; damaged ones are listed as such."""
    return [_run_record(folder) for folder in folders]


def read_finished_runs(folders: Iterable[str | Path]) -> tuple[list[RunSummary], list[Path]]:
    """Return the finished runs in these folders and below them, and the folders of unfinished runs."""
    runs = list(dict.fromkeys(find_runs(map(Path, folders))))
    finished = [run for run in runs if read_summary(run) is not None]
    return [read_run_summary(run) for run in finished], [run for run in runs if run not in finished]


def _run_record(folder: Path) -> dict[str, Any]:
    record: dict[str, Any] = {
        "folder": str(folder),
        "task": "",
        "method": "",
        "seed": "",
        "trials": 0,
        "hypervolume": None,
        "share_of_best_known": None,
    }
    try:
        config, summary = read_config(folder), read_summary(folder)
    except RunFolderError:
        return record | {"state": f"damaged {CONFIG}"}
    record |= {"task": config.task.name, "method": describe_method(config), "seed": config.seed}
    if summary is not None:
        known = summary["front_gap"]
        return record | {
            "trials": summary["n_trials"],
            "hypervolume": summary["hypervolume"]["final"],
            "share_of_best_known": None if known is None else known["share"],
            "state": "finished",
        }
    try:
        n = count_trials(folder / TRIALS)
    except RunFolderError:
        return record | {"state": f"damaged {TRIALS}"}
    planned = "" if isinstance(config.method, FrontMethod) else f" of {config.method.n_trials}"
    return record | {"trials": n, "state": f"unfinished, {n}{planned} trials"}
