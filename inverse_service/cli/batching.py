"""`inverse-service batch` and `table`."""

from __future__ import annotations

import csv
import io
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from inverse_service.cli import exits, solve_command
from inverse_service.errors import InputError
from inverse_service.service.jobs import batch
from inverse_service.service.jobs.model import JobOptions
from inverse_service.settings import read_settings

Report = Callable[[batch.Line], None]
# Off a terminal, one line so often says how far the batch is; s.
BETWEEN_LINES = 60.0
NAMES = {"error": ("error line", "error lines"), "fault": ("fault of the program", "faults of the program")}


def batch_file(
    source: Path,
    output: Path,
    workers: int | None,
    time_limit: float | None,
    cluster: str | None = None,
    again: str = "",
    expected: Path | None = None,
    junit: Path | None = None,
) -> exits.ExitCode:
    """Answer every line; how it ended is the exit code of the contract.

    `expected`: answers that these lines should have; those that differ are printed, and the code is 1. `junit`: a file
    for the report.
    """
    if (expected or junit) and str(output) == "-":
        raise InputError("--expect and --junit read the output again: give a file with --output.")
    settings = read_settings()
    options = JobOptions(solve_command.time_limit_or(settings.time_limit, time_limit), settings.memory_limit)
    kinds = _kinds(again)
    plan = batch.BatchPlan(source, output, options, workers or settings.workers, cluster or settings.cluster, kinds)
    summary, began = batch.Summary(), time.monotonic()
    # Schedulers end a job by SIGTERM: it is the same as Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    total = batch.count_lines(source)
    solve_command.warm_alone(settings.memory_limit)
    try:
        with progress(summary, total) as report:
            batch.run_batch(plan, summary, report)
    except KeyboardInterrupt:
        print(f"{_how_far(summary, total)}; the same command goes on where it was.", file=sys.stderr)
        return exits.ExitCode.INTERRUPTED
    _show(summary, plan, time.monotonic() - began)
    code = exits.ExitCode.FAULT if summary.labels["fault"] else exits.ExitCode(min(1, summary.labels["error"]))
    return code if expected is None and junit is None else _compared(output, expected, junit, code)


def _compared(output: Path, expected: Path | None, junit: Path | None, code: exits.ExitCode) -> exits.ExitCode:
    from inverse_service.cli.expecting import judged, write_junit

    lines = list(judged(output, expected))
    if junit is not None:
        write_junit(junit, lines)
    differ = [line for line in lines if line.differences]
    exits.write("".join(f"{line.name}: {difference}\n" for line in differ for difference in line.differences))
    if expected is None:
        return code
    errors = any(line.error for line in lines)
    return exits.ExitCode.FAULT if code is exits.ExitCode.FAULT else exits.ExitCode(int(bool(differ) or errors))


def _kinds(again: str) -> frozenset[str]:
    kinds = frozenset(part.strip() for part in again.split(",") if part.strip())
    if not kinds <= batch.AGAIN.keys():
        raise InputError(f"--again takes {' and '.join(batch.AGAIN)}, with a comma between them.")
    return kinds


def rows_of(summary: batch.Summary) -> list[tuple[str, int]]:
    """What was counted, with its names; error lines also where there are none."""
    counts = summary.labels | {"error": summary.labels["error"]}
    order = sorted(counts, key=lambda label: (label in NAMES, label))
    rows = [(NAMES.get(label, (label.replace("_", " "),) * 2)[counts[label] != 1], counts[label]) for label in order]
    others = (
        ("answered by an earlier run", summary.earlier),
        ("computed once with another line", summary.duplicates),
    )
    return rows + [(name, count) for name, count in others if count]


def summary_sentences(summary: batch.Summary, seconds: float) -> list[str]:
    """All counts, the rate, and the first reason of what has no verdict."""
    sentences = [", ".join(f"{count} {name}" for name, count in rows_of(summary)) + "."]
    if summary.new:
        lines = "line" if summary.new == 1 else "lines"
        sentences.append(f"{summary.new} {lines} in {seconds:.1f} s, {summary.new / seconds:.3g} a second.")
    for label in ("undetermined", "error", "fault"):
        if label in summary.first:
            sentences.append(f"The first {NAMES.get(label, (label,))[0]}: {summary.first[label]}")
    return sentences


def _show(summary: batch.Summary, plan: batch.BatchPlan, seconds: float) -> None:
    """A table on a terminal, sentences elsewhere."""
    sentences = summary_sentences(summary, seconds)
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.table import Table

        table = Table("lines", "", title="Batch", caption=f"{seconds:.1f} s")
        for name, count in rows_of(summary):
            table.add_row(name, str(count))
        Console(stderr=True).print(table)
        sentences = sentences[1:]
    if summary.replaced:
        sentences.append(f"Answers that were replaced are in {batch.replaced_path(plan.output)}.")
    print("\n".join(sentences), file=sys.stderr)


def _how_far(summary: batch.Summary, total: int | None) -> str:
    of_all = "" if total is None else f" of {total}"
    return f"{summary.labels.total()}{of_all} lines answered"


@contextmanager
def progress(summary: batch.Summary, total: int | None) -> Iterator[Report]:
    """A progress bar on a terminal, a line every minute elsewhere."""
    if not sys.stderr.isatty():
        said = time.monotonic()

        def say(line: batch.Line) -> None:
            nonlocal said
            if time.monotonic() - said > BETWEEN_LINES:
                said = time.monotonic()
                print(f"{_how_far(summary, total)}.", file=sys.stderr)

        yield say
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("systems", total=total)
        yield lambda line: progress.update(task, completed=line.number)


def write_table(path: Path) -> exits.ExitCode:
    """Print one row of CSV for each line of a batch's output; raises InputError for a line that is no answer."""
    from inverse_service.sympy.result_objects import row_of  # for this command only

    with batch.open_source(path) as source:
        for place, (_, answer) in enumerate(batch.read_answers(source)):
            row, text = row_of(answer), io.StringIO()
            writer = csv.DictWriter(text, list(row))
            if place == 0:
                writer.writeheader()
            writer.writerow(row)
            exits.write(text.getvalue())
    return exits.ExitCode.DONE
