"""What keeps a store in order: old answers are forgotten, and what an operator asks for."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from typing import TYPE_CHECKING, Final

from inverse_service.service.jobs.model import ClientUse
from inverse_service.service.jobs.statements import FINISHED, OPEN, Session, first, leave

if TYPE_CHECKING:
    from inverse_service.service.jobs.store import JobStore

PRUNE_LOCK: Final = 7_204_021_103
# So many bytes of answers are forgotten at once, and one answer however large.
FORGOTTEN_BYTES: Final = 8 * 2**20


def forget(session: Session, before: float, most: int) -> tuple[int, int]:
    """Forget a little: lines of a batch from before with nothing open, or where there is none, finished jobs.

    How many rows were forgotten, and how many of them are jobs. Those that a kept batch names stay, and so do those
    that a batch has locked which is made at this moment.
    """
    session.lock(PRUNE_LOCK)
    session.run("DELETE FROM keys WHERE created <= ?", before)
    batch = first(
        session,
        "SELECT id FROM batches WHERE created <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE batch = batches.id "
        "AND order_number IS NULL) ORDER BY created LIMIT 1",
        before,
    )
    if batch is not None:
        some = "number IN (SELECT number FROM lines WHERE batch = ? LIMIT ?)"
        lines = session.rows(
            f"DELETE FROM lines WHERE batch = ? AND {some} RETURNING number", batch["id"], batch["id"], most
        )
        if len(lines) < most:
            session.run("DELETE FROM batches WHERE id = ?", batch["id"])
        return max(1, len(lines)), 0
    rows = session.rows(
        "SELECT id, coalesce((SELECT length(body) FROM bodies WHERE bodies.id = jobs.id), 0) AS size FROM jobs "
        f"WHERE {FINISHED} AND finished <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id) "
        "ORDER BY finished LIMIT ? FOR UPDATE SKIP LOCKED",
        before, most,
    )  # fmt: skip
    sizes = itertools.accumulate(row["size"] for row in rows)
    ids = [row["id"] for row, size in zip(rows, sizes, strict=True) if row is rows[0] or size <= FORGOTTEN_BYTES]
    return len(ids), _delete(session, ids)


def _delete(session: Session, ids: list[str]) -> int:
    for table in ("bodies", "events", "jobs"):
        session.run(f"DELETE FROM {table} WHERE id AMONG (?)", ids)
    return len(ids)


def oldest_moment(session: Session, count: int) -> float | None:
    """When the last of the `count` finished jobs ended that are the first to be forgotten."""
    finished = f"SELECT finished FROM jobs WHERE {FINISHED} ORDER BY finished LIMIT ?"
    moment: float | None = first(session, f"SELECT max(finished) AS moment FROM ({finished}) AS oldest", count)[
        "moment"
    ]
    return moment


def drain(session: Session, drained: bool) -> None:
    """Let no job begin, or let them begin again."""
    session.run(
        "INSERT INTO counters VALUES ('drained', ?) ON CONFLICT (name) DO UPDATE SET value = excluded.value",
        int(drained),
    )


def clients(session: Session) -> list[ClientUse]:
    """Who has something in the store or a rank, with what each used today."""
    count = "(SELECT count(*) FROM jobs WHERE jobs.client = known.client AND status = '{}') AS {}"
    return [
        ClientUse(**dict(row))
        for row in session.rows(
            f"SELECT known.client, {count.format('accepted', 'waiting')}, {count.format('running', 'running')}, "
            "(SELECT count(*) FROM jobs WHERE jobs.client = known.client) AS stored, "
            "coalesce(ranks.rank, 0) AS rank, coalesce(uses.runs, 0) AS runs, coalesce(uses.cpu, 0) AS cpu "
            "FROM (SELECT client FROM jobs UNION SELECT client FROM batches UNION SELECT client FROM ranks) AS known "
            "LEFT JOIN ranks ON ranks.client = known.client "
            f"LEFT JOIN uses ON uses.client = known.client AND uses.day = today() ORDER BY known.client"
        )
    ]


def rank_client(session: Session, client: str, rank: int) -> None:
    """The client's jobs, also those to come, begin before (-1), with (0) or after (1) those of the others."""
    session.run("DELETE FROM ranks WHERE client = ?", client)
    if rank:
        session.run("INSERT INTO ranks VALUES (?, ?)", client, rank)


def prioritise_batch(session: Session, batch: str, priority: int) -> int:
    """Give the waiting jobs of a batch this priority; how many there are."""
    lines = "SELECT job FROM lines WHERE batch = ? AND order_number IS NULL"
    found = session.rows(f"SELECT id FROM jobs WHERE {OPEN} AND id IN ({lines}) ORDER BY id FOR UPDATE", batch)
    session.run("UPDATE jobs SET priority = ? WHERE id AMONG (?)", priority, [row["id"] for row in found])
    return len(found)


def leave_all(session: Session, client: str) -> list[str]:
    """Dismiss the single jobs that are open for a client; the ids of those that nobody else waits for, which stop."""
    asked = session.rows(
        f"SELECT id FROM jobs WHERE {OPEN} AND (client = ? OR id IN (SELECT job FROM askers WHERE client = ?)) "
        "ORDER BY id",
        client, client,
    )  # fmt: skip
    return [row["id"] for row in asked if leave(session, row["id"], client)[1]]


def erase(session: Session, client: str) -> int:
    """Forget a client that has nothing open: its batches, its jobs with their answers, what it used; how many jobs.

    Jobs that others wait for, or that a batch of another client names, lose its name instead.
    """
    session.run("DELETE FROM lines WHERE batch IN (SELECT id FROM batches WHERE client = ?)", client)
    for table in ("batches", "askers", "keys", "ranks", "uses"):
        session.run(f"DELETE FROM {table} WHERE client = ?", client)
    rows = session.rows(
        f"SELECT id FROM jobs WHERE client = ? AND {FINISHED} AND NOT EXISTS (SELECT 1 FROM lines WHERE job = jobs.id) "
        "ORDER BY id FOR UPDATE",
        client,
    )
    forgotten = _delete(session, [row["id"] for row in rows])
    session.run("UPDATE jobs SET client = '' WHERE client = ?", client)
    return forgotten


log = logging.getLogger(__name__)
FIRST, INTERVAL = 30.0, 600.0
# A clock that went forward by more than this since the last look, or since the newest job, is not believed for a day.
JUMP, DISTRUST = 86_400.0, 86_400.0


class Cleaner:
    """A thread that prunes the store to answers younger than `age` s and at most `size` bytes."""

    def __init__(self, store: JobStore, age: float, size: int) -> None:
        self._store, self._age, self._size = store, age, size
        self._offset = time.time() - time.monotonic()
        self._believed = 0.0
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="cleaner", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        self._thread.join(10)

    def _run(self) -> None:
        seconds = FIRST
        while not self._stopping.wait(seconds):
            seconds = INTERVAL
            try:
                forgotten = self._store.prune(self._oldest(), self._size)
            except Exception:  # the store may be away for a while; the next round tries again
                log.exception("old jobs could not be forgotten")
                continue
            if forgotten:
                log.info("old jobs forgotten", extra={"jobs": forgotten})

    def _oldest(self) -> float:
        """What ended before is forgotten: nothing by its age while the clock may be wrong."""
        newest, _ = self._store.jobs(limit=1)
        offset, self._offset = self._offset, time.time() - time.monotonic()
        is_first = self._believed == 0.0
        jumped = self._offset - offset > JUMP or (is_first and any(time.time() - job.created > JUMP for job in newest))
        if jumped:
            log.warning("the clock went forward, or nothing was asked for a day: nothing is forgotten by age for a day")
        if jumped or is_first:
            self._believed = time.monotonic() + (DISTRUST if jumped else 0.0)
        return time.time() - self._age if time.monotonic() >= self._believed else 0.0
