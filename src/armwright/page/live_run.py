"""A run folder as the live server shows it: its content, and the status of the study."""

import threading
from pathlib import Path
from typing import Any
from zlib import crc32

from armwright.exceptions import ArmwrightError
from armwright.existing.compare_arms import EXISTING_ARMS
from armwright.extras import naming_extras
from armwright.files import replace_surrogates
from armwright.llm.transcript import TRANSCRIPTS
from armwright.page.content import RunContent
from armwright.proof.results import REPORT, SUMMARY
from armwright.runs.config import FrontMethod
from armwright.runs.control import read_status
from armwright.runs.folder import CONFIG, is_held, read_config
from armwright.runs.trials_file import TRIALS

SHOWN = (CONFIG, TRIALS, TRANSCRIPTS, SUMMARY, EXISTING_ARMS, REPORT)  # files that change the page
CHANGING = {"reference_point", "versions", "earlier_versions", "method"}  # settings of one and the same run
RECENT = 20  # trials whose mean duration predicts the remaining time
RUNNING = ("evaluating", "asking", "searching")


class LiveRun:
    """The current content of a run folder, which may not hold a run yet. Safe to use from several threads."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.fault = ""  # the reason why the folder cannot be read
        self._content: RunContent | None = None
        self._version = 0  # of the content
        self._run = 0  # by which a page recognises another run
        self._seen: list[tuple[int, ...] | None] = []
        self._lock = threading.Lock()

    def packed(self) -> bytes | None:
        """Return the content of the page; None while there is no run."""
        with self._lock:
            self._look()
            return None if self._content is None else self._content.packed()

    def file(self, number: int, kind: str) -> str | None:
        """Return a design as text; None if it does not exist. kind: urdf, mjcf or datasheet."""
        with self._lock:
            self._look()
            if self._content is None or number >= len(self._content.history):
                return None
            if kind == "datasheet":
                with naming_extras("a data sheet"):
                    from armwright.sheet.design_sheet import design_sheet
                    from armwright.sheet.html import to_html
                return to_html(design_sheet(self.folder, number))
            return self._content.file(number, kind)

    def _look(self) -> None:
        """Read the files that have changed."""
        seen = [_stamp(self.folder / name) for name in SHOWN]
        if seen == self._seen:
            return
        self._seen = seen
        try:
            if (self.folder / CONFIG).is_file():
                self._read()
            self.fault = ""
        except ArmwrightError as fault:
            self.fault = str(fault)  # for example a file that is being rewritten; it is read again when it changes
        except Exception as fault:  # noqa: BLE001 (the server must survive any folder content)
            self.fault = f"the run folder cannot be read: {type(fault).__name__}: {fault}"

    def _read(self) -> None:
        config = read_config(self.folder)
        run = crc32(config.model_dump_json(exclude=CHANGING).encode())
        if isinstance(config.method, FrontMethod):  # a longer search replaces its trials
            run = crc32(str(_stamp(self.folder / TRIALS)).encode(), run)
        if run != self._run:
            self._content = None  # an unreadable run must not appear as the previous one
        self._run = run
        self._content = RunContent(self.folder, self._content)
        self._version += 1

    def status(self) -> dict[str, Any]:
        """Return the content of the page's status bar."""
        with self._lock:
            self._look()
            content, version, run = self._content, self._version, self._run
        status = read_status(self.folder)
        trials = () if content is None else content.history.trials
        study = None if content is None else content.study
        is_finished = content is not None and content.summary is not None
        doing = status.doing if status is not None else "finished" if is_finished else "unknown"
        if doing == "unknown" and content is not None and content.study is None and is_held(self.folder):
            doing = "searching"  # a direct search, which reports no status
        if doing in RUNNING and not is_held(self.folder):
            doing = "gone"
        recent = [trial.seconds.get("total", 0.0) for trial in trials[-RECENT:]]
        planned = None if study is None else study.n_trials
        return {
            "name": replace_surrogates(self.folder.resolve().name),
            "run": run,
            "version": version,
            "doing": doing,
            "since": 0.0 if status is None else status.since,
            "designs": len(trials),
            "planned": planned,
            "left": None if planned is None or not recent else (planned - len(trials)) * sum(recent) / len(recent),
            "fault": self.fault or ("" if status is None else status.fault),
            "asks_a_model": study is not None and "prompt" in (study.proposer or {}),
        }


def _stamp(path: Path) -> tuple[int, ...] | None:
    try:
        there = path.stat()
    except OSError:
        return None
    return there.st_mtime_ns, there.st_ctime_ns, there.st_size, there.st_ino
