"""The job store in one SQLite file with a write-ahead log: one process, one thread at a time writes.

SQLite itself waits for the disk only where it empties the log into the file. What is to be durable is synced here after
its commit, while others write already: one wait for the disk may serve several of them.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sqlite3
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from inverse_service.service.jobs import locks, model, statements
from inverse_service.service.jobs.store import JobStore, writing

T = TypeVar("T")
sqlite3.register_adapter(list, json.dumps)  # as AMONG reads it, see `statements`
PAGES_AT_ONCE, PAGES_KEPT = 256, 2048
# Bytes of the disk without which a question and its answer may not find room.
LEAST_FREE = 256 * 1024
# Larger files are not rewritten at the start to give space back later; see docs/how-to/operate.md.
REWRITTEN = 256 * 2**20
SYNC = getattr(os, "fdatasync", os.fsync)  # macOS has no fdatasync
OWN_TABLES = {"jobs", "bodies", "events", "batches", "lines", "counters"}


def connect(path: str, read_only: bool = False) -> sqlite3.Connection:
    """A connection in autocommit mode; transactions are begun by hand."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=30.0)
    connection.row_factory = sqlite3.Row
    connection.create_function("moment", 0, time.time)
    connection.create_function("today", 0, lambda: int(time.time() // 86_400))
    if read_only:
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
    connection.executescript(f"BEGIN IMMEDIATE; {script} PRAGMA user_version = {statements.VERSION}; COMMIT;")
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
    """Raises sqlite3.DatabaseError for a database of another program, or one that is damaged at its root."""
    tables = {row["name"] for row in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
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
    """See `store.JobStore`. Raises DatabaseTaken where another process has this file.

    `durable=False` leaves out the fsync, for a store that is deleted at the end. `guest`: an operator's command, which
    runs no jobs and so may come in while a service has the file.
    """

    exclusive = True
    # A power failure that takes an answer takes the service and its streams too; the job is accepted, and runs again.
    finish = writing(statements.finish, durable=False)

    def __init__(self, path: Path, durable: bool = True, guest: bool = False) -> None:
        super().__init__()
        self.address = str(path)
        self._durable, self._is_guest = durable, guest
        self._turn, self._writing, self._guard = threading.Lock(), threading.Lock(), threading.Lock()
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

    @property
    def is_busy(self) -> bool:
        return self._writing.locked()

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        row = self._read(lambda session: session.first("place_of_body", id))
        if row is None:
            return 0, b""
        with self._reader().blobopen("bodies", "body", row["rowid"], readonly=True) as blob:
            blob.seek(min(offset, len(blob)))
            return len(blob), blob.read(size)

    def try_to_write(self) -> None:
        if shutil.disk_usage(Path(self.address).parent).free < LEAST_FREE:
            raise model.StoreUnavailable("The disk of the database is nearly full, so that no question can be stored.")
        super().try_to_write()

    def prune(self, oldest: float, largest: int) -> int:
        forgotten = super().prune(oldest, largest)
        while self._write(_give_back, durable=False):
            pass
        return forgotten

    def erase_client(self, client: str) -> int:
        """Also what SQLite would leave in its files: pages that are free already are wiped where no service runs."""
        forgotten = super().erase_client(client)
        with contextlib.closing(connect(self.address)) as connection, contextlib.suppress(model.DatabaseTaken):
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            with locks.alone(Path(self.address)) if self._is_guest else contextlib.nullcontext():
                connection.execute("VACUUM")
        return forgotten

    def close(self) -> None:
        with self._writing, self._guard:
            self._opened.close()

    def _read(self, function: Callable[[statements.Session], T]) -> T:
        return function(statements.Session(self._reader(), [], statements.SQLITE))

    def _write(self, change: Callable[[statements.Session], T], durable: bool = True) -> T:
        told = list[model.Change]()
        with self._turn:  # or one with many changes in a row would go before all others
            self._writing.acquire()
        try:
            with self._connection:  # committed at the end, undone where anything is raised
                self._connection.execute("BEGIN IMMEDIATE")
                value = change(statements.Session(self._connection, told, statements.SQLITE))
        finally:
            self._writing.release()
        if durable and self._durable:
            SYNC(self._log)
        self.tell(told)
        return value

    def _used_bytes(self) -> int:
        """Pages set free are used again, or given back, and do not count."""
        reader = self._reader()
        return (_number(reader, "page_count") - _number(reader, "freelist_count")) * _number(reader, "page_size")

    def _reader(self) -> sqlite3.Connection:
        """A connection for reading of this thread's own."""
        found: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if found is None:
            found = self._local.connection = connect(self.address, read_only=True)
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
