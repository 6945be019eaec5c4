"""The job store: what every one does (`JobStore`), the default one in an SQLite file, and what
forgets old answers.

All methods block, may be called from any thread, and return after their change is durable unless
they say otherwise. A store is the truth: whatever else dies, an accepted job is in it. The one in
PostgreSQL is an extra (`postgres_store`).

The SQLite file has a write-ahead log: one process, one thread at a time writes. SQLite itself waits
for the disk only where it empties the log into the file. What is to be durable is synced here after
its commit, while others write already: one wait for the disk may serve several of them.
"""

from __future__ import annotations

import contextlib
import functools
import json
import logging
import os
import shutil
import sqlite3
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import ClassVar, Concatenate, ParamSpec, TypeVar

from inverse_service.service.jobs import locks, model, statements

P = ParamSpec("P")
T = TypeVar("T")
# Rows that are forgotten in one step, which takes some milliseconds; jobs that are looked at to
# find the oldest.
STEP, OLDEST = 50, 100
log = logging.getLogger(__name__)
# A clock that went forward by more than this since the last look, or since the newest job, is not
# believed for a day.
JUMP, DISTRUST = 86_400.0, 86_400.0
sqlite3.register_adapter(list, json.dumps)  # as AMONG reads it, see `statements`
PAGES_AT_ONCE, PAGES_KEPT = 256, 2048
# Bytes of the disk without which a question and its answer may not find room.
LEAST_FREE = 256 * 1024
# Larger files are not rewritten at the start to give space back later; see docs/how-to/operate.md.
REWRITTEN = 256 * 2**20
SYNC = getattr(os, "fdatasync", os.fsync)  # macOS has no fdatasync
OWN_TABLES = {"jobs", "bodies", "events", "batches", "lines", "counters"}


def _reading(
    statement: Callable[Concatenate[statements.Session, P], T],
) -> Callable[Concatenate[JobStore, P], T]:
    """The method that looks at the store by this statement."""

    @functools.wraps(statement)
    def read(self: JobStore, /, *arguments: P.args, **named: P.kwargs) -> T:
        return self._read(lambda session: statement(session, *arguments, **named))

    return read


class Durability(Enum):
    """What has happened when a change returns."""

    SYNCED = "it outlives a power failure"
    LATER = "it outlives a process, and a power failure only after the next change that is synced"


def writing(
    statement: Callable[Concatenate[statements.Session, P], T],
    durability: Durability = Durability.SYNCED,
) -> Callable[Concatenate[JobStore, P], T]:
    """The method that changes the store by this statement."""

    @functools.wraps(statement)
    def write(self: JobStore, /, *arguments: P.args, **named: P.kwargs) -> T:
        return self.write_change(
            lambda session: statement(session, *arguments, **named), durability
        )

    return write


class JobStore(ABC):
    """Jobs, their events, and batches of them; `statements` says what each method does."""

    # Whether one process alone has the store; else claims are looked for by polling.
    exclusive: ClassVar[bool]
    # Lines of a batch that are stored in one transaction; others write between two of them.
    step: ClassVar[int] = statements.STEP
    # Where `stored_answer` reads the same store from another process.
    address: str

    def __init__(self) -> None:
        self._listeners: list[Callable[[model.Change], None]] = []

    @abstractmethod
    def _read(self, function: Callable[[statements.Session], T]) -> T:
        """Look at the store."""

    @abstractmethod
    def write_change(
        self, change: Callable[[statements.Session], T], durability: Durability = Durability.SYNCED
    ) -> T:
        """Change it in one transaction, and tell of the jobs that changed."""

    @abstractmethod
    def _used_bytes(self) -> int:
        """Bytes that forgetting can make fewer."""

    def on_change(self, listener: Callable[[model.Change], None]) -> None:
        """Call the listener with each change."""
        self._listeners.append(listener)

    def listen(self) -> None:  # noqa: B027 - of one process alone nobody else changes the store
        """From now on tell the listeners too what other processes change."""

    @property
    def hears_others(self) -> bool:
        """Whether that is told at once now."""
        return False

    def tell(self, changes: Sequence[model.Change]) -> None:
        """Call the listeners."""
        for change in changes:
            for listener in self._listeners:
                listener(change)

    @abstractmethod
    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        """The length of the body of a job's answer, 0 where there is none, and so many bytes of
        it.
        """

    def size(self) -> int:
        """The bytes that the database takes."""
        return self._used_bytes()

    def try_to_write(self) -> None:
        """Write something small and durable, and read every column; raises what the database
        says.
        """
        self._read(lambda s: s.rows("columns"))
        self.write_change(lambda s: s.run("probe"))

    @abstractmethod
    def close(self) -> None:
        """Give the store up; nothing that was acknowledged is lost."""

    submit = writing(statements.submit)
    submit_one = writing(statements.submit_one)
    submit_together = writing(statements.submit_together)
    open_by_client = _reading(statements.open_by_client)
    over_quota = _reading(statements.over_quota)
    claim = writing(statements.claim, Durability.LATER)
    heartbeat = writing(statements.heartbeat, Durability.LATER)
    finish = writing(statements.finish)
    release = writing(statements.release)
    release_crashed = writing(statements.release_crashed)
    dismiss = writing(statements.dismiss)
    recover = writing(statements.recover)
    add_events = writing(statements.add_events, Durability.LATER)
    job = _reading(statements.read_job)
    jobs = _reading(statements.list_jobs)
    events = _reading(statements.read_events)
    counts = _reading(statements.counts)
    is_waiting = _reading(statements.is_waiting)
    oldest = _reading(statements.oldest)
    used_today = _reading(statements.used_today)
    claim_key = writing(statements.claim_key, Durability.LATER)
    begin_batch = writing(statements.begin_batch, Durability.LATER)
    add_lines = writing(statements.add_lines, Durability.LATER)
    send_batch = writing(statements.send_batch)
    take_sent = writing(statements.take_sent, Durability.LATER)
    free_sent = writing(statements.free_sent, Durability.LATER)
    add_sent_lines = writing(statements.add_sent_lines, Durability.LATER)
    batch = _reading(statements.read_batch)
    batches = _reading(statements.list_batches)
    repeated = _reading(statements.repeated)
    batch_answers = _reading(statements.answers)

    def create_batch(
        self, id: str, kind: str, client: str, lines: Sequence[model.BatchLine],
        bounds: model.Bounds = statements.NO_BOUNDS,
    ) -> model.Batch:  # fmt: skip
        """Store the batch and the jobs of its lines, all or nothing; one of this id stays as it is.

        In small transactions, between which others are served. One that a death of the service left
        incomplete is unseen, and goes on where it is sent again.
        """
        if (found := self.batch(id)) is not None:
            return found
        asked = [line.request for line in lines if line.request is not None]
        self._read(lambda s: statements.refuse_without_room(s, asked, bounds))
        self.begin_batch(id, kind, client)
        try:
            for place in range(0, len(lines), self.step):
                self.add_lines(id, lines[place : place + self.step], bounds)
        except model.TooManyJobs:  # others were faster
            self.dismiss_batch(id)
            self.write_change(lambda s: statements.forget_batch(s, id))
            raise
        return self.write_change(lambda s: statements.complete_batch(s, id, len(lines)))

    def dismiss_batch(self, id: str) -> list[str]:
        """Dismiss the open lines of the batch; the ids of their jobs that nobody else waits for,
        which stop.

        In small transactions, as they are stored.
        """
        self.write_change(lambda s: statements.leave_sent(s, id))
        over, left = list[str](), 1
        while left:
            left, some = self.write_change(lambda s: statements.leave_some(s, id))
            over += some
        return over

    def prune(self, oldest: float, largest: int) -> int:
        """Forget jobs and batches finished before the time `oldest`, then the oldest until the
        store has at most `largest` bytes; how many jobs were forgotten. Open ones always stay.
        In small transactions, between which others are served; free space goes back to the disk."""
        forgotten = 0
        while (step := self._forget(oldest))[0]:
            forgotten += step[1]
        while self._used_bytes() > largest:
            moment = self._read(lambda s: statements.oldest_moment(s, OLDEST))
            step = (0, 0) if moment is None else self._forget(moment)
            if not step[0]:
                break
            forgotten += step[1]
        return forgotten

    def _forget(self, before: float) -> tuple[int, int]:
        return self.write_change(lambda s: statements.forget(s, before, STEP), Durability.LATER)

    secret = writing(statements.secret)
    # What follows is for an operator; a service that runs over the same store hears of it within
    # seconds.
    is_drained = _reading(statements.is_drained)
    drain = writing(statements.drain)
    clients = _reading(statements.clients)
    rank_client = writing(statements.rank_client)
    prioritise_batch = writing(statements.prioritise_batch)

    def dismiss_client(self, client: str) -> list[str]:
        """Dismiss whatever is open for a client; the ids of the jobs that nobody else waits for,
        which stop.
        """
        own = self._read(lambda s: s.rows("batches_of_client", client))
        ended = [id for batch in own for id in self.dismiss_batch(batch["id"])]
        return ended + self.write_change(lambda s: statements.leave_all(s, client))

    def erase_client(self, client: str) -> int:
        """Forget all jobs, answers and batches of a client that no other one asked for; how many
        jobs.
        """
        self.dismiss_client(client)
        return self.write_change(lambda s: statements.erase_client(s, client))


def connect(path: str) -> sqlite3.Connection:
    """A connection in autocommit mode; transactions are begun by hand."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=30.0)
    connection.row_factory = sqlite3.Row
    connection.create_function("moment", 0, time.time)
    connection.create_function("today", 0, lambda: int(time.time() // 86_400))
    return connection


def connect_read_only(path: str) -> sqlite3.Connection:
    """The same, which refuses to write."""
    connection = connect(path)
    connection.execute("PRAGMA query_only = 1")
    return connection


class Damaged(sqlite3.DatabaseError):
    """A database of this program that cannot be worked with."""


def prepare(connection: sqlite3.Connection) -> None:
    """Write-ahead log, tables, those of an older version brought to this one; all of it or nothing.

    Raises WrongVersion for a newer one, sqlite3.DatabaseError for a file that is no such database.
    """
    found = _number(connection, "user_version")
    script = statements.script(found, statements.SQLITE)
    _refuse_other_tables(connection, found)
    is_small = _number(connection, "page_count") * _number(connection, "page_size") < REWRITTEN
    if is_small and connection.execute("PRAGMA quick_check(1)").fetchone()[0] != "ok":
        raise Damaged("it is damaged; put a backup in its place")
    connection.execute("PRAGMA auto_vacuum = INCREMENTAL")  # heard by a new file, and by VACUUM
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute(f"PRAGMA journal_size_limit = {REWRITTEN // 4}")
    connection.executescript(
        f"BEGIN IMMEDIATE; {script} PRAGMA user_version = {statements.VERSION}; COMMIT;"
    )
    with contextlib.closing(connect(":memory:")) as fresh:
        fresh.executescript(statements.script(0, statements.SQLITE))
        if missing := _columns(fresh) - _columns(connection):
            raise Damaged(f"it lacks {' '.join(min(missing))}; put a backup in its place")
    if _number(connection, "auto_vacuum") == 0 and is_small:
        connection.execute("VACUUM")


def _refuse_other_version(connection: sqlite3.Connection) -> None:
    """A service that runs over the file has it as it is. Raises WrongVersion."""
    if (found := _number(connection, "user_version")) != statements.VERSION:
        raise model.WrongVersion(found, statements.VERSION)


def _refuse_other_tables(connection: sqlite3.Connection, version: int) -> None:
    """Raises sqlite3.DatabaseError for a database of another program, or one that is damaged at its
    root.
    """
    tables = {
        row["name"]
        for row in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")
    }
    if version and not tables >= OWN_TABLES:
        raise sqlite3.DatabaseError("tables are missing")
    if not version and tables - {"sqlite_sequence"}:
        raise sqlite3.DatabaseError("the tables are those of another program")


def _columns(connection: sqlite3.Connection) -> set[tuple[str, str]]:
    """All (table, column)."""
    query = "SELECT t.name, c.name FROM sqlite_schema AS t, pragma_table_info(t.name) AS c WHERE t.type = 'table'"
    return {(row[0], row[1]) for row in connection.execute(query) if row[0] != "sqlite_sequence"}


def _number(connection: sqlite3.Connection, name: str) -> int:
    """A number that SQLite tells of its file."""
    return int(connection.execute(f"PRAGMA {name}").fetchone()[0])


class SqliteStore(JobStore):
    """See `stores.JobStore`. Raises DatabaseTaken where another process has this file.

    `Durability.LATER` leaves out the fsync, for a store that is deleted at the end. `guest`: an
    operator's command, which runs no jobs and so may come in while a service has the file.
    """

    exclusive = True
    # A power failure that takes an answer takes the service and its streams too; the job is
    # accepted, and runs again.
    finish = writing(statements.finish, Durability.LATER)

    def __init__(
        self, path: Path, durability: Durability = Durability.SYNCED, guest: bool = False
    ) -> None:
        super().__init__()
        self.address = str(path)
        self._durability, self._is_guest = durability, guest
        self._turn, self._writing, self._guard = (
            threading.Lock(),
            threading.Lock(),
            threading.Lock(),
        )
        self._local = threading.local()
        with contextlib.ExitStack() as opened:
            if not guest:
                opened.enter_context(locks.alone(path))
            self._connection = opened.enter_context(contextlib.closing(connect(self.address)))
            (_refuse_other_version if guest else prepare)(self._connection)
            self._connection.execute("PRAGMA synchronous = NORMAL")
            self._log = os.open(f"{path}-wal", os.O_RDONLY)
            opened.callback(os.close, self._log)
            if guest:
                self._connection.execute("PRAGMA secure_delete = ON")
            # All that is closed with the store.
            self._opened = opened.pop_all()

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        row = self._read(lambda session: session.first("place_of_body", id))
        if row is None:
            return 0, b""
        with self._reader().blobopen("bodies", "body", row["rowid"], readonly=True) as blob:
            blob.seek(min(offset, len(blob)))
            return len(blob), blob.read(size)

    def try_to_write(self) -> None:
        if shutil.disk_usage(Path(self.address).parent).free < LEAST_FREE:
            raise model.StoreUnavailable(
                "The disk of the database is nearly full, so that no question can be stored."
            )
        super().try_to_write()

    def prune(self, oldest: float, largest: int) -> int:
        forgotten = super().prune(oldest, largest)
        while self.write_change(_give_back, Durability.LATER):
            pass
        return forgotten

    def erase_client(self, client: str) -> int:
        """Also what SQLite would leave in its files: pages that are free already are wiped where no
        service runs.
        """
        forgotten = super().erase_client(client)
        with (
            contextlib.closing(connect(self.address)) as connection,
            contextlib.suppress(model.DatabaseTaken),
        ):
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            with locks.alone(Path(self.address)) if self._is_guest else contextlib.nullcontext():
                connection.execute("VACUUM")
        return forgotten

    def close(self) -> None:
        with self._writing, self._guard:
            self._opened.close()

    def _read(self, function: Callable[[statements.Session], T]) -> T:
        return function(statements.Session(self._reader(), [], statements.SQLITE))

    def write_change(
        self, change: Callable[[statements.Session], T], durability: Durability = Durability.SYNCED
    ) -> T:
        told = list[model.Change]()
        with self._turn:  # or one with many changes in a row would go before all others
            self._writing.acquire()
        try:
            with self._connection:  # committed at the end, undone where anything is raised
                self._connection.execute("BEGIN IMMEDIATE")
                value = change(statements.Session(self._connection, told, statements.SQLITE))
        finally:
            self._writing.release()
        if durability is self._durability is Durability.SYNCED:
            SYNC(self._log)
        self.tell(told)
        return value

    def _used_bytes(self) -> int:
        """Pages set free are used again, or given back, and do not count."""
        reader = self._reader()
        return (_number(reader, "page_count") - _number(reader, "freelist_count")) * _number(
            reader, "page_size"
        )

    def _reader(self) -> sqlite3.Connection:
        """A connection for reading of this thread's own."""
        found: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if found is None:
            found = self._local.connection = connect_read_only(self.address)
            with self._guard:
                self._opened.callback(found.close)
        return found


def _give_back(session: statements.Session) -> bool:
    """Give some free pages back to the disk; whether many are left."""
    connection = session.connection
    if _number(connection, "auto_vacuum") == 0:
        return False
    connection.execute(f"PRAGMA incremental_vacuum({PAGES_AT_ONCE})").fetchall()
    return _number(connection, "freelist_count") > PAGES_KEPT


class Cleaner:
    """Prunes the store to answers younger than `age` s and at most `size` bytes, each time it is
    asked to.
    """

    def __init__(self, store: JobStore, age: float, size: int) -> None:
        self._store, self._age, self._size = store, age, size
        self._offset = time.time() - time.monotonic()
        self._believed = 0.0

    def clean(self) -> None:
        """Forget what is old or too much; a store that is away may be back the next time."""
        try:
            if forgotten := self._store.prune(self.oldest_kept(), self._size):
                log.info("old jobs forgotten", extra={"jobs": forgotten})
        except Exception:
            log.exception("old jobs could not be forgotten")

    def oldest_kept(self) -> float:
        """What ended before is forgotten: nothing by its age while the clock may be wrong."""
        newest, _ = self._store.jobs(limit=1)
        offset, self._offset = self._offset, time.time() - time.monotonic()
        is_first = self._believed == 0.0
        jumped = self._offset - offset > JUMP or (
            is_first and any(time.time() - job.created > JUMP for job in newest)
        )
        if jumped:
            log.warning(
                "the clock went forward, or nothing was asked for a day: nothing is forgotten by age for a day"
            )
        if jumped or is_first:
            self._believed = time.monotonic() + (DISTRUST if jumped else 0.0)
        return time.time() - self._age if time.monotonic() >= self._believed else 0.0
