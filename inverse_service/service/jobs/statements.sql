-- What is asked of the store, by name. AMONG () takes a list, FIRST () LAST one that depends on the row; moment() is the
-- time of the database, today() its day in UTC, counted from 1970. A name in braces stands for the statement of that name, or for what the caller puts there.
-- Locks, which only mean something where transactions run at the same time, are always taken in the order jobs (by id),
-- then batches (by id), so that no two wait for each other. What a comment must not have here: question marks, braces.

-- name: job
-- The columns of a Job; its body has a table of its own.
jobs.id, jobs.kind, jobs.document, jobs.options, jobs.status, jobs.client, jobs.priority, jobs.created, jobs.started,
jobs.finished, jobs.attempt, jobs.crashes, jobs.restarts, jobs.revision, jobs.sequence, jobs.wall, jobs.cpu,
jobs.memory, jobs.expires

-- name: open
-- These words lead to the index of open jobs. A status alone leads to none, or ids would not be looked for first.
finished IS NULL

-- name: finished
finished IS NOT NULL

-- name: waiting
finished IS NULL AND status = 'accepted'

-- name: unwanted
-- Nobody waits for a job: neither somebody who asked for it, nor a batch.
NOT EXISTS (SELECT 1 FROM askers WHERE job = jobs.id AND gone = 0)
AND NOT EXISTS (SELECT 1 FROM lines WHERE job = jobs.id AND order_number IS NULL)

-- name: is_drained
SELECT 1 FROM counters WHERE name = 'drained' AND value <> 0

-- name: now
SELECT moment() AS now

-- name: lock
SELECT pg_advisory_xact_lock(?)

-- name: read_jobs
-- The body only where it is that of the present status, and not too large.
SELECT {job}, CASE WHEN length(bodies.body) <= ? THEN bodies.body END AS body
FROM jobs LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status WHERE jobs.id AMONG (?)

-- name: lock_jobs
SELECT {job} FROM jobs WHERE id AMONG (?) ORDER BY id FOR UPDATE

-- name: announce
SELECT pg_notify('inverse_service', said) FROM unnest(CAST(? AS text[])) AS said

-- name: list_jobs
SELECT {job} FROM jobs WHERE {where} ORDER BY sequence DESC LIMIT ?

-- name: has_left
SELECT 1 FROM askers WHERE job = ? AND client = ? AND gone = 1

-- name: accept
INSERT INTO jobs (id, kind, document, options, status, client, priority, created)
VALUES (?, ?, ?, ?, 'accepted', ?, ?, moment())
ON CONFLICT (id) DO UPDATE SET status = 'accepted', client = excluded.client, priority = excluded.priority,
created = excluded.created, started = NULL, finished = NULL, attempt = jobs.attempt + 1, crashes = 0, restarts = 0,
owner = NULL
WHERE jobs.{finished} AND (jobs.status = 'dismissed' OR ? OR jobs.expires <= moment())

-- name: accept_table
INSERT INTO jobs (id, kind, document, options, status, client, priority, created)
SELECT id, kind, document, options, 'accepted', client, priority, moment() FROM unnest(
    CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS integer[])
) AS asked (id, kind, document, options, client, priority)
ON CONFLICT (id) DO UPDATE SET status = 'accepted', client = excluded.client, priority = excluded.priority,
created = excluded.created, started = NULL, finished = NULL, attempt = jobs.attempt + 1, crashes = 0, restarts = 0,
owner = NULL
WHERE jobs.{finished} AND (jobs.status = 'dismissed' OR jobs.id AMONG (?) OR jobs.expires <= moment())

-- name: begin_or_wait
-- A new question, which begins as it is stored where it may, none waits, and the operator lets it.
INSERT INTO jobs (id, kind, document, options, client, priority, created, owner, status, started, heartbeat, attempt)
SELECT ?, ?, ?, ?, ?, ?, moment(), {begun} FROM (
    SELECT ? AND NOT EXISTS (SELECT 1 FROM jobs WHERE {waiting}) AND NOT EXISTS ({is_drained}) AS begins, ? AS claimer
) AS asked WHERE 1 = 1 ON CONFLICT (id) DO NOTHING RETURNING {job}

-- name: begun
-- The owner, status, start, heartbeat and attempt of a new question.
CASE WHEN begins THEN claimer END, CASE WHEN begins THEN 'running' ELSE 'accepted' END,
CASE WHEN begins THEN moment() END, CASE WHEN begins THEN moment() END, CASE WHEN begins THEN 1 ELSE 0 END

-- name: begin_or_wait_all
-- Of many new questions the first ones begin; whoever asked waits for them. One statement is one way to the server.
WITH asked AS (
    SELECT one.*, CAST(? AS text) AS claimer, place <= CAST(? AS integer)
    AND NOT EXISTS (SELECT 1 FROM jobs WHERE {waiting}) AND NOT EXISTS ({is_drained}) AS begins
    FROM unnest(
        CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS text[]),
        CAST(? AS integer[])
    ) WITH ORDINALITY AS one (id, kind, document, options, client, priority, place)
), new AS (
    INSERT INTO jobs (id, kind, document, options, client, priority, created, owner, status, started, heartbeat, attempt)
    SELECT id, kind, document, options, client, priority, moment(), {begun} FROM asked
    ON CONFLICT (id) DO NOTHING RETURNING {job}
), waits AS (
    INSERT INTO askers SELECT id, client, 0 FROM new ON CONFLICT (job, client) DO UPDATE SET gone = 0
)
SELECT * FROM new

-- name: ask
INSERT INTO askers VALUES (?, ?, 0) ON CONFLICT (job, client) DO UPDATE SET gone = 0

-- name: leave
INSERT INTO askers VALUES (?, ?, 1) ON CONFLICT (job, client) DO UPDATE SET gone = 1

-- name: forget_askers
DELETE FROM askers WHERE job AMONG (?)

-- name: used_up
SELECT client FROM uses WHERE client AMONG (?) AND day = today() AND cpu >= ?

-- name: used_today
SELECT cpu FROM uses WHERE client = ? AND day = today()

-- name: count_use
INSERT INTO uses (client, day, runs, cpu) VALUES (?, today(), 1, ?)
ON CONFLICT (client, day) DO UPDATE SET runs = uses.runs + 1, cpu = uses.cpu + excluded.cpu

-- name: open_of_clients
-- Lines that are still to be read are open, too.
SELECT client, CAST(sum(number) AS BIGINT) AS jobs FROM (
    SELECT client, count(*) AS number FROM jobs WHERE {open} GROUP BY client
    UNION ALL SELECT client, lines AS number FROM sent
) AS every GROUP BY client

-- name: next
-- Which jobs are next: by the operator's rank of the client and of the job, then the client with the fewest running
-- ones, then by priority and age. Each client is found by one step in the index `jobs_open`, however
-- many jobs it has waiting. Arguments: limit (of each client), most running ones of a client, limit.
WITH RECURSIVE waiting (client) AS (
    SELECT min(client) FROM jobs WHERE {waiting} AND NOT EXISTS ({is_drained})
    UNION ALL
    SELECT (SELECT min(client) FROM jobs WHERE {waiting} AND client > waiting.client)
    FROM waiting WHERE waiting.client IS NOT NULL
), busy AS (
    SELECT client, count(*) AS jobs FROM jobs WHERE {open} AND status = 'running' GROUP BY client
), candidates AS (
    SELECT id, priority, sequence,
        coalesce(ranks.rank, 0) + CASE WHEN priority < 0 THEN -1 WHEN priority > 10 THEN 1 ELSE 0 END AS rank,
        coalesce(busy.jobs, 0) + row_number() OVER (PARTITION BY jobs.client ORDER BY priority, sequence) AS place
    FROM waiting JOIN jobs ON jobs.sequence FIRST (
        SELECT own.sequence FROM jobs AS own WHERE {waiting} AND own.client = waiting.client
        ORDER BY own.priority, own.sequence LIMIT ?
    ) LAST LEFT JOIN busy ON busy.client = jobs.client LEFT JOIN ranks ON ranks.client = jobs.client
)
SELECT id FROM candidates WHERE place <= ? ORDER BY rank, place, priority, sequence LIMIT ?

-- name: claim
UPDATE jobs SET status = 'running', owner = ?, heartbeat = moment(), started = moment(), attempt = attempt + 1
WHERE id IN (SELECT id FROM jobs WHERE id AMONG (?) AND status = 'accepted' FOR UPDATE SKIP LOCKED) RETURNING {job}

-- name: heartbeat
UPDATE jobs SET heartbeat = moment() WHERE id AMONG (?) AND owner = ? AND status = 'running' RETURNING id, attempt

-- name: finish
UPDATE jobs SET status = ?, finished = moment(), expires = moment() + CAST(? AS DOUBLE PRECISION),
revision = revision + 1, wall = ?, cpu = ?, memory = ?, owner = NULL
WHERE id = ? AND attempt = ? AND status = 'running' RETURNING {job}

-- name: keep_body
INSERT INTO bodies (id, status, body) VALUES (?, ?, ?)
ON CONFLICT (id) DO UPDATE SET status = excluded.status, body = excluded.body

-- name: keep_first_body
INSERT INTO bodies (id, status, body) VALUES (?, ?, ?) ON CONFLICT DO NOTHING

-- name: release
UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + ?
WHERE id = ? AND attempt = ? AND status = 'running'

-- name: recover
-- A claim from the future is of a clock that was set back.
UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 WHERE id IN (
    SELECT id FROM jobs WHERE {open} AND status = 'running' AND (? OR heartbeat <= moment() - ? OR heartbeat > moment() + ?)
    FOR UPDATE SKIP LOCKED
) RETURNING {job}

-- name: dismiss
-- A job that was computed again has its earlier answer back.
UPDATE jobs SET finished = moment(), owner = NULL,
status = coalesce((SELECT bodies.status FROM bodies WHERE bodies.id = jobs.id), 'dismissed')
WHERE id AMONG (?) AND {open} AND {where} RETURNING id

-- name: add_event
INSERT INTO events VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING

-- name: read_events
SELECT number, kind, data FROM events WHERE id = ? AND number > ? ORDER BY number LIMIT ?

-- name: counts
SELECT status, count(*) AS jobs FROM jobs WHERE {open} GROUP BY status
UNION ALL SELECT status, count(*) AS jobs FROM jobs WHERE {finished} GROUP BY status

-- name: oldest
SELECT min(created) AS oldest FROM jobs WHERE {waiting}

-- name: is_waiting
SELECT 1 FROM jobs WHERE {waiting} LIMIT 1

-- name: stored_answer
SELECT jobs.document, bodies.body FROM jobs JOIN bodies ON bodies.id = jobs.id WHERE jobs.id = ?

-- name: dismiss_lines
UPDATE lines SET dismissed = 1 WHERE {where} AND order_number IS NULL

-- name: due_lines
SELECT batch, count(*) AS due FROM lines WHERE {where} AND order_number IS NULL GROUP BY batch ORDER BY batch

-- name: take_numbers
UPDATE batches SET answers = answers + ? WHERE id = ? RETURNING answers

-- name: number_lines
UPDATE lines SET order_number = ? + place FROM (
    SELECT number AS line, row_number() OVER (ORDER BY number) AS place FROM lines
    WHERE {where} AND order_number IS NULL AND batch = ?
) AS due WHERE batch = ? AND number = due.line

-- name: read_batch
SELECT * FROM batches WHERE id = ?

-- name: list_batches
-- Those that are stored in whole, the newest first.
SELECT id FROM batches WHERE total >= 0 AND {where} ORDER BY created DESC, id DESC LIMIT ?

-- name: count_lines
SELECT CASE WHEN lines.dismissed = 1 THEN 'dismissed' ELSE coalesce(jobs.status, 'failed') END AS status,
count(*) AS lines FROM lines LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = ? GROUP BY 1

-- name: answers
-- Arguments: the largest result that comes with its line, the batch, the last order that is known, how many.
SELECT lines.number, lines.identifier, lines.problem, lines.order_number, lines.dismissed, lines.job,
bodies.status, length(bodies.body) AS size,
CASE WHEN bodies.status <> 'successful' OR length(bodies.body) <= ? THEN bodies.body END AS body
FROM lines LEFT JOIN bodies ON bodies.id = lines.job
WHERE lines.batch = ? AND lines.order_number > ? ORDER BY lines.order_number LIMIT ?

-- name: repeated
SELECT count(job) - count(DISTINCT job) AS lines FROM lines WHERE batch = ?

-- name: begin_batch
INSERT INTO batches (id, kind, client, created, total) VALUES (?, ?, ?, moment(), ?) ON CONFLICT DO NOTHING
RETURNING created

-- name: complete_batch
UPDATE batches SET total = ? WHERE id = ?

-- name: add_line
INSERT INTO lines VALUES (?, ?, ?, ?, ?, NULL, 0) ON CONFLICT DO NOTHING

-- name: add_line_table
INSERT INTO lines SELECT *, NULL, 0 FROM unnest(
    CAST(? AS text[]), CAST(? AS integer[]), CAST(? AS text[]), CAST(? AS text[]), CAST(? AS bytea[])
) ON CONFLICT DO NOTHING

-- name: answered
(job IS NULL OR EXISTS (SELECT 1 FROM jobs WHERE jobs.id = lines.job AND jobs.{finished}))

-- name: keep_sent
INSERT INTO sent VALUES (?, ?, ?, ?, ?, 0, NULL)

-- name: take_sent
-- One that nobody reads; a claim from the future is of a clock that was set back.
UPDATE sent SET heartbeat = moment() WHERE batch FIRST (
    SELECT batch FROM sent WHERE heartbeat IS NULL OR heartbeat <= moment() - ? OR heartbeat > moment() + ?
    LIMIT 1 FOR UPDATE SKIP LOCKED
) LAST RETURNING batch, client, terms, body

-- name: free_sent
UPDATE sent SET heartbeat = NULL

-- name: count_sent
UPDATE sent SET lines = ?, heartbeat = moment() WHERE batch = ? RETURNING gone

-- name: sent
SELECT gone FROM sent WHERE batch = ?

-- name: leave_sent
UPDATE sent SET gone = 1 WHERE batch = ?

-- name: end_sent
DELETE FROM sent WHERE batch = ?

-- name: claim_key
INSERT INTO keys VALUES (?, ?, ?, moment()) ON CONFLICT DO NOTHING

-- name: key
SELECT digest FROM keys WHERE client = ? AND key = ?

-- name: open_jobs_of_batch
SELECT DISTINCT job FROM lines WHERE batch = ? AND order_number IS NULL LIMIT ?

-- name: forget_keys
DELETE FROM keys WHERE created <= ?

-- name: forget_uses
DELETE FROM uses WHERE day < today()

-- name: old_batch
SELECT id FROM batches WHERE created <= ?
AND NOT EXISTS (SELECT 1 FROM lines WHERE batch = batches.id AND order_number IS NULL)
AND NOT EXISTS (SELECT 1 FROM sent WHERE batch = batches.id) ORDER BY created LIMIT 1

-- name: forget_some_lines
DELETE FROM lines WHERE batch = ? AND number IN (SELECT number FROM lines WHERE batch = ? LIMIT ?) RETURNING number

-- name: forget_lines
DELETE FROM lines WHERE batch = ?

-- name: forget_batch
DELETE FROM batches WHERE id = ?

-- name: old_jobs
SELECT id, coalesce((SELECT length(body) FROM bodies WHERE bodies.id = jobs.id), 0) AS size FROM jobs
WHERE {finished} AND finished <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id)
ORDER BY finished LIMIT ? FOR UPDATE SKIP LOCKED

-- name: forget
DELETE FROM {table} WHERE id AMONG (?)

-- name: oldest_moment
SELECT max(finished) AS moment FROM (
    SELECT finished FROM jobs WHERE {finished} ORDER BY finished LIMIT ?
) AS oldest

-- name: drain
INSERT INTO counters VALUES ('drained', ?) ON CONFLICT (name) DO UPDATE SET value = excluded.value

-- name: draw_secret
INSERT INTO counters VALUES ('secret', ?) ON CONFLICT (name) DO NOTHING

-- name: secret
SELECT value FROM counters WHERE name = 'secret'

-- name: probe
-- Each time another value, or nothing would be written.
INSERT INTO counters VALUES ('probe', 1) ON CONFLICT (name) DO UPDATE SET value = counters.value + 1

-- name: columns
SELECT {job} FROM jobs LIMIT 0

-- name: clients
SELECT known.client,
(SELECT count(*) FROM jobs WHERE jobs.client = known.client AND {waiting}) AS waiting,
(SELECT count(*) FROM jobs WHERE jobs.client = known.client AND {open} AND status = 'running') AS running,
(SELECT count(*) FROM jobs WHERE jobs.client = known.client) AS stored,
coalesce(ranks.rank, 0) AS rank, coalesce(uses.runs, 0) AS runs, coalesce(uses.cpu, 0) AS cpu
FROM (SELECT client FROM jobs UNION SELECT client FROM batches UNION SELECT client FROM ranks) AS known
LEFT JOIN ranks ON ranks.client = known.client
LEFT JOIN uses ON uses.client = known.client AND uses.day = today() ORDER BY known.client

-- name: rank
INSERT INTO ranks VALUES (?, ?)

-- name: waiting_of_batch
SELECT id FROM jobs WHERE {open} AND id IN (SELECT job FROM lines WHERE batch = ? AND order_number IS NULL)
ORDER BY id FOR UPDATE

-- name: prioritize
UPDATE jobs SET priority = ? WHERE id AMONG (?)

-- name: open_of_client
SELECT id FROM jobs WHERE {open} AND (client = ? OR id IN (SELECT job FROM askers WHERE client = ?)) ORDER BY id

-- name: batches_of_client
SELECT id FROM batches WHERE client = ? ORDER BY id

-- name: forget_lines_of_client
DELETE FROM lines WHERE batch IN (SELECT id FROM batches WHERE client = ?)

-- name: forget_of_client
DELETE FROM {table} WHERE client = ?

-- name: forgettable_of_client
SELECT id FROM jobs WHERE client = ? AND {finished} AND NOT EXISTS (SELECT 1 FROM lines WHERE job = jobs.id)
ORDER BY id FOR UPDATE

-- name: disown
UPDATE jobs SET client = '' WHERE client = ?

-- name: part
SELECT length(body) AS size, substring(body FROM CAST(? AS INTEGER) FOR CAST(? AS INTEGER)) AS part
FROM bodies WHERE id = ?

-- name: place_of_body
SELECT rowid FROM bodies WHERE id = ?

-- name: database_size
SELECT pg_database_size(current_database()) AS size

-- name: used_bytes
-- Rows have their share of tables and indexes besides their contents, which count compressed as they are; the files
-- themselves only shrink when vacuumed.
SELECT (SELECT coalesce(sum(pg_column_size(body) + 300), 0) FROM bodies)
+ (SELECT coalesce(sum(pg_column_size(document) + pg_column_size(options) + 300), 0) FROM jobs)
+ (SELECT coalesce(sum(pg_column_size(data) + 100), 0) FROM events) AS size
