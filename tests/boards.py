"""The study that a search shares with its workers, as Optuna itself opens it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import optuna
from optuna.storages import RDBStorage

from armwright.run_folder import read_config


@contextmanager
def optunas(run: Path) -> Iterator[optuna.Study]:
    """That of a run folder; its connections are closed at the end."""
    record = read_config(run).workers
    assert record is not None
    storage = RDBStorage(record.storage)
    yield optuna.load_study(storage=storage, study_name=record.study)
    storage.remove_session()
    storage.engine.dispose()
