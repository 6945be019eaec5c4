"""Tables of the SQLite store, and how those of older versions become these.

`order_number` grows with every answer; AUTOINCREMENT never reuses one. `askers` says which clients wait for an open
job beside batches; one that is `gone` cancelled it for itself.
"""

from __future__ import annotations

import sqlite3

from inverse_service.service.jobs.model import WrongVersion

VERSION = 2
SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    document TEXT NOT NULL,
    options TEXT NOT NULL,
    status TEXT NOT NULL,
    client TEXT NOT NULL,
    priority INTEGER NOT NULL,
    created REAL NOT NULL,
    started REAL,
    finished REAL,
    attempt INTEGER NOT NULL DEFAULT 0,
    crashes INTEGER NOT NULL DEFAULT 0,
    restarts INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    owner TEXT,
    heartbeat REAL,
    order_number INTEGER,
    expires REAL,
    wall REAL NOT NULL DEFAULT 0,
    cpu REAL NOT NULL DEFAULT 0,
    memory REAL NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX IF NOT EXISTS jobs_next ON jobs (client, priority, sequence) WHERE status = 'accepted';
CREATE INDEX IF NOT EXISTS jobs_open ON jobs (client, status) WHERE status IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_finished ON jobs (finished) WHERE status NOT IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_status ON jobs (status, sequence);
CREATE TABLE IF NOT EXISTS bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body BLOB NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS events (
    id TEXT NOT NULL, number INTEGER NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL,
    PRIMARY KEY (id, number)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created REAL NOT NULL, total INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem BLOB,
    order_number INTEGER, dismissed INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (batch, number)
) STRICT, WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
CREATE INDEX IF NOT EXISTS batches_created ON batches (created);
CREATE TABLE IF NOT EXISTS askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT;
INSERT OR IGNORE INTO counters VALUES ('order', 0);
"""


# What makes the tables of one version those of the next.
MIGRATIONS = {
    1: """
    ALTER TABLE jobs ADD COLUMN expires REAL;
    ALTER TABLE lines ADD COLUMN dismissed INTEGER NOT NULL DEFAULT 0;
    DROP INDEX jobs_waiting;
    CREATE TABLE askers (
        job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
    ) STRICT, WITHOUT ROWID;
    INSERT INTO askers SELECT id, client, 0 FROM jobs WHERE status IN ('accepted', 'running') AND priority < 10;
    UPDATE lines SET dismissed = 1 WHERE job IN (SELECT id FROM jobs WHERE status = 'dismissed');
    """,
}
# Larger files are not rewritten at the start to give space back later; s. docs/operating.md.
REWRITTEN = 256 * 2**20


def connect(path: str, read_only: bool = False) -> sqlite3.Connection:
    """A connection in autocommit mode; transactions are begun by hand."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=30.0)
    connection.row_factory = sqlite3.Row
    if read_only:
        connection.execute("PRAGMA query_only = 1")
    return connection


def prepare(connection: sqlite3.Connection) -> None:
    """Write-ahead log, tables, those of an older version brought to this one; all of it or nothing.

    Raises WrongVersion for a newer one, sqlite3.DatabaseError for a file that is no such database.
    """
    found = _number(connection, "user_version")
    if not 0 <= found <= VERSION:
        raise WrongVersion(found, VERSION)
    _refuse_other_tables(connection, found)
    connection.execute("PRAGMA auto_vacuum = INCREMENTAL")  # heard by a new file, and by VACUUM
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute(f"PRAGMA journal_size_limit = {REWRITTEN // 4}")
    script = "".join(MIGRATIONS[version] for version in range(found or VERSION, VERSION))
    connection.executescript(f"BEGIN IMMEDIATE; {script} {SCHEMA} PRAGMA user_version = {VERSION}; COMMIT;")
    is_small = _number(connection, "page_count") * _number(connection, "page_size") < REWRITTEN
    if _number(connection, "auto_vacuum") == 0 and is_small:
        connection.execute("VACUUM")


def _refuse_other_tables(connection: sqlite3.Connection, version: int) -> None:
    """Raises sqlite3.DatabaseError for a database of another program, or one that is damaged at its root."""
    tables = {row["name"] for row in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
    if version and not tables >= {"jobs", "bodies", "events", "batches", "lines", "counters"}:
        raise sqlite3.DatabaseError("tables are missing")
    if not version and tables - {"sqlite_sequence"}:
        raise sqlite3.DatabaseError("the tables are those of another program")


def _number(connection: sqlite3.Connection, name: str) -> int:
    return int(connection.execute(f"PRAGMA {name}").fetchone()[0])
