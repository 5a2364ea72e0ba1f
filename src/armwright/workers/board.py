"""The Optuna study that a search and its workers share.

The search posts each design as a waiting trial; a worker claims it, evaluates it, and tells its values. Claiming and
telling are one statement each, so a trial has one worker, and one set of values. A worker shows that it lives by a
heartbeat; the trial of one that does not is failed, and posted again. All clocks are the database's.
"""

import threading
import time
import warnings
from collections.abc import Callable, Container, Generator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

import optuna
from filelock import FileLock
from optuna.distributions import BaseDistribution
from optuna.exceptions import ExperimentalWarning, StorageInternalError, UpdateFinishedTrialError
from optuna.storages import RDBStorage, RetryHeartbeatStaleTrialCallback, fail_stale_trials, get_storage
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState, create_trial

from armwright.exceptions import MissingExtraError, SettingsError, StorageError
from armwright.extras import command
from armwright.files import writable
from armwright.problem import Outcome
from armwright.sampling import quietly

if TYPE_CHECKING:
    from sqlalchemy import URL, Engine

# Attributes of a posted trial.
BEGUN = "armwright"  # the trial as it was begun (`trials_file.begun_record`)
NUMBER = "number"  # the search's own, which stays where it is posted again
ERROR = "error"  # why its evaluator failed
GIVEN_BACK = "given_back"  # its worker was stopped, and nothing is wrong with the trial
FAILURE = "failure"  # as of `Outcome`
SECONDS = "seconds"  # that its evaluation took
FINISHED = "finished"  # of the study: there is nothing more to do

SIGNS_MISSED = 3  # heartbeats without which a worker counts as dead
OUTAGE = 600.0  # [s] that a database may be away
BETWEEN_TRIES = 1.0  # [s] while it is
SQLITE_TIMEOUT = 100.0  # [s] that a process waits for others that write

Made = TypeVar("Made")


@dataclass(frozen=True)
class Posted:
    """A trial on the board.

    place: its number there.  number: the search's.
    """

    place: int
    number: int
    state: TrialState
    begun: Any
    judgement: Outcome | None
    seconds: float
    error: str
    is_given_back: bool


class Board:
    """The shared study, for both sides. Where the database is away for a while, all wait for it.

    say: called once where the database stops answering, and once where it does again.
    """

    def __init__(
        self, url: str, study: str, heartbeat: int, constraints: Sequence[str], say: Callable[[str], None] = print
    ) -> None:
        self._name = study
        self._constraints = tuple(constraints)
        self._heartbeat = heartbeat
        self._say = say
        self._looked = 0.0  # [s since 1970] for silent workers, the last time
        self._stale_from = 0.0  # [s, monotonic] from when on they count as dead
        self._hear_first()  # the database may just be back
        file = _sqlite_file(url)
        # SQLite has no row locks: two workers could claim one trial.
        self._claiming = nullcontext() if file is None else FileLock(file.with_name(f".{file.name}.claim"))
        self._database = _storage(url, heartbeat)
        self._storage = get_storage(self._database)  # which reads finished trials once

    def create(self, directions: Sequence[StudyDirection], names: Sequence[str]) -> None:
        """Makes the study, or finds it."""
        with quietly():
            self._study = self._patiently(
                lambda: optuna.create_study(
                    storage=self._storage, study_name=self._name, directions=directions, load_if_exists=True
                )
            )
        self._experimental(lambda: self._study.set_metric_names(list(names)))
        self._patiently(lambda: self._study.set_user_attr(FINISHED, False))

    def open(self) -> None:
        """Finds the study; StorageError where there is none."""
        self._study = self._patiently(lambda: optuna.load_study(storage=self._storage, study_name=self._name))

    def close(self) -> None:
        """Ends all connections."""
        self._storage.remove_session()
        self._database.engine.dispose()

    # --- the search's side -------------------------------------------------------------------------------------------

    def post(self, begun: dict[str, Any], params: dict[str, Any], distributions: dict[str, BaseDistribution]) -> None:
        """Lets workers evaluate a trial."""
        attributes = {BEGUN: begun, NUMBER: begun["number"], "source": begun["source"]}
        trial = create_trial(
            state=TrialState.WAITING, params=params, distributions=distributions, user_attrs=attributes
        )
        self._once(lambda: self._study.add_trial(trial), begun["number"])

    def post_again(self, posted: Posted) -> None:
        """Lets workers evaluate a failed trial once more, as Optuna does with the trial of a dead worker."""
        with _without_warnings():
            retry = RetryHeartbeatStaleTrialCallback()
        self._once(lambda: retry(self._study, _without_marks(self._study.trials[posted.place])), posted.number)

    def _once(self, post: Callable[[], object], number: int) -> None:
        """Posts a trial, but not again where only the answer was lost with the connection."""
        tries = 0

        def tried() -> None:
            nonlocal tries
            tries += 1
            there = self.posted({number}).get(number) if tries > 1 else None
            if there is None or there.state == TrialState.FAIL:
                post()

        self._patiently(tried)

    def fail_silent(self) -> None:
        """Fails the trials of workers that show no sign of life any more."""
        before, self._looked = self._looked, time.time()
        if not 0.0 <= self._looked - before <= SIGNS_MISSED * self._heartbeat:  # this machine slept, or all of it did
            self._hear_first()
        if time.monotonic() < self._stale_from:
            return
        try:
            with _without_warnings():
                fail_stale_trials(self._study)
        except StorageInternalError:  # waited for by the next call, and then again
            self._hear_first()

    def _hear_first(self) -> None:
        """Nobody counts as dead before there was time to be heard: after an outage, and where the clock leapt."""
        self._stale_from = time.monotonic() + SIGNS_MISSED * self._heartbeat

    def posted(self, wanted: Container[int] | None = None) -> dict[int, Posted]:
        """What has become of those of the search's trials: where one was posted several times, the best of it.

        wanted: their numbers; None: of all.
        """
        found: dict[int, Posted] = {}
        for trial in self._patiently(lambda: self._study.get_trials(deepcopy=False)):
            number = trial.user_attrs.get(NUMBER)
            if number is not None and (wanted is None or number in wanted):
                posted = self._posted(trial)
                before = found.get(posted.number)
                if before is None or _rank(posted) >= _rank(before):
                    found[posted.number] = posted
        return found

    def finish(self) -> None:
        """Lets the workers end."""
        self._patiently(lambda: self._study.set_user_attr(FINISHED, True))

    # --- the worker's side -------------------------------------------------------------------------------------------

    @property
    def is_finished(self) -> bool:
        """Whether the search is over."""
        return bool(self._patiently(lambda: self._study.user_attrs).get(FINISHED))

    def claim(self) -> Posted | None:
        """A trial to evaluate, which is now this worker's; None where none waits."""
        waiting = self._patiently(lambda: self._study.get_trials(deepcopy=False, states=(TrialState.WAITING,)))
        for trial in sorted(waiting, key=lambda trial: trial.user_attrs.get(NUMBER, 0)):
            if BEGUN in trial.user_attrs and self._patiently(lambda place=trial.number: self._claimed(place)):
                return self._posted(trial)
        return None

    def _claimed(self, place: int) -> bool:
        id_ = self._id(place)
        # The sign of life first: a trial without any, of a worker that is killed at once, would never count as dead.
        self._database.record_heartbeat(id_)
        try:
            with self._claiming:
                return self._storage.set_trial_state_values(id_, TrialState.RUNNING)
        except UpdateFinishedTrialError:
            return False

    def living(self, posted: Posted) -> "Heartbeats":
        """Signs of life while a trial is evaluated; a context manager."""
        id_ = self._id(posted.place)
        return Heartbeats(lambda: self._database.record_heartbeat(id_), self._heartbeat)

    def tell(self, posted: Posted, judgement: Outcome, seconds: float) -> bool:
        """Writes a trial's values; False where they came too late, and others were told for it."""
        constraints = dict(zip(self._constraints, judgement.violations, strict=True))
        attributes: dict[str, Any] = {SECONDS: round(seconds, 6)}
        if judgement.failure:
            attributes[FAILURE] = writable(judgement.failure)
        return self._patiently(
            lambda: self._end(posted, TrialState.COMPLETE, attributes, judgement.values, constraints)
        )

    def fail(self, posted: Posted, why: str) -> bool:
        """Says why a trial has no values."""
        return self._patiently(lambda: self._end(posted, TrialState.FAIL, {ERROR: writable(why)}))

    def give_back(self, posted: Posted) -> bool:
        """Lets another worker evaluate it."""
        return self._patiently(lambda: self._end(posted, TrialState.FAIL, {GIVEN_BACK: True}))

    def _end(
        self,
        posted: Posted,
        state: TrialState,
        attributes: dict[str, Any],
        values: Sequence[float] | None = None,
        constraints: dict[str, float] | None = None,
    ) -> bool:
        id_ = self._id(posted.place)
        try:
            for name, value in attributes.items():
                self._storage.set_trial_user_attr(id_, name, value)
            for name, value in (constraints or {}).items():  # as Trial.set_constraint does, of a trial that is not here
                self._storage.set_trial_system_attr(id_, f"constraints:{name}", value)
            return self._storage.set_trial_state_values(id_, state, values)
        except UpdateFinishedTrialError:
            return False

    # --- both --------------------------------------------------------------------------------------------------------

    def _id(self, place: int) -> int:
        study = self._patiently(lambda: self._storage.get_study_id_from_name(self._name))
        return self._patiently(lambda: self._storage.get_trial_id_from_study_id_trial_number(study, place))

    def _posted(self, trial: FrozenTrial) -> Posted:
        told = trial.user_attrs
        judgement = None
        if trial.state == TrialState.COMPLETE:
            broken = tuple(float(trial.system_attrs[f"constraints:{name}"]) for name in self._constraints)
            judgement = Outcome(tuple(trial.values), broken, str(told.get(FAILURE, "")))
        return Posted(
            place=trial.number,
            number=told[NUMBER],
            state=trial.state,
            begun=told.get(BEGUN),
            judgement=judgement,
            seconds=float(told.get(SECONDS, 0.0)),
            error=str(told.get(ERROR, "")),
            is_given_back=GIVEN_BACK in told,
        )

    def _experimental(self, call: Callable[[], object]) -> None:
        """The same for what Optuna warns of."""
        with _without_warnings():
            self._patiently(call)

    def _patiently(self, call: Callable[[], Made]) -> Made:
        """What a call to the database gives; where it is away, the call is made again until it is back."""
        until = None
        while True:
            try:
                made = call()
            except StorageInternalError as fault:
                if not _is_passing(fault):
                    raise StorageError(f"the database cannot be used: {_cause(fault)}") from fault
                now = time.monotonic()
                if until is None:
                    until = now + OUTAGE
                    self._say(f"the database does not answer ({_cause(fault)}); trying again for {OUTAGE / 60:g} min")
                if now >= until:
                    raise StorageError(
                        f"the database has not answered for {OUTAGE / 60:g} min ({_cause(fault)}). What was evaluated "
                        "is safe there; the same command goes on"
                    ) from fault
                time.sleep(BETWEEN_TRIES)
            except KeyError as fault:  # Optuna's word for a study, or a trial of it, that is not there
                raise StorageError(
                    f"the database holds no study {self._name}, or not all of it; armwright optimize ... --workers N "
                    "begins it"
                ) from fault
            else:
                if until is not None:
                    self._say("the database answers again")
                    self._hear_first()
                return made


class Heartbeats:
    """A thread that shows that its process lives, until it is left."""

    def __init__(self, beat: Callable[[], None], interval: int) -> None:
        self._beat = beat
        self._interval = interval
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._go_on, name="armwright-heartbeat", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()

    def _go_on(self) -> None:
        while not self._over.wait(self._interval):
            try:
                self._beat()
            except Exception:  # noqa: BLE001 whatever it is, who evaluates will meet it, too
                continue  # the database is away; the next sign may reach it


def shown_url(url: str) -> str:
    """The URL of a database without its password; SettingsError where it is none."""
    from sqlalchemy import URL

    parsed = _parsed(url)
    query = {name: value for name, value in parsed.query.items() if "password" not in name.lower()}
    shown = URL.create(parsed.drivername, parsed.username, None, parsed.host, parsed.port, parsed.database, query)
    return shown.render_as_string()


def _parsed(url: str) -> "URL":
    """SettingsError, which does not repeat it, where it is none."""
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError

    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        parsed = None
    if parsed is None or "@" in (parsed.host or ""):  # the latter by an @ in a password
        raise SettingsError(
            '--storage: a URL such as "postgresql://user@host/database" is needed, with the password in PGPASSWORD or '
            "~/.pgpass; within the URL @ is %40, : is %3A, / is %2F"
        )
    return parsed


def sqlite_url(file: Path) -> str:
    """Of a database that is a file, for workers on the same machine."""
    from sqlalchemy import URL

    return URL.create("sqlite", database=str(file.resolve())).render_as_string()


def _sqlite_file(url: str) -> Path | None:
    parsed = _parsed(url)
    if not parsed.drivername.startswith("sqlite"):
        return None
    if not parsed.database or parsed.database == ":memory:":
        raise SettingsError("--storage: workers in other processes cannot see a database in memory")
    return Path(parsed.database)


def _storage(url: str, heartbeat: int) -> RDBStorage:
    from sqlalchemy.exc import ArgumentError, SQLAlchemyError

    file = _sqlite_file(url)
    if file is not None and not file.parent.is_dir():
        raise SettingsError(f"--storage: there is no folder {file.parent}")
    connecting = {} if file is None else {"timeout": SQLITE_TIMEOUT}
    try:
        with _without_warnings():
            storage = RDBStorage(
                _with_driver(url).replace("{", "{{").replace("}", "}}"),  # Optuna has a word of its own in braces
                engine_kwargs={"pool_pre_ping": True, "connect_args": connecting},
                heartbeat_interval=heartbeat,
                grace_period=SIGNS_MISSED * heartbeat,
            )
        if storage.engine.dialect.name == "postgresql":
            _keep_time_in_utc(storage.engine)
        return storage
    except ImportError as fault:
        raise MissingExtraError(
            f"{shown_url(url)} needs a driver ({fault.__cause__ or fault}): {command('distributed')} brings that of "
            "PostgreSQL"
        ) from fault
    except ArgumentError as fault:  # a kind of database that SQLAlchemy does not know
        raise SettingsError(f"--storage {shown_url(url)}: {_cause(fault)}") from fault
    except (SQLAlchemyError, StorageInternalError, RuntimeError) as fault:  # the last for tables of another Optuna
        raise StorageError(f"cannot use {shown_url(url)}: {_cause(fault)}") from fault


def _keep_time_in_utc(engine: "Engine") -> None:
    """Signs of life are written without a time zone: the end of summer time must not look like an hour of silence."""
    from sqlalchemy import event

    def begin(connection: Any, _record: object) -> None:
        with connection.cursor() as cursor:
            cursor.execute("SET TIME ZONE 'UTC'")
        connection.commit()

    event.listen(engine, "connect", begin)
    engine.dispose()  # what is connected already


@contextmanager
def _without_warnings() -> Generator[None]:
    """Of what Optuna still calls experimental: heartbeats since 2.9, metric names since 3.2."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        yield


def _with_driver(url: str) -> str:
    """The URL with the driver of PostgreSQL that the extra brings, where it names none; SQLAlchemy 2.0 has another."""
    name, separator, rest = url.partition("://")
    return f"postgresql+psycopg{separator}{rest}" if name in ("postgresql", "postgres") else url


def _without_marks(trial: FrozenTrial) -> FrozenTrial:
    """A failed trial, with nothing that only its worker said of it."""
    for name in (ERROR, GIVEN_BACK, FAILURE, SECONDS):
        trial.user_attrs.pop(name, None)
    trial.system_attrs = {
        name: value for name, value in trial.system_attrs.items() if not name.startswith("constraints:")
    }
    return trial


def _rank(posted: Posted) -> int:
    """Values before what may still come, and that before failures."""
    return {TrialState.COMPLETE: 2, TrialState.RUNNING: 1, TrialState.WAITING: 1}.get(posted.state, 0)


def _is_passing(fault: StorageInternalError) -> bool:
    """Whether to wait: not where the database is none, or not one of Optuna's; it may be away, locked or full."""
    from sqlalchemy.exc import DatabaseError, NotSupportedError, ProgrammingError

    return type(fault.__cause__) not in (DatabaseError, NotSupportedError, ProgrammingError)


def _cause(fault: BaseException) -> str:
    """What the database said, on one line."""
    words = " ".join(str(getattr(fault.__cause__ or fault, "orig", None) or fault.__cause__ or fault).split())
    return words[:200]
