"""Tables of the PostgreSQL store, in a schema of their own, and how those of older versions become these.

`answers` of a batch numbers its answers. Whoever takes a number holds the row until its commit, so
numbers become visible in their order and a reader that asks for those above its last misses none.
"""

from __future__ import annotations

from typing import Any

from inverse_service.service.jobs.model import WrongVersion

VERSION = 2
# Two front ends that start at the same time create the tables one after the other.
CREATE_LOCK = 7_204_021_101
SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    sequence BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    document TEXT NOT NULL,
    options TEXT NOT NULL,
    status TEXT NOT NULL,
    client TEXT NOT NULL,
    priority INTEGER NOT NULL,
    created DOUBLE PRECISION NOT NULL,
    started DOUBLE PRECISION,
    finished DOUBLE PRECISION,
    attempt INTEGER NOT NULL DEFAULT 0,
    crashes INTEGER NOT NULL DEFAULT 0,
    restarts INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    owner TEXT,
    heartbeat DOUBLE PRECISION,
    expires DOUBLE PRECISION,
    wall DOUBLE PRECISION NOT NULL DEFAULT 0,
    cpu DOUBLE PRECISION NOT NULL DEFAULT 0,
    memory DOUBLE PRECISION NOT NULL DEFAULT 0
);
CREATE INDEX IF NOT EXISTS jobs_next ON jobs (client, priority, sequence) WHERE status = 'accepted';
CREATE INDEX IF NOT EXISTS jobs_open ON jobs (client, status) WHERE status IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_finished ON jobs (finished) WHERE status NOT IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_status ON jobs (status, sequence);
CREATE TABLE IF NOT EXISTS bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body BYTEA NOT NULL);
CREATE TABLE IF NOT EXISTS events (
    id TEXT NOT NULL, number BIGINT NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (id, number)
);
CREATE TABLE IF NOT EXISTS batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created DOUBLE PRECISION NOT NULL,
    total INTEGER NOT NULL, answers INTEGER NOT NULL DEFAULT 0
);
CREATE TABLE IF NOT EXISTS lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem BYTEA,
    order_number INTEGER, dismissed INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (batch, number)
);
CREATE INDEX IF NOT EXISTS batches_created ON batches (created);
CREATE TABLE IF NOT EXISTS askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
);
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
"""


# What makes the tables of one version those of the next.
MIGRATIONS = {
    1: """
    ALTER TABLE jobs ADD COLUMN expires DOUBLE PRECISION;
    ALTER TABLE lines ADD COLUMN dismissed INTEGER NOT NULL DEFAULT 0;
    DROP INDEX jobs_waiting;
    CREATE TABLE askers (
        job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
    );
    INSERT INTO askers SELECT id, client, 0 FROM jobs WHERE status IN ('accepted', 'running') AND priority < 10;
    UPDATE lines SET dismissed = 1 WHERE job IN (SELECT id FROM jobs WHERE status = 'dismissed');
    """,
}


def prepare(connection: Any) -> None:
    """Make the tables that are missing, bring those of an older version to this one, all in one transaction.

    Raises WrongVersion for a newer one.
    """
    with connection.transaction():
        connection.execute("SELECT pg_advisory_xact_lock(%s)", (CREATE_LOCK,))
        connection.execute("CREATE SCHEMA IF NOT EXISTS inverse_service")
        connection.execute("SET LOCAL search_path TO inverse_service")
        connection.execute("CREATE TABLE IF NOT EXISTS versions (version INTEGER PRIMARY KEY)")
        row = connection.execute("SELECT max(version) AS version FROM versions").fetchone()
        found = row["version"] or VERSION
        if found > VERSION:
            raise WrongVersion(found, VERSION)
        for version in range(found, VERSION):
            connection.execute(MIGRATIONS[version])
        connection.execute(SCHEMA)
        connection.execute("DELETE FROM versions")
        connection.execute("INSERT INTO versions VALUES (%s)", (VERSION,))
