"""Tables of the store, and how those of older versions become these.

`answers` of a batch numbers its answers: `order_number` of its lines. `askers` says which clients wait for an open job
besides batches; one that is `gone` cancelled it for itself. `keys` says with which lines a client sent
an Idempotency-Key. `ranks` are an operator's, `uses` what a client used on a
day (since 1970, UTC). `counters` holds single numbers by name.
"""

from __future__ import annotations

from typing import Final

from inverse_service.service.jobs.model import WrongVersion

VERSION: Final = 3
_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    sequence {serial},
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    document TEXT NOT NULL,
    options TEXT NOT NULL,
    status TEXT NOT NULL,
    client TEXT NOT NULL,
    priority INTEGER NOT NULL,
    created {real} NOT NULL,
    started {real},
    finished {real},
    attempt INTEGER NOT NULL DEFAULT 0,
    crashes INTEGER NOT NULL DEFAULT 0,
    restarts INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    owner TEXT,
    heartbeat {real},
    expires {real},
    wall {real} NOT NULL DEFAULT 0,
    cpu {real} NOT NULL DEFAULT 0,
    memory {real} NOT NULL DEFAULT 0
){table};
CREATE INDEX IF NOT EXISTS jobs_next ON jobs (client, priority, sequence) WHERE status = 'accepted';
CREATE INDEX IF NOT EXISTS jobs_open ON jobs (client, status) WHERE status IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_finished ON jobs (finished) WHERE status NOT IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_status ON jobs (status, sequence);
CREATE TABLE IF NOT EXISTS bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body {bytes} NOT NULL){table};
CREATE TABLE IF NOT EXISTS events (
    id TEXT NOT NULL, number {long} NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (id, number)
){keyed};
CREATE TABLE IF NOT EXISTS batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created {real} NOT NULL,
    total INTEGER NOT NULL, answers INTEGER NOT NULL DEFAULT 0
){table};
CREATE TABLE IF NOT EXISTS lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem {bytes},
    order_number INTEGER, dismissed INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (batch, number)
){keyed};
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
CREATE INDEX IF NOT EXISTS batches_created ON batches (created);
CREATE TABLE IF NOT EXISTS askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
){keyed};
CREATE TABLE IF NOT EXISTS ranks (client TEXT PRIMARY KEY, rank INTEGER NOT NULL){table};
CREATE TABLE IF NOT EXISTS uses (
    client TEXT NOT NULL, day INTEGER NOT NULL, runs INTEGER NOT NULL, cpu {real} NOT NULL, PRIMARY KEY (client, day)
){keyed};
CREATE TABLE IF NOT EXISTS keys (
    client TEXT NOT NULL, key TEXT NOT NULL, digest TEXT NOT NULL, created {real} NOT NULL, PRIMARY KEY (client, key)
){keyed};
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value {long} NOT NULL){table};
"""
# What makes the tables of one version those of the next; tables that are new are made in any case.
_MIGRATIONS = {
    1: """
    ALTER TABLE jobs ADD COLUMN expires {real};
    ALTER TABLE lines ADD COLUMN dismissed INTEGER NOT NULL DEFAULT 0;
    DROP INDEX jobs_waiting;
    CREATE TABLE askers (
        job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
    ){keyed};
    INSERT INTO askers SELECT id, client, 0 FROM jobs WHERE status IN ('accepted', 'running') AND priority < 10;
    UPDATE lines SET dismissed = 1 WHERE job IN (SELECT id FROM jobs WHERE status = 'dismissed');
    """,
    2: "{number_answers}",
}
SQLITE: Final = {
    "serial": "INTEGER PRIMARY KEY AUTOINCREMENT", "real": "REAL", "bytes": "BLOB", "long": "INTEGER",
    "table": " STRICT", "keyed": " STRICT, WITHOUT ROWID",
    # All batches had one number until version 2.
    "number_answers": "ALTER TABLE batches ADD COLUMN answers INTEGER NOT NULL DEFAULT 0; UPDATE batches SET answers = "
    "(SELECT coalesce(max(order_number), 0) FROM lines WHERE lines.batch = batches.id);",
}  # fmt: skip
POSTGRES: Final = {
    "serial": "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY", "real": "DOUBLE PRECISION", "bytes": "BYTEA",
    "long": "BIGINT", "table": "", "keyed": "", "number_answers": "",
}  # fmt: skip


def script(found: int, words: dict[str, str]) -> str:
    """What makes the tables of version `found` (0: none) those of this one. Raises WrongVersion for a newer one."""
    if not 0 <= found <= VERSION:
        raise WrongVersion(found, VERSION)
    steps = [_MIGRATIONS[version] for version in range(found or VERSION, VERSION)]
    return "".join((*steps, _SCHEMA)).format(**words)
