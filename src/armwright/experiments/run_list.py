"""Find run folders, and read the finished ones."""

from collections.abc import Iterable
from pathlib import Path

from armwright.exceptions import RunFolderError
from armwright.experiments.run_record import RunSummary, read_run_summary
from armwright.proof.results import read_summary
from armwright.runs.folder import CONFIG


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
