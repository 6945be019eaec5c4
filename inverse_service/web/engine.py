"""The engine behind the routes: store, supervisor, worker processes, and waiting requests.

Answers that were given a moment ago are found by the bytes of the question before any process or
store is asked.
"""

import asyncio
import functools
import gc
import hashlib
import itertools
import logging
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence, Sized
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final, ParamSpec, TypeVar

from pydantic import ValidationError
from starlette.responses import Response
from starlette.types import Scope

from api_schemas.system import SystemDocument
from inverse_service import __version__, errors
from inverse_service.service.documents import answers, plain_system
from inverse_service.service.jobs import (
    model,
    monitoring,
    opening,
    statements,
    stores,
    tasks,
    workers,
)
from inverse_service.service.jobs.batch import batch_task, numbers_of, unread_line
from inverse_service.service.jobs.supervisor import Supervisor
from inverse_service.settings import Settings
from inverse_service.web import asking, clients, pages, problems, together

log = logging.getLogger(__name__)
# What is no job has a second, and two more for each MB; batches of many lines have more, pages and
# figures too. It waits so long for a processor that others have, ten times its own second, as at
# ten processes for each processor.
QUICK_DEADLINE, PATIENCE = 1.0, 10.0
# The system counts processor time in steps; a task that had this part of its time had all of it.
ITS_TIME = 0.9
BUSY = "The service is busy with other questions; try again in some seconds."
SECONDS_FOR_A_BYTE = 2e-6
LONG_DEADLINE = 15.0
# How often (s) who waits looks at what other front ends may have changed, where it does not hear of
# it, or does.
LOOK_AGAIN, LOOK_SELDOM = 0.5, 2.0
# A stream says that it lives this often, s.
KEEP_ALIVE = 10.0
STORE_THREADS = 32
# Who has not stored a step of a batch for so long (s) is dead; how often what others left is looked
# for.
SENT_LEASE, SENT_EVERY = 60.0, 5.0
# Threads that store questions where several can at a time.
WRITERS = 2
# Bytes of a question that costs the loop less to read, in a fraction of a millisecond, than to hand
# it to a process.
SHORT = 2048
# So many bytes of an answer are read at once.
PART = 256 * 1024
# How long a request waits for a database that is down, in seconds; the event loop never waits.
STORE_PATIENCE = 20.0
LATE = "The database does not answer in time."
READY_PATIENCE = 10.0
READY_KEPT = 1.0
LAG_EVERY = 1.0
FIRST_CLEANING, BETWEEN_CLEANINGS = 30.0, 600.0
MANY_WAIT = "Too many requests wait for a worker; try again in some seconds."
# How long, in seconds, an answer is given without asking the store, even if it was erased there.
KEPT = 5.0
# Bytes of all answers, and of one; larger ones are read in parts. To compress one of 7 kB takes 0.3
# ms of processor time, as much as all else that its giving takes.
MOST_BYTES, LARGEST = 64 * 2**20, 256 * 2**10
# The headers that an answer depends on; it holds for the same ones, letter by letter.
READ: Final = frozenset((
    b"accept", b"authorization", b"cache-control", b"content-encoding", b"content-length", b"content-type", b"cookie",
    b"host", b"idempotency-key", b"origin", b"prefer", b"sec-fetch-site", b"transfer-encoding", b"x-api-key",
))  # fmt: skip
# The answers to larger questions are looked for in the store.
SMALL_QUESTION = 64 * 1024
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """The answer to a question, until when it is given, its job, and the job's mark then."""

    response: Response
    until: float
    job: str
    mark: object


class KnownAnswers:
    """The latest answers, all forgotten together where they become too many; safe to use from any
    thread.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._answers: dict[bytes, KnownAnswer] = {}
        # Of each job; a job that changed has no mark, or another one.
        self._marks: dict[str, object] = {}
        self.kept_bytes = 0

    def get(self, key: bytes, kind: str) -> Response | None:
        """The answer to a question, if it was given a moment ago and its job has not changed."""
        found = self._answers.get(key)
        if (
            found is None
            or found.mark is not self._marks.get(found.job)
            or found.until < time.monotonic()
        ):
            return None
        monitoring.of(monitoring.KNOWN, kind).inc()
        return found.response

    def keep(self, key: bytes, job: str, response: Response) -> None:
        """Note an answer that holds until its job changes; not one that is large, or comes in
        parts.
        """
        size = len(getattr(response, "body", b""))
        if not key or not 0 < size <= LARGEST:
            return
        with self._lock:
            before = self._answers.get(key)
            self.kept_bytes += size - (len(before.response.body) if before else 0)
            if self.kept_bytes > MOST_BYTES:
                self._answers, self._marks, self.kept_bytes = {}, {}, size
            mark = self._marks.setdefault(job, object())
            self._answers[key] = KnownAnswer(response, time.monotonic() + KEPT, job, mark)

    def drop(self, change: model.Change) -> None:
        """A job changed."""
        self._marks.pop(change.id, None)


def key_of(scope: Scope, body: bytes) -> bytes:
    """The key of a question: everything that its answer depends on; none for a large one."""
    if len(body) > SMALL_QUESTION:
        return b""
    read = [pair for pair in scope["headers"] if pair[0] in READ]
    about = (scope["scheme"], scope["path"], scope["query_string"], body, read)
    return hashlib.sha256(repr(about).encode()).digest()


def is_busy(error: Exception) -> bool:
    """Whether a service with less to do would take it."""
    return isinstance(error, problems.Refusal) and error.status in (429, 503)


def own_lines(viewer: model.Viewer, lines: Sequence[model.BatchLine]) -> list[model.BatchLine]:
    """The lines as the store takes them from this client."""
    return [replace(line, request=line.request and viewer.own(line.request)) for line in lines]


class Engine:
    """Two pools: one runs jobs, the other reads what comes in and answers what takes milliseconds.

    A page that echoes what was understood must not wait behind a system of an hour. What clients
    send is read in the second pool; the loop moves bytes, and reads what is short and plain.
    """

    supervisor: Supervisor
    hub: asking.Hub
    together: together.Together

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.keys = clients.Keys(settings)
        self.known = KnownAnswers()
        self.work_workers = opening.executor(
            settings.cluster, settings.workers, settings.memory_limit
        )
        self.quick_workers = workers.Workers(
            clients.QUICK_PROCESSES, settings.memory_limit, clients.QUICK_SHARE
        )
        self._threads = ThreadPoolExecutor(STORE_THREADS, "store")
        self._store_check: asyncio.Future[list[str]] | None = None
        self._store_checked = 0.0
        self._chores: list[asyncio.Task[None]] = []
        # Those who wait for a quick process, those who get an answer that is not stored, and bytes
        # of bodies.
        self.places = clients.Shares(
            settings.waiting, max(1, settings.waiting // 2), MANY_WAIT, MANY_WAIT
        )
        self.glances = clients.Shares(clients.GLANCES, 1, MANY_WAIT)
        largest = asking.LARGEST_FACTOR * settings.max_body
        self.bytes = clients.Shares(
            2 * largest, largest, "Too much data is being processed; send less at a time."
        )
        # Those of the server that runs this application, where it counts them.
        self.connections: Sized = ()
        self.is_open = False
        self.job_store: stores.JobStore | None = None

    def open(self) -> None:
        """Open the store, and the cluster if there is one; raises InputError if either cannot be
        used.
        """
        if self.job_store is None:
            self.job_store = opening.open_store(self.settings.database)
            if self.settings.cluster is not None:
                self.work_workers.start()

    def start(self) -> None:
        """Start processes and threads; call on the loop and thread that live as long as the
        service.
        """
        self.open()
        self.hub = asking.Hub()
        for module in pages.TASKS:
            workers.preload(module)
        self.work_workers.start()
        self.quick_workers.start()
        self.supervisor = Supervisor(
            self.store, self.work_workers, self.settings.client_running, self.quick_workers
        )
        self.store.on_change(self.hub.tell)
        self.store.on_change(self.known.drop)
        self.supervisor.start()
        self.together = together.Together(
            lambda some: self.supervisor.submit_together(some, self.bounds),
            1 if self.store.exclusive else WRITERS,
        )
        self._sent = asyncio.Event()
        self.store.on_change(functools.partial(self._note_sent, asyncio.get_running_loop()))
        self.store.listen()
        chores = (self._measure_lag, self._forget, self._unpack)
        self._chores = [asyncio.create_task(chore()) for chore in chores]
        gc.collect()
        gc.freeze()  # what is loaded stays, and is not looked through again and again
        self.is_open = True
        log.info(
            "the service starts", extra={"version": __version__, "workers": self.settings.workers}
        )

    @property
    def store(self) -> stores.JobStore:
        """The store of jobs; open from `open` to `stop`."""
        assert self.job_store is not None
        return self.job_store

    def close_streams(self) -> None:
        """The service is about to stop: streams and waiting calls end now."""
        if self.is_open:
            self.hub.close()

    def stop(self) -> None:
        """Give running jobs back to the store, kill all processes, close the store."""
        if not self.is_open:
            return
        self.is_open = False
        log.info("the service stops")
        for chore in self._chores:
            chore.cancel()
        self.together.stop()
        self.supervisor.stop()
        self.work_workers.stop()
        self.quick_workers.stop()
        self._threads.shutdown(wait=False, cancel_futures=True)
        self.store.close()
        self.job_store = None

    @property
    def is_reading(self) -> bool:
        """Whether a process that reads what comes in has answered once."""
        return self.quick_workers.first.done()

    @functools.cached_property
    def server_options(self) -> model.JobOptions:
        """The bounds of this server, which are what a job gets that says nothing."""
        return model.JobOptions(self.settings.time_limit, self.settings.memory_limit)

    @functools.cached_property
    def bounds(self) -> model.Bounds:
        """How many open jobs there may be, and what a client may use in a day."""
        settings = self.settings
        return model.Bounds(
            settings.queue, settings.client_queue, settings.client_daily_seconds or model.NO_BOUND
        )

    def in_thread(
        self, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
    ) -> asyncio.Future[T]:
        """What a function that waits for the disk gives, in a thread."""
        work = functools.partial(function, *arguments, **named)
        return asyncio.get_running_loop().run_in_executor(self._threads, work)

    async def read(self, function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Call the store; raises StoreUnavailable if no answer comes within STORE_PATIENCE."""
        began = time.monotonic()
        try:
            return await self._in_time(self.in_thread(function, *arguments, **named))
        finally:
            monitoring.STORE.observe(time.monotonic() - began)

    async def _in_time(self, stored: Awaitable[T]) -> T:
        try:
            async with asyncio.timeout(STORE_PATIENCE):
                return await stored
        except TimeoutError:
            raise model.StoreUnavailable(LATE) from None

    async def job(self, id: str, viewer: model.Viewer) -> model.Job | None:
        """A job as this viewer may see it, with an answer that is not large; None also for another
        client's.
        """
        return viewer.seen(await self.read(self.store.job, id, PART, viewer.name))

    async def batch(self, id: str, viewer: model.Viewer) -> model.Batch | None:
        """A batch as this viewer may see it; None also for another client's."""
        return viewer.seen(await self.read(self.store.batch, id))

    async def submit(
        self, request: model.JobRequest, viewer: model.Viewer, seconds: float, key: str = ""
    ) -> model.Job:
        """The stored job of a question, sent with this key, when it is final, or as it is after so
        many seconds.
        """
        own, end = viewer.own(request), time.monotonic() + seconds
        with self.hub.waiting(asking.end_of(own.id)) as ended:
            if key:
                await self.read(self._claim_key, own.client, key, own.id)
            new = await self._in_time(self.together.submit(own))
            job = await self.read(self._submit, own) if new is None else new
            return await self._until_final(job, viewer, end - time.monotonic(), ended)

    async def ask(
        self, question: model.JobRequest, viewer: model.Viewer, seconds: float = 0.0, key: str = ""
    ) -> model.Job:
        """`submit`; a document for whose answer nobody waits is refused at once where it cannot be
        read.

        It is read while it is stored; where that takes long, the job will tell.
        """
        reading = None
        is_to_be_read = seconds <= 0 and question.kind == "solve"
        if is_to_be_read and not plain_system.is_readable(question.document):
            reading = asyncio.ensure_future(
                self.run_quick(
                    question.client,
                    tasks.refuse_task,
                    question.document.encode(),
                    seconds=QUICK_DEADLINE,
                )
            )
            # Whoever leaves before hears nothing of it.
            reading.add_done_callback(lambda task: task.cancelled() or task.exception())
        try:
            job = await self.submit(question, viewer, seconds, key)
            if reading is not None and job.is_open:
                with suppress(problems.Refusal):  # where too many wait, the job will tell
                    outcome = await reading
                    if outcome.status == "refused":
                        raise errors.DocumentRefused(outcome.places)
        finally:
            if reading is not None:
                reading.cancel()
        return job

    async def rate_limit(self, client: str) -> dict[str, str]:
        """The headers with the remaining quota, if there is a quota."""
        quota = self.settings.client_daily_seconds
        if not quota:
            return {}
        used = await self.read(self.store.used_today, client)
        return problems.rate_limit(quota, quota - used, model.until_tomorrow())

    @property
    def look_again(self) -> float:
        """A waiting request polls its job at this interval (s), as what other front ends tell this
        one may get lost.
        """
        if self.store.exclusive:
            return KEEP_ALIVE
        return LOOK_SELDOM if self.store.hears_others else LOOK_AGAIN

    async def followed(
        self, what: str, look: Callable[[], Awaitable[asking.Found]], alive: bytes
    ) -> AsyncIterator[bytes]:
        """The parts that `look` finds of something that grows, again at each change; `alive` after
        each silence.

        Where only this process changes the store, each change wakes the stream. It ends with the
        last part, or early where the service stops.
        """
        spoken = time.monotonic()
        with self.hub.waiting(what) as changed:
            while not self.hub.closing:
                changed.clear()
                try:
                    found, patience = await look(), self.look_again
                except model.StoreUnavailable:  # the stream continues when it is back
                    found, patience = asking.Found(asking.each(), False, False), LOOK_AGAIN
                async for part in found.parts:
                    spoken = time.monotonic()
                    yield part
                if found.is_last:
                    return
                if (
                    time.monotonic() - spoken >= KEEP_ALIVE
                ):  # or the reader and proxies take us for dead
                    spoken = time.monotonic()
                    yield alive
                if not found.is_more:
                    await asking.until_set(changed, patience)

    def _submit(self, request: model.JobRequest) -> model.Job:
        """The job of a question that may be known, or for which there may be no room."""
        found, is_new = self.store.job(request.id, PART), False
        if found is None or found.is_open or found.is_to_be_asked(request.fresh, time.time()):
            found, is_new = self.store.submit_one(request, self.bounds, PART)
        if not is_new:
            monitoring.of(monitoring.KNOWN, request.kind).inc()
        return found

    def _claim_key(self, client: str, key: str, digest: str) -> None:
        """Refuses an Idempotency-Key that this client sent with something else."""
        if key and not self.store.claim_key(client, key, digest):
            detail = "This Idempotency-Key came with another question or other lines before; send this with a new one."
            raise problems.Refusal(422, "idempotency-key", detail)

    async def wait(self, job: model.Job, viewer: model.Viewer, seconds: float) -> model.Job:
        """The job when it is final, or as it is after so many seconds."""
        with self.hub.waiting(asking.end_of(job.id)) as ended:
            job = await self.job(job.id, viewer) or job
            return await self._until_final(job, viewer, seconds, ended)

    async def _until_final(
        self, job: model.Job, viewer: model.Viewer, seconds: float, ended: asking.Waiting
    ) -> model.Job:
        end = time.monotonic() + seconds
        while job.is_open and (left := end - time.monotonic()) > 0 and not self.hub.closing:
            await asking.until_set(ended, min(left, self.look_again))
            ended.clear()
            job = ended.job or await self.job(job.id, viewer) or job
        return job if len(job.body or b"") <= PART else replace(job, body=None)

    async def dismiss(self, id: str, viewer: model.Viewer) -> model.Job | None:
        """Cancel a job for a client; its process is killed if no other client waits for it."""
        if await self.job(id, viewer) is None:
            return None
        job, is_over = await self.read(self.store.dismiss, id, viewer.name)
        if is_over:
            self.supervisor.cancel(id)
        return job

    def create_batch(
        self, kind: str, viewer: model.Viewer, lines: Sequence[model.BatchLine], key: str
    ) -> model.Batch:
        """The stored batch of these lines; one with cancelled lines is left as it is and a new one
        made. Blocks.
        """
        client = viewer.name
        lines = own_lines(viewer, lines)

        def id_of(generation: int) -> str:
            return statements.batch_id(kind, client, lines, key, generation)

        self._claim_key(client, key, id_of(0) if key else "")
        id, found = self._latest(id_of)
        return found or self.store.create_batch(id, kind, client, lines, self.bounds)

    def _latest(self, id_of: Callable[[int], str]) -> tuple[str, model.Batch | None]:
        """The batch with one of these ids of which nothing was cancelled; where there is none, the
        next free id.
        """
        latest: model.Batch | None = None
        for generation in itertools.count():
            id = id_of(generation)
            found = self.store.batch(id)
            if found is None:
                break
            latest = found
        if latest is None or "dismissed" in latest.counts:
            return id, None
        return latest.id, latest

    async def send_batch(
        self, body: bytes, terms: tasks.Terms, viewer: model.Viewer, key: str = ""
    ) -> model.Batch | None:
        """The batch of these lines, stored as they came and read afterwards; None where there may
        be no room for all.
        """
        try:
            total = len(await self.in_thread(numbers_of, body, terms.most))
        except errors.LimitError as error:
            raise problems.Refusal(413, error.code, error.detail) from None
        return await self.read(self._send, body, total, terms, viewer, key)

    def _send(
        self, body: bytes, total: int, terms: tasks.Terms, viewer: model.Viewer, key: str
    ) -> model.Batch | None:
        kept = {
            "kind": terms.kind, "time_limit": terms.time_limit, "fresh": terms.fresh, "sees_all": viewer.sees_all,
            "client": terms.client,
        }  # fmt: skip
        sent = model.SentBatch("", viewer.name, kept, body)

        def id_of(generation: int) -> str:
            return statements.sent_id(sent, key, generation)

        self._claim_key(viewer.name, key, id_of(0) if key else "")
        # Most are new, which the store finds as it stores them; each look takes a way to the
        # database.
        new = self.store.send_batch(replace(sent, id=id_of(0)), total, self.bounds)
        if new is not None:
            return new
        id, found = self._latest(id_of)
        return found or self.store.send_batch(replace(sent, id=id), total, self.bounds)

    def _note_sent(self, loop: asyncio.AbstractEventLoop, change: model.Change) -> None:
        if change.what == "sent":
            loop.call_soon_threadsafe(self._sent.set)

    async def _unpack(self) -> None:
        """Read the lines of batches that were stored as they came, one batch after the other.

        What a dead service has begun is begun again: lines that are there stay as they are.
        """
        is_first = self.store.exclusive
        while True:
            self._sent.clear()
            try:
                if is_first:
                    await self.read(self.store.free_sent)
                    is_first = False
                sent = await self.read(self.store.take_sent, SENT_LEASE)
                if sent is not None:
                    await self._store_lines(sent)
                    continue
            except Exception:
                log.exception("the lines of a batch wait to be read")
                is_first = self.store.exclusive
            await asking.until_set(self._sent, SENT_EVERY)

    async def _store_lines(self, sent: model.SentBatch) -> None:
        """Store the lines in steps, between which others are served."""
        lines, step = await self._lines_of(sent), self.store.step
        for place in range(0, len(lines), step):
            some, left = lines[place : place + step], max(0, len(lines) - place - step)
            if not await self.read(self.store.add_sent_lines, sent.id, some, left):
                return

    async def _lines_of(self, sent: model.SentBatch) -> list[model.BatchLine]:
        """The lines, read as a whole because an `id` may stand on two; a body that cannot be read
        has problems.
        """
        given = sent.terms
        terms = tasks.Terms(
            given["kind"], self.server_options, given["time_limit"], given["client"], given["fresh"]
        )
        viewer, crashes = model.Viewer(sent.client, given["sees_all"]), 0
        while True:
            try:
                lines = await self.read_body(
                    terms.client, batch_task, sent.body, False, terms, seconds=LONG_DEADLINE
                )
                return own_lines(viewer, lines)
            except (errors.InputError, errors.WorkerFailed, problems.Refusal) as error:
                is_crash = isinstance(error, errors.WorkerFailed)
                crashes += is_crash and not isinstance(error, errors.NoWorker)
                is_over = crashes == model.MAX_CRASHES if is_crash else not is_busy(error)
                if is_over:
                    status, kind = (500, "fault") if is_crash else (422, "limit")
                    numbers = await self.in_thread(numbers_of, sent.body, model.NO_BOUND)
                    return [unread_line(number, error.detail, status, kind) for number in numbers]
            await asyncio.sleep(LOOK_AGAIN)

    async def ask_batch(
        self, body: bytes, is_array: bool, terms: tasks.Terms, viewer: model.Viewer, key: str = ""
    ) -> model.Batch:
        """The stored batch of a body; too many lines are refused with 413."""
        try:
            lines = await self.read_body(
                terms.client, batch_task, body, is_array, terms, seconds=LONG_DEADLINE
            )
            return await self.read(self.create_batch, terms.kind, viewer, lines, key)
        except errors.InputError as error:
            if error.code != "limit":
                raise
            raise problems.Refusal(413, error.code, error.detail) from None

    async def dismiss_batch(self, id: str, viewer: model.Viewer) -> int:
        """Cancel the open jobs of a batch; return how many jobs stopped."""
        if await self.batch(id, viewer) is None:
            return 0
        dismissed = await self.read(self.store.dismiss_batch, id)
        for job in dismissed:
            self.supervisor.cancel(job)
        return len(dismissed)

    async def question(self, body: bytes, terms: tasks.Terms) -> model.JobRequest:
        """The question of a body: a short one that has the form of its schema is read here, any
        other by a worker.
        """
        if len(body) <= SHORT and terms.kind == "solve":
            with suppress(errors.InputError, ValidationError):
                return tasks.ask_task(body, terms, SystemDocument.model_validate)
        return await self.read_body(terms.client, tasks.ask_task, body, terms)

    async def read_body(
        self,
        client: str,
        task: Callable[..., T],
        body: bytes,
        *more: Any,
        late: str = "Reading this document ran into the {} limit; make it smaller.",
        seconds: float = QUICK_DEADLINE,
    ) -> T:
        """What a task of the quick processes makes of a body; raises DocumentRefused, or Refusal at
        a limit.
        """
        return await self.made(client, task, body, *more, late=late, seconds=seconds, status=422)

    async def made(
        self,
        client: str,
        task: Callable[..., T],
        *arguments: Any,
        late: str = "This takes too long for a page; use the JSON result, or try again later.",
        seconds: float = LONG_DEADLINE,
        status: int = 503,
    ) -> T:
        """What a task of the quick processes makes; raises Refusal, saying that it is `late`, at a
        limit.

        A task that did not have its time on a processor says nothing about its document.
        """
        outcome = await self.run_quick(client, task, *arguments, seconds=seconds)
        if outcome.status == "deadline" and outcome.spent.cpu < ITS_TIME * seconds:
            raise problems.Refusal(503, "busy", BUSY, headers={"Retry-After": "2"})
        if outcome.status in tasks.LIMITS:
            raise problems.Refusal(
                status, "busy" if status == 503 else "limit", late.format(outcome.status)
            )
        found: T = tasks.value_of(outcome)
        return found

    async def run_quick(
        self,
        client: str,
        task: Callable[..., Any],
        *arguments: Any,
        seconds: float,
        among_jobs: bool = False,
    ) -> tasks.Outcome:
        """Run a task in one of the quick processes, or `among_jobs`, for `seconds` and more where
        much is given.

        It is cancelled when no one waits for it any more.
        """
        size = sum(len(argument) for argument in arguments if isinstance(argument, bytes))
        deadline = seconds + SECONDS_FOR_A_BYTE * size
        call = tasks.Call(task, arguments, deadline, client=client, patience=PATIENCE)
        executor = self.work_workers if among_jobs else self.quick_workers
        with self.places.hold(client, 1):
            running = executor.submit(call)
            try:
                outcome = await asyncio.wrap_future(running.outcome)
            except asyncio.CancelledError:
                running.cancel()
                raise
        monitoring.of(monitoring.QUICK, task.__name__, outcome.status).inc()
        monitoring.of(monitoring.QUICK_CPU, task.__name__).inc(outcome.spent.cpu)
        return outcome

    async def check(self, client: str, body: bytes) -> dict[str, Any]:
        """The checker's verdict; a long check continues among the jobs, and is incomplete at its
        limit there.
        """
        question = (client, tasks.check_body_task, body)
        outcome = await self.run_quick(*question, seconds=QUICK_DEADLINE)
        if outcome.status == "deadline":
            outcome = await self.run_quick(
                *question, seconds=self.settings.time_limit, among_jobs=True
            )
        return answers.check_document(outcome)

    async def faults(self) -> list[str]:
        """Why the service is not ready; empty if it is."""
        if not self.is_open:
            return ["The service is starting or shutting down."]
        found = []
        if self.hub.closing:
            found.append("The service is stopping.")
        if not self.supervisor.is_working():
            found.append("The supervisor of the jobs is not running.")
        found += {
            fault: None
            for fault in (self.work_workers.fault(), self.quick_workers.fault())
            if fault
        }
        return found + await self._store_faults()

    async def _store_faults(self) -> list[str]:
        """Whether the store can be read and written, checked at most once per READY_KEPT."""
        if self._store_check is None or time.monotonic() - self._store_checked > READY_KEPT:
            self._store_checked = time.monotonic()
            self._store_check = asyncio.ensure_future(self._check_store())
        return await asyncio.shield(self._store_check)

    async def _check_store(self) -> list[str]:
        try:
            async with asyncio.timeout(READY_PATIENCE):
                counts = await self.in_thread(self.store.counts)
                is_drained = await self.in_thread(self.store.is_drained)
                await self.in_thread(self.store.try_to_write)
        except (
            Exception
        ) as error:  # any error of the database, such as a full disk: it is not ready
            log.warning("the store is not ready", exc_info=True)
            said = error.detail if isinstance(error, model.StoreUnavailable) else ""
            return [said or "The store of jobs does not answer, or cannot be written."]
        if is_drained:
            return ["The operator has stopped new jobs from starting."]
        waiting = counts.get("accepted", 0) + counts.get("running", 0)
        return ["The queue of jobs is full."] if waiting >= self.settings.queue else []

    async def _measure_lag(self) -> None:
        """How late the loop is: what it did meanwhile that was not moving bytes."""
        while True:
            began = time.monotonic()
            await asyncio.sleep(LAG_EVERY)
            monitoring.LAG.observe(max(0.0, time.monotonic() - began - LAG_EVERY))

    async def _forget(self) -> None:
        """Forget old answers now and then."""
        cleaner = stores.Cleaner(
            self.store, self.settings.retention_days * 86_400.0, self.settings.store_size * 2**20
        )
        await asyncio.sleep(FIRST_CLEANING)
        while True:
            await self.in_thread(cleaner.clean)
            await asyncio.sleep(BETWEEN_CLEANINGS)
