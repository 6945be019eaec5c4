"""Statements that both stores use, with ? for their arguments."""

from __future__ import annotations

from typing import Final

COLUMNS: Final = (
    "id", "kind", "document", "options", "status", "client", "priority", "created", "started", "finished",
    "attempt", "crashes", "restarts", "revision", "sequence", "wall", "cpu", "memory", "expires",
)  # fmt: skip
LISTED: Final = ", ".join(f"jobs.{name}" for name in COLUMNS)
SELECT: Final = f"SELECT {LISTED}"
OPEN: Final = "status IN ('accepted', 'running')"
BODY: Final = "LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status"

# Which jobs are next: by priority, then the client with the fewest running ones, then the oldest. Each client is
# found by one step in the index (client, priority, sequence), however many jobs it has waiting.
# Arguments: limit (of each client), most running ones of a client, limit.
NEXT: Final = (
    "WITH RECURSIVE waiting (client) AS (SELECT min(client) FROM jobs WHERE status = 'accepted' UNION ALL "
    "SELECT (SELECT min(client) FROM jobs WHERE status = 'accepted' AND client > waiting.client) FROM waiting "
    "WHERE waiting.client IS NOT NULL), "
    "busy AS (SELECT client, count(*) AS jobs FROM jobs WHERE status = 'running' GROUP BY client), "
    "candidates AS (SELECT id, priority, sequence, coalesce(busy.jobs, 0) "
    "+ row_number() OVER (PARTITION BY jobs.client ORDER BY priority, sequence) AS place "
    "FROM waiting JOIN jobs ON jobs.sequence IN (SELECT own.sequence FROM jobs AS own WHERE own.status = 'accepted' "
    "AND own.client = waiting.client ORDER BY own.priority, own.sequence LIMIT ?) "
    "LEFT JOIN busy ON busy.client = jobs.client) "
    "SELECT id FROM candidates WHERE place <= ? ORDER BY priority, place, sequence LIMIT ?"
)
OLDEST: Final = "SELECT min(created) AS oldest FROM jobs WHERE status = 'accepted'"
# Whether anybody waits for a job: somebody who asked for it, or a batch. Arguments: its id, twice.
WAITED_FOR: Final = (
    "SELECT EXISTS (SELECT 1 FROM askers WHERE job = ? AND gone = 0) "
    "OR EXISTS (SELECT 1 FROM lines WHERE job = ? AND order_number IS NULL) AS waited"
)
COUNTS: Final = (
    "SELECT CASE WHEN lines.dismissed = 1 THEN 'dismissed' ELSE coalesce(jobs.status, 'failed') END AS status, "
    "count(*) AS lines FROM lines LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = ? GROUP BY 1"
)
# Arguments: the largest body that comes with its line, the batch, the last order that is known, how many.
ANSWERS: Final = (
    "SELECT lines.number, lines.identifier, lines.problem, lines.order_number, lines.dismissed, lines.job, "
    "bodies.status, length(bodies.body) AS size, CASE WHEN length(bodies.body) <= ? THEN bodies.body END AS body "
    "FROM lines LEFT JOIN bodies ON bodies.id = lines.job "
    "WHERE lines.batch = ? AND lines.order_number > ? ORDER BY lines.order_number LIMIT ?"
)
