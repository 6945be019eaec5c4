-- The tables of the store. PostgreSQL takes them as they are, without STRICT and WITHOUT ROWID; SQLite has other names
-- of types (see `statements`). `script` runs the changes from the version that is found, then `schema`.
--
-- `answers` of a batch numbers its answers: `order_number` of its lines. `askers` says which clients wait for an open
-- job besides batches; one that is `gone` cancelled it for itself. `keys` says with which lines a client sent an
-- Idempotency-Key. `ranks` are an operator's, `uses` what a client used on a day (since 1970, UTC). `counters` holds
-- single numbers by name. `sent` holds the bodies of batches whose lines are read later: as the body came, on which
-- terms, how many lines are still to be read, and whether it was cancelled (`gone`).

-- name: schema
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
) STRICT;
CREATE INDEX IF NOT EXISTS jobs_open ON jobs (status, client, priority, sequence, finished) WHERE finished IS NULL;
CREATE INDEX IF NOT EXISTS jobs_ended ON jobs (status, sequence, finished) WHERE finished IS NOT NULL;
CREATE INDEX IF NOT EXISTS jobs_finished ON jobs (finished) WHERE finished IS NOT NULL;
CREATE TABLE IF NOT EXISTS bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body BYTEA NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS events (
    id TEXT NOT NULL, number BIGINT NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (id, number)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created DOUBLE PRECISION NOT NULL,
    total INTEGER NOT NULL, answers INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE TABLE IF NOT EXISTS lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem BYTEA,
    order_number INTEGER, dismissed INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (batch, number)
) STRICT, WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
CREATE INDEX IF NOT EXISTS batches_created ON batches (created);
CREATE TABLE IF NOT EXISTS sent (
    batch TEXT PRIMARY KEY, client TEXT NOT NULL, lines BIGINT NOT NULL, terms TEXT NOT NULL, body BYTEA NOT NULL,
    gone INTEGER NOT NULL DEFAULT 0, heartbeat DOUBLE PRECISION
) STRICT;
CREATE TABLE IF NOT EXISTS askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS ranks (client TEXT PRIMARY KEY, rank INTEGER NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS uses (
    client TEXT NOT NULL, day INTEGER NOT NULL, runs INTEGER NOT NULL, cpu DOUBLE PRECISION NOT NULL,
    PRIMARY KEY (client, day)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS keys (
    client TEXT NOT NULL, key TEXT NOT NULL, digest TEXT NOT NULL, created DOUBLE PRECISION NOT NULL,
    PRIMARY KEY (client, key)
) STRICT, WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value BIGINT NOT NULL) STRICT;

-- name: from_1
ALTER TABLE jobs ADD COLUMN expires DOUBLE PRECISION;
ALTER TABLE lines ADD COLUMN dismissed INTEGER NOT NULL DEFAULT 0;
DROP INDEX jobs_waiting;
CREATE TABLE askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
) STRICT, WITHOUT ROWID;
INSERT INTO askers SELECT id, client, 0 FROM jobs WHERE status IN ('accepted', 'running') AND priority < 10;
UPDATE lines SET dismissed = 1 WHERE job IN (SELECT id FROM jobs WHERE status = 'dismissed');

-- name: from_2
-- In SQLite all batches had one number; PostgreSQL adds only what is missing.
ALTER TABLE batches ADD COLUMN answers INTEGER NOT NULL DEFAULT 0;
UPDATE batches SET answers = (SELECT coalesce(max(order_number), 0) FROM lines WHERE lines.batch = batches.id);

-- name: from_3
-- Jobs that are open have no time at which they ended; each change writes two indexes less.
UPDATE jobs SET finished = NULL WHERE status IN ('accepted', 'running');
DROP INDEX IF EXISTS jobs_next;
DROP INDEX IF EXISTS jobs_open;
DROP INDEX IF EXISTS jobs_finished;
DROP INDEX IF EXISTS jobs_status;

-- name: from_4
-- `sent` is new.

