"""Many systems: every line of a file answered exactly once, in parallel, also after a kill."""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from inverse_service.errors import InputError, WorkerFailed
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.answers import result_document
from inverse_service.service.batch_files import Line, finished_keys, read_lines
from inverse_service.service.outcome import Outcome
from inverse_service.service.refusals import DocumentRefused
from inverse_service.service.submitting import submit_solve
from inverse_service.service.workers import Workers


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """What to do with each line of `source`, and where answers go."""

    source: Path
    output: Path
    options: SolveOptions
    workers: int
    memory_limit: int


@dataclass(slots=True)
class Summary:
    """Counts of a run: by verdict, error lines, faults of ours, lines answered by an earlier run."""

    verdicts: Counter[str] = field(default_factory=Counter)
    errors: int = 0
    faults: int = 0
    skipped: int = 0


def run_batch(plan: BatchPlan, report: Callable[[Line], None] = lambda line: None) -> Summary:
    """Answer every line of the source that the output does not answer yet, one line each.

    Answers come in the order in which they are done. `report` is called once a line. Raises
    InputError where the files cannot be used; a bad line is an error line, not an exception.
    """
    _refuse_same_file(plan)
    summary = Summary()
    with plan.source.open("rb") as source, _locked_output(plan.output) as output:
        done = finished_keys(plan.output)
        workers = Workers(plan.workers, plan.memory_limit)
        try:
            for line, answer in _answers(_open_lines(read_lines(source), done, summary, report), workers, plan):
                output.write(json.dumps(answer, ensure_ascii=False, allow_nan=False).encode() + b"\n")
                _count(summary, answer)
                report(line)
        finally:
            workers.stop()
    return summary


def _answers(lines: Iterator[Line], workers: Workers, plan: BatchPlan) -> Iterator[tuple[Line, dict[str, Any]]]:
    """Answers as they come; a bounded number of lines is under way, so memory stays bounded."""
    under_way: dict[Future[Outcome], Line] = {}
    for line in lines:
        if line.fault is not None:
            yield line, error_line(line, line.fault)
            continue
        workers.start()
        under_way[submit_solve(workers, workers, line.document, plan.options)] = line
        if len(under_way) >= 2 * plan.workers:
            yield from _finished(under_way, plan)
    while under_way:
        yield from _finished(under_way, plan)


def _finished(under_way: dict[Future[Outcome], Line], plan: BatchPlan) -> Iterator[tuple[Line, dict[str, Any]]]:
    ready, _ = wait(under_way, return_when=FIRST_COMPLETED)
    for future in ready:
        line = under_way.pop(future)
        yield line, answer_line(line, future.result(), plan)


def answer_line(line: Line, outcome: Outcome, plan: BatchPlan) -> dict[str, Any]:
    """The result with the id of its line in front, or an error line."""
    try:
        result = result_document(outcome, plan.options, plan.memory_limit)
    except (DocumentRefused, WorkerFailed) as error:
        return error_line(line, error)
    return {"id": line.identifier, "line": line.number, **result}


def error_line(line: Line, error: InputError | WorkerFailed) -> dict[str, Any]:
    """`error` is shaped like a problem document: detail, and the places of the faults."""
    places: tuple[Any, ...] = getattr(error, "places", ())
    if isinstance(error, InputError) and not places:
        places = (error,)
    answer: dict[str, Any] = {"id": line.identifier, "line": line.number}
    if line.duplicate_of is not None:
        answer["duplicate_of"] = line.duplicate_of
    answer["error"] = {
        "type": error.code,
        "detail": f"Line {line.number}: {error.detail}",
        "errors": [{"pointer": place.pointer, "column": place.column, "detail": place.detail} for place in places],
    }
    return answer


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
    elif answer["error"]["type"] == WorkerFailed.code:
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
