"""Tables of the SQLite store. `order_number` grows with every answer; AUTOINCREMENT never reuses one."""

from __future__ import annotations

import sqlite3

VERSION = 1
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
    wall REAL NOT NULL DEFAULT 0,
    cpu REAL NOT NULL DEFAULT 0,
    memory REAL NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX IF NOT EXISTS jobs_waiting ON jobs (priority, sequence) WHERE status = 'accepted';
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
    order_number INTEGER,
    PRIMARY KEY (batch, number)
) STRICT, WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT;
INSERT OR IGNORE INTO counters VALUES ('order', 0);
"""


def connect(path: str, read_only: bool = False) -> sqlite3.Connection:
    """A connection in autocommit mode; transactions are begun by hand."""
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=30.0)
    connection.row_factory = sqlite3.Row
    if read_only:
        connection.execute("PRAGMA query_only = 1")
    return connection


def prepare(connection: sqlite3.Connection) -> None:
    """Write-ahead log, tables; raises sqlite3.DatabaseError for a file that is no such database."""
    connection.execute("PRAGMA journal_mode = WAL")
    found = connection.execute("PRAGMA user_version").fetchone()[0]
    if found not in (0, VERSION):
        raise sqlite3.DatabaseError(f"the database has version {found}, this program knows {VERSION}")
    connection.executescript(SCHEMA)
    connection.execute(f"PRAGMA user_version = {VERSION}")
