"""What every job store does; the SQLite one is the default, the PostgreSQL one an extra. `Cleaner` forgets old answers.

All methods block, may be called from any thread, and return after their change is durable unless they say otherwise. A
store is the truth: whatever else dies, an accepted job is in it.
"""

from __future__ import annotations

import functools
import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar, Concatenate, ParamSpec, TypeVar

from inverse_service.service.jobs import model, statements

P = ParamSpec("P")
T = TypeVar("T")
# Rows that are forgotten in one step, which takes some milliseconds; jobs that are looked at to find the oldest.
STEP, OLDEST = 50, 100
log = logging.getLogger(__name__)
# A clock that went forward by more than this since the last look, or since the newest job, is not believed for a day.
JUMP, DISTRUST = 86_400.0, 86_400.0


def _reading(statement: Callable[Concatenate[statements.Session, P], T]) -> Callable[Concatenate[JobStore, P], T]:
    """The method that looks at the store by this statement."""

    @functools.wraps(statement)
    def read(self: JobStore, /, *arguments: P.args, **named: P.kwargs) -> T:
        return self._read(lambda session: statement(session, *arguments, **named))

    return read


def writing(
    statement: Callable[Concatenate[statements.Session, P], T], durable: bool = True
) -> Callable[Concatenate[JobStore, P], T]:
    """The method that changes the store by this statement."""

    @functools.wraps(statement)
    def write(self: JobStore, /, *arguments: P.args, **named: P.kwargs) -> T:
        return self._write(lambda session: statement(session, *arguments, **named), durable)

    return write


class JobStore(ABC):
    """Jobs, their events, and batches of them; `statements` says what each method does."""

    # Whether one process alone has the store; else claims are looked for by polling.
    exclusive: ClassVar[bool]
    # Where `stored_answer` reads the same store from another process.
    address: str

    def __init__(self) -> None:
        self._listeners: list[Callable[[model.Change], None]] = []

    @abstractmethod
    def _read(self, function: Callable[[statements.Session], T]) -> T:
        """Look at the store."""

    @abstractmethod
    def _write(self, change: Callable[[statements.Session], T], durable: bool = True) -> T:
        """Change it in one transaction, and tell of the jobs that changed."""

    @abstractmethod
    def _used_bytes(self) -> int:
        """Bytes that forgetting can make fewer."""

    @property
    def is_busy(self) -> bool:
        """Whether a change may have to wait for others."""
        return True

    def on_change(self, listener: Callable[[model.Change], None]) -> None:
        """Call the listener with each change."""
        self._listeners.append(listener)

    def tell(self, changes: Iterable[model.Change]) -> None:
        """Call the listeners."""
        for change in changes:
            for listener in self._listeners:
                listener(change)

    @abstractmethod
    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        """The length of the body of a job's answer, 0 where there is none, and so many bytes of it."""

    def size(self) -> int:
        """The bytes that the database takes."""
        return self._used_bytes()

    def try_to_write(self) -> None:
        """Write something small and durable, and read every column; raises what the database says."""
        self._read(lambda s: s.rows("columns"))
        self._write(lambda s: s.run("probe"))

    @abstractmethod
    def close(self) -> None:
        """Give the store up; nothing that was acknowledged is lost."""

    submit = writing(statements.submit)
    submit_and_claim = writing(statements.submit_and_claim)
    claim = writing(statements.claim, durable=False)
    heartbeat = writing(statements.heartbeat, durable=False)
    finish = writing(statements.finish)
    release = writing(statements.release)
    dismiss = writing(statements.dismiss)
    recover = writing(statements.recover)
    add_events = writing(statements.add_events, durable=False)
    job = _reading(statements.read_job)
    jobs = _reading(statements.list_jobs)
    events = _reading(statements.read_events)
    counts = _reading(statements.counts)
    is_waiting = _reading(statements.is_waiting)
    oldest = _reading(statements.oldest)
    used_today = _reading(statements.used_today)
    claim_key = writing(statements.claim_key, durable=False)
    begin_batch = writing(statements.begin_batch, durable=False)
    add_lines = writing(statements.add_lines, durable=False)
    batch = _reading(statements.read_batch)
    repeated = _reading(statements.repeated)
    batch_answers = _reading(statements.answers)

    def create_batch(
        self, id: str, kind: str, client: str, lines: Sequence[statements.BatchLine],
        bounds: model.Bounds = statements.NO_BOUNDS,
    ) -> statements.Batch:  # fmt: skip
        """Store the batch and the jobs of its lines, all or nothing; one of this id stays as it is.

        In small transactions, between which others are served. One that a death of the service left incomplete is
        unseen, and goes on where it is sent again.
        """
        if (found := self.batch(id)) is not None:
            return found
        asked = [line.request for line in lines if line.request is not None]
        self._read(lambda s: statements.refuse_without_room(s, asked, bounds))
        self.begin_batch(id, kind, client)
        try:
            for place in range(0, len(lines), statements.STEP):
                self.add_lines(id, lines[place : place + statements.STEP], bounds)
        except model.TooManyJobs:  # others were faster
            self.dismiss_batch(id)
            self._write(lambda s: statements.forget_batch(s, id))
            raise
        return self._write(lambda s: statements.complete_batch(s, id, len(lines)))

    def dismiss_batch(self, id: str) -> list[str]:
        """Dismiss the open lines of the batch; the ids of their jobs that nobody else waits for, which stop.

        In small transactions, as they are stored.
        """
        over, left = list[str](), 1
        while left:
            left, some = self._write(lambda s: statements.leave_some(s, id))
            over += some
        return over

    def prune(self, oldest: float, largest: int) -> int:
        """Forget jobs and batches finished before the time `oldest`, then the oldest until the
        store has at most `largest` bytes; how many jobs were forgotten. Open ones always stay.
        In small transactions, between which others are served; free space goes back to the disk."""
        forgotten = 0
        while (step := self._forget(oldest))[0]:
            forgotten += step[1]
        while self._used_bytes() > largest:
            moment = self._read(lambda s: statements.oldest_moment(s, OLDEST))
            step = (0, 0) if moment is None else self._forget(moment)
            if not step[0]:
                break
            forgotten += step[1]
        return forgotten

    def _forget(self, before: float) -> tuple[int, int]:
        return self._write(lambda s: statements.forget(s, before, STEP), durable=False)

    secret = writing(statements.secret)
    # What follows is for an operator; a service that runs over the same store hears of it within seconds.
    is_drained = _reading(statements.is_drained)
    drain = writing(statements.drain)
    clients = _reading(statements.clients)
    rank_client = writing(statements.rank_client)
    prioritise_batch = writing(statements.prioritise_batch)

    def dismiss_client(self, client: str) -> list[str]:
        """Dismiss whatever is open for a client; the ids of the jobs that nobody else waits for, which stop."""
        own = self._read(lambda s: s.rows("batches_of_client", client))
        ended = [id for batch in own for id in self.dismiss_batch(batch["id"])]
        return ended + self._write(lambda s: statements.leave_all(s, client))

    def erase_client(self, client: str) -> int:
        """Forget all jobs, answers and batches of a client that no other one asked for; how many jobs."""
        self.dismiss_client(client)
        return self._write(lambda s: statements.erase_client(s, client))


class Cleaner:
    """Prunes the store to answers younger than `age` s and at most `size` bytes, each time it is asked to."""

    def __init__(self, store: JobStore, age: float, size: int) -> None:
        self._store, self._age, self._size = store, age, size
        self._offset = time.time() - time.monotonic()
        self._believed = 0.0

    def clean(self) -> None:
        """Forget what is old or too much; a store that is away may be back the next time."""
        try:
            if forgotten := self._store.prune(self._oldest(), self._size):
                log.info("old jobs forgotten", extra={"jobs": forgotten})
        except Exception:
            log.exception("old jobs could not be forgotten")

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
