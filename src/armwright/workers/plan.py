"""What a study is told of its workers."""

import os
import secrets
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from armwright.exceptions import SettingsError
from armwright.judging import Judging
from armwright.measuring import Evaluator
from armwright.problem import Problem
from armwright.run_config import WorkersRecord
from armwright.run_folder import CONFIG, read_config

STORAGE_VARIABLE = "ARMWRIGHT_STORAGE"
FILE = "workers.db"


@dataclass(frozen=True)
class Workers:
    """Processes that evaluate designs in place of the search: `armwright worker RUN`, as many as wanted.

    at_a_time: designs under way at most; as many as there are workers.
    storage: the URL of a database that search and workers reach, such as postgresql://user@host/database; without it, a
        SQLite file in the run folder, for workers on the same machine.
    heartbeat: [s] between two signs of life of a worker; after three without, another one evaluates its design.
    """

    at_a_time: int
    storage: str | None = field(default=None, repr=False)  # a password may be in it
    heartbeat: int = 10

    def __post_init__(self) -> None:
        if not 1 <= self.at_a_time <= 10_000 or not 1 <= self.heartbeat <= 3600:
            raise SettingsError(
                f"workers: {self.at_a_time} at a time, heartbeat {self.heartbeat} s; 1 to 10,000 and 1 to 3600 s are "
                "possible"
            )

    def record(self, out: Path) -> WorkersRecord:
        """What a run's settings say of them; the database's password never."""
        from armwright.workers.board import shown_url

        name = f"armwright-{out.resolve().name}-{secrets.token_hex(4)}"
        url = shown_url(self._url(out))
        return WorkersRecord(storage=url, study=name, at_a_time=self.at_a_time, heartbeat=self.heartbeat)

    def begin(self, problem: Problem, record: WorkersRecord, say: Callable[[str], None]) -> Judging:
        """The search's side of them."""
        from armwright.workers.judging import ByWorkers

        return ByWorkers(problem, self.storage or os.environ.get(STORAGE_VARIABLE) or record.storage, record, say)

    def command(self, folder: Path, evaluator: Evaluator | None) -> str:
        """What the user starts, in words."""
        words = ["armwright", "worker", str(folder)]
        if evaluator is not None:
            words += ["--evaluator", evaluator.place or evaluator.name]
        return f"designs wait for workers; start {self.at_a_time} of: {shlex.join(words)}"

    def _url(self, out: Path) -> str:
        """As it is named, else as a run that goes on has it, else a file in its folder, wherever that is now."""
        from armwright.workers.board import sqlite_url

        named = self.storage or os.environ.get(STORAGE_VARIABLE)
        if named is None and (out / CONFIG).is_file():
            before = read_config(out).workers
            named = None if before is None or before.storage.endswith(f"/{FILE}") else before.storage
        return named or sqlite_url(out / FILE)
