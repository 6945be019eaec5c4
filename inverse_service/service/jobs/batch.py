"""Many systems: every line of a file answered exactly once, in parallel, also after a kill.

The output file is the truth of what is done. The jobs run on the same supervisor as those of the
service, over a store in the temporary folder that lives as long as the run (`jobs/temporary.py`).
"""

from __future__ import annotations

import contextlib
import json
import queue
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from inverse_service.errors import InputError
from inverse_service.service.documents.problem_documents import of_input_error
from inverse_service.service.jobs.asking import request_of
from inverse_service.service.jobs.batch_files import Line, finished_keys, read_lines
from inverse_service.service.jobs.line_answers import answer_line, error_line
from inverse_service.service.jobs.model import BULK, BatchAnswer, Job
from inverse_service.service.jobs.options import JobOptions, read_options, split_options
from inverse_service.service.jobs.sqlite_store import SqliteStore
from inverse_service.service.jobs.supervisor import Supervisor
from inverse_service.service.jobs.temporary import temporary_database
from inverse_service.service.jobs.workers import Executor, Workers

# Jobs that are open at the same time, for each worker: enough that none waits for a line to be read.
AHEAD = 8


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """What to do with each line of `source`, and where answers go; `cluster`: a Dask scheduler."""

    source: Path
    output: Path
    options: JobOptions
    workers: int
    cluster: str | None = None


@dataclass(slots=True)
class Summary:
    """Counts of a run: by verdict, error lines, faults of ours, lines answered by an earlier run."""

    verdicts: Counter[str] = field(default_factory=Counter)
    errors: int = 0
    faults: int = 0
    skipped: int = 0
    duplicates: int = 0


def run_batch(plan: BatchPlan, report: Callable[[Line], None] = lambda line: None) -> Summary:
    """Answer every line of the source that the output does not answer yet, one line each.

    Answers come in the order in which they are done. `report` is called once a line. Raises
    InputError where the files cannot be used; a bad line is an error line, not an exception.
    """
    _refuse_same_file(plan)
    summary = Summary()
    with plan.source.open("rb") as source, _locked_output(plan.output) as output:
        lines = _open_lines(read_lines(source), finished_keys(plan.output), summary, report)
        first = next(lines, None)
        if first is None:
            return summary
        with _engine(plan) as engine:
            for line, answer in engine.answers(_chained(first, lines)):
                output.write(answer)
                _count(summary, json.loads(answer))
                report(line)
            summary.duplicates = engine.duplicates
    return summary


class BatchEngine:
    """Hands lines over to the supervisor, a bounded number at a time, and takes the answers."""

    def __init__(self, store: SqliteStore, options: JobOptions, executor: Executor) -> None:
        self._store, self._options, self._executor = store, options, executor
        self._changed: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._open: dict[str, list[Line]] = {}
        self.duplicates = 0
        store.on_change(self._changed.put)

    def answers(self, lines: Iterator[Line]) -> Iterator[tuple[Line, bytes]]:
        """Each line with its answer, as they come."""
        for line in lines:
            yield from self._submit(line)
            # Asked each time: a cluster grows and shrinks while it works.
            while len(self._open) >= AHEAD * self._executor.capacity:
                yield from self._finished()
        while self._open:
            yield from self._finished()

    def _submit(self, line: Line) -> Iterator[tuple[Line, bytes]]:
        try:
            if line.fault is not None:
                raise line.fault
            document, given = split_options(line.document)
            request = request_of("solve", document, read_options(given, self._options), priority=BULK)
        except InputError as error:
            problem = of_input_error(error)
            yield line, error_line(line.number, json.dumps(line.identifier), problem, line.duplicate_of)
            return
        known = self._store.job(request.id)
        self.duplicates += known is not None
        if known is not None and known.is_final:
            yield line, _answer(line, known)
            return
        self._open.setdefault(request.id, []).append(line)
        if known is None:
            self._store.submit([request])

    def _finished(self) -> Iterator[tuple[Line, bytes]]:
        id = self._changed.get()
        job = self._store.job(id) if id in self._open else None
        if job is not None and job.is_final:
            for line in self._open.pop(id):
                yield line, _answer(line, job)


@contextlib.contextmanager
def _engine(plan: BatchPlan) -> Iterator[BatchEngine]:
    """A store, a supervisor and its processes for the time of one run."""
    with temporary_database() as database:
        store = SqliteStore(database, durable=False)
        quick = Workers(1, plan.options.memory_limit)
        working = _executor(plan)
        try:
            working.start()
            quick.start()
            supervisor = Supervisor(store, working, quick)
            engine = BatchEngine(store, plan.options, working)
            supervisor.start()
            try:
                yield engine
            finally:
                supervisor.stop()
        finally:
            working.stop()
            quick.stop()
            store.close()


def _executor(plan: BatchPlan) -> Executor:
    if plan.cluster is None:
        return Workers(plan.workers, plan.options.memory_limit)
    from inverse_service.service.cluster.opening import open_cluster

    return open_cluster(plan.cluster, plan.options.memory_limit)


def _chained(first: Line, rest: Iterator[Line]) -> Iterator[Line]:
    yield first
    yield from rest


def _answer(line: Line, job: Job) -> bytes:
    return answer_line(BatchAnswer(line.number, json.dumps(line.identifier), job.status, job.body, 0))


def _open_lines(
    lines: Iterator[Line], done: set[str], summary: Summary, report: Callable[[Line], None]
) -> Iterator[Line]:
    for line in lines:
        if line.key in done:
            summary.skipped += 1
            report(line)
        else:
            yield line


def _count(summary: Summary, answer: dict[str, Any]) -> None:
    if "error" not in answer:
        summary.verdicts[answer["verdict"]] += 1
    elif answer["error"]["status"] >= 500:
        summary.faults += 1
    else:
        summary.errors += 1


def _refuse_same_file(plan: BatchPlan) -> None:
    if not plan.source.is_file():
        raise InputError("The input file of the batch does not exist or is not a file; give one system a line in it.")
    if plan.output.exists() and plan.output.samefile(plan.source):
        raise InputError("The output file is the input file; choose another one for --output.")


@contextlib.contextmanager
def _locked_output(path: Path) -> Iterator[IO[bytes]]:
    """The output, open for appending without a buffer, for this process alone."""
    try:
        stream = path.open("ab", buffering=0)
    except OSError as error:
        raise InputError(f"The output file cannot be written: {error.strerror}.") from None
    with stream:
        _lock(stream)
        yield stream


def _lock(stream: IO[bytes]) -> None:
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise InputError("Another batch is writing to the output file; wait for it or choose another file.") from None
