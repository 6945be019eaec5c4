"""The job store in PostgreSQL: several front ends, each with its own supervisor, share one.

Times are those of the database server, whose clock all front ends share. What another front end did
is heard (`announcements`); for what gets lost, who waits for it looks again (`engine.LOOK_AGAIN`),
and so does who runs a job (`supervisor.HEARTBEAT`).
"""

import contextlib
import queue
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import psycopg
from psycopg.rows import dict_row

from inverse_service import errors
from inverse_service.service.jobs import announcements, model, statements, stores

T = TypeVar("T")
Row = dict[str, Any]
Connection = psycopg.Connection[Row]
# Two front ends that start at the same time create the tables one after the other.
CREATE_LOCK = 7_204_021_101
MOST = 8
# A server that is started again is back within this time (s); what waits for it does not fail.
PATIENCE = 15.0
CONNECT_TIMEOUT = 10
LOST = (psycopg.OperationalError, psycopg.InterfaceError)
CONFLICT = (psycopg.errors.DeadlockDetected, psycopg.errors.SerializationFailure)


def connect(address: str) -> Connection:
    """A connection in autocommit mode that sees our schema; raises psycopg.OperationalError."""
    connection = psycopg.connect(
        address, autocommit=True, row_factory=dict_row, connect_timeout=CONNECT_TIMEOUT,
        application_name="inverse-service", keepalives_idle=30, keepalives_interval=10, keepalives_count=3,
    )  # fmt: skip
    connection.execute("SET search_path TO inverse_service")
    return connection


def prepare(connection: Connection) -> None:
    """Make the tables that are missing, bring those of an older version to this one, all in one
    transaction.

    Raises WrongVersion for a newer one.
    """
    with connection.transaction():
        connection.execute("SELECT pg_advisory_xact_lock(%s)", (CREATE_LOCK,))
        connection.execute("CREATE SCHEMA IF NOT EXISTS inverse_service")
        connection.execute("SET LOCAL search_path TO inverse_service")
        connection.execute("CREATE TABLE IF NOT EXISTS versions (version INTEGER PRIMARY KEY)")
        row = connection.execute("SELECT max(version) AS version FROM versions").fetchone()
        script = statements.script(0 if row is None else row["version"] or 0, statements.POSTGRES)
        connection.execute(script.encode())
        connection.execute("DELETE FROM versions")
        connection.execute("INSERT INTO versions VALUES (%s)", (statements.VERSION,))


class PostgresStore(stores.JobStore):
    """See `stores.JobStore`. Raises InputError where the database cannot be used, StoreUnavailable
    later.
    """

    exclusive = False
    step = 1_000

    def __init__(self, address: str) -> None:
        super().__init__()
        try:
            self.address = address
            first = connect(address)
            prepare(first)
        except (psycopg.Error, model.WrongVersion, UnicodeError) as error:
            name, text = (
                type(error).__name__,
                str(error).strip().partition("\n")[0][:300].rstrip("."),
            )
            is_said = isinstance(error, psycopg.OperationalError | model.WrongVersion)
            reason = text if is_said else f"wrong address or rights ({name})"
            detail = (
                f"The PostgreSQL database of INVERSE_SERVICE_DATABASE cannot be used: {reason}."
            )
            raise errors.InputError(detail) from None
        # A place for each connection there may be; a thread has one for the time of one
        # transaction.
        self._places: queue.LifoQueue[Connection | None] = queue.LifoQueue()
        for place in [*[None] * (MOST - 1), first]:
            self._places.put(place)
        self._closed = False
        self._others = announcements.Announcements(
            lambda texts: self.write_change(
                lambda s: s.run("announce", texts), stores.Durability.LATER
            ),
            lambda: connect(self.address),
        )

    def listen(self) -> None:
        self._others.listen(super().tell)

    @property
    def hears_others(self) -> bool:
        return self._others.is_heard

    def tell(self, changes: Sequence[model.Change]) -> None:
        super().tell(changes)
        self._others.tell(changes)

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        row = self._read(lambda session: session.first("part", offset + 1, size, id))
        return (row["size"], bytes(row["part"])) if row else (0, b"")

    def size(self) -> int:
        return int(self._read(lambda session: session.first("database_size"))["size"])

    def close(self) -> None:
        self._others.close()
        self._closed = True
        free = list[Connection | None]()
        with contextlib.suppress(queue.Empty):  # those that are out are closed when they come back
            while True:
                free.append(self._places.get_nowait())
        for connection in free:
            self._places.put(self._closing(connection))

    def _read(self, function: Callable[[statements.Session], T]) -> T:
        return self._insist(
            lambda connection: function(statements.Session(connection, [], statements.POSTGRES))
        )

    def write_change(
        self,
        change: Callable[[statements.Session], T],
        durability: stores.Durability = stores.Durability.SYNCED,
    ) -> T:
        def transaction(connection: Connection) -> tuple[T, list[model.Change]]:
            session = statements.Session(connection, [], statements.POSTGRES)
            # In a pipeline, statements whose rows nobody waits for cost no way to the server and
            # back.
            with connection.pipeline(), connection.transaction():
                if durability is stores.Durability.LATER:
                    connection.execute("SET LOCAL synchronous_commit TO off")
                return change(session), session.told

        value, told = self._insist(transaction)
        self.tell(told)
        return value

    def submit_together(
        self, requests: Sequence[model.JobRequest], owner: str, begin: int
    ) -> list[model.Job]:
        """One statement, which is its own transaction: half the time of a pipeline with BEGIN and
        COMMIT.
        """

        def insert(connection: Connection) -> tuple[list[model.Job], list[model.Change]]:
            session = statements.Session(connection, [], statements.POSTGRES)
            return statements.submit_together(session, requests, owner, begin), session.told

        jobs, told = self._insist(insert)
        self.tell(told)
        return jobs

    def _insist(self, function: Callable[[Connection], T]) -> T:
        """Run it on a connection, again where that broke, so it must bear that a first run was
        committed.

        Raises what it raises, with everything undone; StoreUnavailable where the server stays away.
        """
        end, pause = time.monotonic() + PATIENCE, 0.02
        while True:
            connection = self._places.get()
            try:
                if self._closed:
                    raise model.StoreUnavailable("The store is closed.")
                connection = connection or connect(self.address)
                return function(connection)
            except (*LOST, *CONFLICT) as error:
                if self._closed or time.monotonic() + pause > end:
                    raise model.StoreUnavailable(
                        f"The database does not answer ({type(error).__name__})."
                    ) from error
            finally:
                self._places.put(self._closing(connection))
            time.sleep(pause)
            pause = min(1.0, 2 * pause)

    def _closing(self, connection: Connection | None) -> Connection | None:
        """The connection; closed, and None, where it is of no use any more."""
        if connection is not None and (connection.closed or connection.broken or self._closed):
            connection.close()
            return None
        return connection

    def _used_bytes(self) -> int:
        return int(self._read(lambda session: session.first("used_bytes"))["size"])
