"""A study with all its trials as an SQLite file of Optuna's, made in one go.

Optuna's own `study.add_trials` takes 8 ms a trial, and its library for databases half a second to load. So its tables
are made here as it makes them (optuna_storage.sql), and filled at once; a test compares every row with Optuna's.
"""

import json
import re
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any

TABLES = resources.files("armwright") / "optuna_storage.sql"
ALEMBIC_VERSION = "v3.2.0.a"  # of these tables
SCHEMA_VERSION = 12
LIBRARY_VERSION = "5.0.0"
STUDY = 1  # its id
METRIC_NAMES = "study:metric_names"

# An SQLite file's header: what it begins with, and where a number of four bytes says how often it was changed, and
# which program's it is.
MAGIC = b"SQLite format 3\x00"
CHANGES, APPLICATION = slice(24, 28), slice(68, 72)
HEADER = 100  # [bytes]
OURS = b"armw"


@dataclass(frozen=True)
class StoredTrial:
    """A finished trial as Optuna keeps it; the times are UTC.

    params: numbers, of a category its place among the choices.
    system: what Optuna, its samplers and its dashboard noted.
    """

    params: Mapping[str, float]
    values: Sequence[float]
    started: datetime
    ended: datetime
    user: Mapping[str, Any] = field(default_factory=dict[str, Any])
    system: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class StoredStudy:
    """A study of finished trials, all of whose objectives are minimised; the trials by number.

    distributions: of each parameter, as Optuna has it in JSON.
    """

    name: str
    metric_names: Sequence[str]
    distributions: Mapping[str, str]
    trials: Iterable[StoredTrial]
    user: Mapping[str, Any] = field(default_factory=dict[str, Any])
    system: Mapping[str, Any] = field(default_factory=dict[str, Any])


def trial_id(number: int) -> int:
    """The id that a trial has in the file."""
    return number + 1


def as_sqlite(study: StoredStudy) -> bytes:
    """The file's content."""
    connection = sqlite3.connect(":memory:", isolation_level=None)
    try:
        connection.execute(f"PRAGMA application_id = {int.from_bytes(OURS)}")
        connection.executescript(TABLES.read_text(encoding="utf-8"))
        connection.execute("BEGIN")
        _Tables(connection).fill(study)
        connection.execute("COMMIT")
        return connection.serialize()
    finally:
        connection.close()


def is_untouched(file: Path) -> bool:
    """Whether it is a file that `as_sqlite` made, and nobody has changed since."""
    with file.open("rb") as opened:
        header = opened.read(HEADER)
    ours = header.startswith(MAGIC) and header[APPLICATION] == OURS
    return ours and header[CHANGES] == bytes(4)


def artifact_ids(file: Path) -> set[str]:
    """The ids of the artifacts that a file names, as far as they are ids; none of a damaged one."""
    place = f"{file.resolve().as_uri()}?mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(place, uri=True)) as connection:
            query = "SELECT substr(key, 11) FROM trial_system_attributes WHERE key LIKE 'artifacts:%'"
            found = [str(id_) for (id_,) in connection.execute(query)]
    except sqlite3.Error:
        return set()
    return {id_ for id_ in found if re.fullmatch("[0-9a-f-]{36}", id_)}


class _Tables:
    """The tables of a new file."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def fill(self, study: StoredStudy) -> None:
        names = list(study.metric_names)
        self._add("alembic_version", [(ALEMBIC_VERSION,)])
        self._add("version_info", [(1, SCHEMA_VERSION, LIBRARY_VERSION)])
        self._add("studies", [(STUDY, study.name)])
        self._add("study_directions", [(None, "MINIMIZE", STUDY, place) for place in range(len(names))])
        self._add("study_user_attributes", _attributes(STUDY, study.user))
        self._add("study_system_attributes", _attributes(STUDY, {METRIC_NAMES: names, **study.system}))
        for number, trial in enumerate(study.trials):
            own = trial_id(number)
            self._add("trials", [(own, number, STUDY, "COMPLETE", _time(trial.started), _time(trial.ended))])
            self._add("trial_values", [(None, own, m, value, "FINITE") for m, value in enumerate(trial.values)])
            self._add(
                "trial_params",
                [(None, own, name, value, study.distributions[name]) for name, value in trial.params.items()],
            )
            self._add("trial_user_attributes", _attributes(own, trial.user))
            self._add("trial_system_attributes", _attributes(own, trial.system))

    def _add(self, table: str, rows: list[tuple[Any, ...]]) -> None:
        if rows:
            self._connection.executemany(f"INSERT INTO {table} VALUES ({', '.join('?' * len(rows[0]))})", rows)


def _attributes(owner: int, attributes: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    return [(None, owner, name, json.dumps(value)) for name, value in attributes.items()]


def _time(moment: datetime) -> str:
    """As SQLAlchemy writes it."""
    return f"{moment:%Y-%m-%d %H:%M:%S.%f}"
