"""The run folder: the settings and finished trials of a run on disk, written, read and checked here.

    config.yaml        everything needed to repeat the run
    trials.jsonl       one line per finished trial, written before the next begins
    transcripts.jsonl  every call to a language model (llm/transcript.py)
    search.npz         state of a direct search (study/front/direct_search.py)
    trials.csv, front.csv, summary.json, shown.npz, designs/NNNN/ (results.py), and figures/ (pictures/figures.py)

The files of the last line are derived from the finished trials and can be written again.
"""

import errno
import os
import re
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import Self

from filelock import BaseFileLock, FileLock, Timeout

from armwright.exceptions import RunConflictError, RunFolderError
from armwright.files import check_no_links, is_part, naming_write_errors, open_to_append, read_text, replace_file
from armwright.problem.evaluators import Evaluator
from armwright.runs.config import Method, RunConfig, check_same_run, versions
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial, trial_line
from armwright.runs.trials_file import TRIALS, count_trials, read_trials
from armwright.yaml_documents import MAX_BYTES, dump_document, parse_document

LOCK = ".lock"  # locked by the process that writes; the system releases the lock of a dead process
LOCK_SECONDS = 2.0  # to wait for it: the workers of a killed experiment take a moment to end
OWNER_ONLY = 0o600
CONFIG = "config.yaml"
MAX_CONFIG = 4 * MAX_BYTES  # [bytes]; a task and a space with all their defaults
KEPT = ". What was written before is safe; free room or give another --out DIR, and run the same command again"
SEARCH = "search.npz"
REACH_MAPS = "reach-maps"
BEFORE_TRIALS = {LOCK, CONFIG, TRIALS, "transcripts.jsonl"}


class RunFolder:
    """A run folder held for writing by this process alone; a context manager."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._held = ExitStack()  # the lock, and the file of the trials
        self._stat: os.stat_result | None = None
        self._trials: FileIO | None = None

    def __enter__(self) -> Self:
        with naming_write_errors(self.path, KEPT):
            self.path.mkdir(parents=True, exist_ok=True)
        check_no_links(self.path)
        with naming_write_errors(self.path / LOCK, KEPT):
            try:
                self._held.enter_context(_private_lock(self.path / LOCK))
            except Timeout as fault:
                raise RunFolderError(
                    f"{self.path} is in use by another armwright process; wait for it, or give another --out DIR"
                ) from fault
            self._stat = self.path.stat()
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def adopt(self, config: RunConfig) -> RunConfig:
        """Return the folder's configuration: `config` for a folder without trials, or for one whose run it extends.

        Raises:
            RunConflictError: The folder holds a run with other settings, or other files.
        """
        if not (self.path / SEARCH).exists() and not count_trials(self.path / TRIALS):
            self._check_free()
            self.write_config(config)
            return config
        stored = read_config(self.path)
        check_same_run(self.path, stored, config)
        if config.method != stored.method:  # a larger n_total
            stored = stored.model_copy(update={"method": config.method})
            self.write_config(stored)
        return stored

    def note_versions(self, config: RunConfig, evaluator: Evaluator | None = None) -> RunConfig:
        """Return the configuration of a resumed run, with earlier versions if they differ."""
        now = versions(evaluator)
        if config.versions != now:
            earlier = [*config.earlier_versions, config.versions]
            config = config.model_copy(update={"versions": now, "earlier_versions": earlier})
            self.write_config(config)
        return config

    def _check_free(self) -> None:
        """Raise RunConflictError if the folder holds other files than those of a run without trials."""
        others = sorted({entry.name for entry in self.path.iterdir() if not is_part(entry.name)} - BEFORE_TRIALS)
        if (self.path / CONFIG).exists():
            read_config(self.path)
            if others:
                raise RunConflictError(
                    f"{self.path} holds results of a run ({others[0]}, …), but no trial in {TRIALS}; "
                    "put that file back, or give another --out DIR"
                )
        elif others:
            raise RunConflictError(
                f"{self.path} holds no run, but other files ({others[0]}, …); give another --out DIR"
            )

    def write_config(self, config: RunConfig) -> None:
        """Replace config.yaml atomically."""
        self.write_text(CONFIG, dump_document(config.model_dump(mode="json")))

    def open_trials(self, config: RunConfig) -> list[FinishedTrial]:
        """Return the finished trials without a truncated last line, and open the file for `append`."""
        path = self.path / TRIALS
        trials, intact = read_trials(path, config)
        with naming_write_errors(path, KEPT):
            self._trials = self._held.enter_context(open_to_append(path))
            if intact < self._trials.tell():  # otherwise the file keeps its modification time
                self._trials.truncate(intact)
        return trials

    def append(self, trial: FinishedTrial) -> None:
        """Append a finished trial in a single write, so that a crash truncates the last line at most."""
        assert self._trials is not None, "open_trials comes first"
        self._check_here()
        line = trial_line(trial)
        with naming_write_errors(self.path / TRIALS, KEPT):
            if os.fstat(self._trials.fileno()).st_nlink == 0:
                raise OSError(errno.ENOENT, "the file was deleted during the run")
            if self._trials.write(line) != len(line):
                raise OSError(errno.ENOSPC, "No space left on device")

    def _check_here(self) -> None:
        """Raise RunFolderError if the path is no longer the folder that is locked: nothing is written elsewhere."""
        with naming_write_errors(self.path, KEPT), suppress(FileNotFoundError):
            if self._stat is not None and os.path.samestat(self._stat, self.path.stat()):
                return
        raise RunFolderError(
            f"{self.path} was moved or deleted during the run; move it back, and rerun the same command to resume"
        )

    def replace_trials(self, trials: Iterable[FinishedTrial]) -> None:
        """Rewrite all trials."""
        self.write_bytes(TRIALS, b"".join(map(trial_line, trials)))

    def write_text(self, name: str, text: str) -> None:
        """Replace a file atomically, so that a crash leaves the old or the new one."""
        self.write_bytes(name, text.encode())

    def write_bytes(self, name: str, content: bytes) -> None:
        """Replace a binary file atomically."""
        target = self.path / name
        self._check_here()
        with naming_write_errors(target, KEPT):
            target.parent.mkdir(parents=True, exist_ok=True)
            replace_file(target, content)


def _private_lock(path: Path) -> BaseFileLock:
    """Return a lock whose file no other user can open: whoever can read a file can lock it, and so block a run."""
    with suppress(OSError):  # there is none yet, or it is another user's
        if not path.is_symlink():
            path.chmod(OWNER_ONLY)
    return FileLock(path, timeout=LOCK_SECONDS, mode=OWNER_ONLY)


def read_config(path: Path) -> RunConfig:
    """Read the configuration of a run folder."""
    file = path / CONFIG
    check_no_links(path)
    try:
        text = read_text(file, MAX_CONFIG, RunFolderError)
    except RunFolderError as fault:
        raise RunFolderError(f"{path} is not a run folder: {fault}; restore it, or give another folder") from fault
    try:
        return parse_document(text, RunConfig, RunFolderError, str(file))
    except RunFolderError as fault:
        raise RunFolderError(f"{fault}{_writer(text)}; restore the file, or give another --out DIR") from fault


def _writer(config: str) -> str:
    """Return which other version of armwright wrote a config.yaml that cannot be read; empty if this one did."""
    match, own = re.search(r"^  armwright: '?([^'\s]+)", config, re.MULTILINE), versions().get("armwright")
    return f" (written by armwright {match[1]}; this is {own})" if match and match[1] != own else ""


def read_run(path: str | Path) -> tuple[RunConfig, History]:
    """Read the configuration and the finished trials of a run folder without changing it."""
    path = Path(path)
    config = read_config(path)
    trials, _ = read_trials(path / TRIALS, config)
    method = config.method if isinstance(config.method, Method) else None
    return config, History(config.problem, trials, config.method.n_init, config.reference_point, method)
