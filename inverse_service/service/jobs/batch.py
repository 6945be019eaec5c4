"""Many systems: every line of a file answered exactly once, in parallel, also after a kill.

The output file is the truth of what is done. The jobs run on the same supervisor as those of the
service, over a store in the temporary folder that lives as long as the run (`jobs/locks.py`).
"""

from __future__ import annotations

import contextlib
import itertools
import json
import queue
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from inverse_service.errors import InputError
from inverse_service.service.jobs.batch_files import BatchTerms, Line, batch_line, open_source, read_lines
from inverse_service.service.jobs.batch_output import Known, Output, answer_line, error_line, key_of, open_output
from inverse_service.service.jobs.batches import BatchAnswer
from inverse_service.service.jobs.locks import DATABASE, temporary_folder
from inverse_service.service.jobs.model import NO_BOUND, Job, JobOptions
from inverse_service.service.jobs.sqlite_store import SqliteStore
from inverse_service.service.jobs.supervisor import Supervisor
from inverse_service.service.jobs.workers import Executor, Workers

# Jobs that are open at the same time, for each worker: enough that none waits for a line to be read.
AHEAD = 8
# So many error lines at the beginning, and nothing else, are a file of another kind.
UNUSABLE = 10  # error lines, where there are no others
# What `again` names, as answers are counted.
AGAIN = {"errors": ("error", "fault"), "undetermined": ("undetermined",)}


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """What to do with each line of `source`, and where answers go; `cluster`: a Dask scheduler; `kind`: solve or check.

    `again`: which answers of an earlier run do not count, some of "errors" and "undetermined".
    """

    source: Path
    output: Path
    options: JobOptions
    workers: int
    cluster: str | None = None
    again: frozenset[str] = frozenset()
    kind: str = "solve"


@dataclass(slots=True)
class Summary:
    """Lines by what their answers are counted as, and the first reason of each kind; those of earlier runs included."""

    labels: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)
    earlier: int = 0
    duplicates: int = 0
    replaced: bool = False

    def count(self, answer: Known) -> None:
        """One more line is answered."""
        self.labels[answer.label] += 1
        if answer.reason:
            self.first.setdefault(answer.label, answer.reason)

    @property
    def new(self) -> int:
        """Lines that this run answered."""
        return self.labels.total() - self.earlier


def run_batch(plan: BatchPlan, summary: Summary, report: Callable[[Line], None] = lambda line: None) -> None:
    """Answer every line of the source that the output does not answer yet, one line each.

    Answers come in the order in which they are done; `summary` counts them, `report` is called once a line.
    Raises InputError where the files cannot be used, or nothing but error lines begins the input.
    """
    if plan.output.exists() and plan.source.exists() and plan.output.samefile(plan.source):
        raise InputError("The output file is the input file; choose another one for --output.")
    with open_source(plan.source) as source, open_output(plan.output) as output:
        run = _Run(plan.again, output, summary, report)
        lines = run.open_lines(read_lines(source))
        first = next(lines, None)
        if first is not None:
            with _engine(plan) as engine:
                for line, answer in engine.answers(itertools.chain((first,), lines)):
                    run.count(line, output.add(answer))
                summary.duplicates = engine.duplicates
                run.refuse_all_bad()
        summary.replaced = output.superseded


class _Run:
    """Which lines are open, and whether any of them could be read."""

    def __init__(self, again: frozenset[str], output: Output, summary: Summary, report: Callable[[Line], None]) -> None:
        self._again = frozenset(label for name in again for label in AGAIN[name])
        self._output, self._summary, self._report = output, summary, report
        self._earlier = dict(output.known)
        self._begun = False
        self._bad = self._good = 0

    def open_lines(self, lines: Iterator[Line]) -> Iterator[Line]:
        """The lines without an answer that counts: of this very question, and not one to be asked again."""
        for line in lines:
            if not self._begun:
                _refuse_other_layouts(line)
            self._begun = True
            answer = self._earlier.get(key_of(line))
            if answer is None or answer.digest != line.digest or answer.label in self._again:
                yield line
            else:
                self._summary.earlier += 1
                self.count(line, answer)

    def count(self, line: Line, answer: Known) -> None:
        """A line is answered."""
        self._summary.count(answer)
        self._report(line)
        self._bad += answer.label == "error"
        self._good += answer.label != "error"

    def refuse_all_bad(self) -> None:
        """InputError where ten lines or more are error lines, and all are: the input has another layout."""
        if self._bad >= UNUSABLE and not self._good:
            raise InputError(f"All {self._bad} lines are error lines; the first says: {self._summary.first['error']}")


def _refuse_other_layouts(line: Line) -> None:
    if line.raw.startswith(b"["):
        raise InputError("The input is a JSON array; write one document a line, as 'jq -c .[] FILE' does.")
    if line.raw == b"{":
        raise InputError("A document takes several lines; write one document a line, as 'jq -c . FILE' does.")


class BatchEngine:
    """Hands lines over to the supervisor, a bounded number at a time, and takes the answers."""

    def __init__(self, store: SqliteStore, options: JobOptions, executor: Executor, kind: str = "solve") -> None:
        self._store, self._executor = store, executor
        self._terms = BatchTerms(kind, options, options, "", NO_BOUND, False)
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
        asked = batch_line(line, self._terms)
        if (request := asked.request) is None:
            problem = json.loads(asked.problem or b"")
            yield line, error_line(line.number, asked.identifier, problem, line.duplicate_of, line.digest)
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
    with temporary_folder() as folder:
        store = SqliteStore(folder / DATABASE, durable=False)
        working = _executor(plan)
        try:
            working.start()
            supervisor = Supervisor(store, working)
            engine = BatchEngine(store, plan.options, working, plan.kind)
            supervisor.start()
            try:
                yield engine
            finally:
                supervisor.stop()
        finally:
            working.stop()
            store.close()


def _executor(plan: BatchPlan) -> Executor:
    if plan.cluster is None:
        return Workers(plan.workers, plan.options.memory_limit)
    from inverse_service.service.jobs.opening import open_cluster

    return open_cluster(plan.cluster, plan.options.memory_limit)


def _answer(line: Line, job: Job) -> bytes:
    identifier = json.dumps(line.identifier)
    return answer_line(BatchAnswer(line.number, identifier, job.status, job.body, digest=line.digest))
