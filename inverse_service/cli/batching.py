"""`inverse-service batch`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from inverse_service.cli.exits import ExitCode
from inverse_service.cli.solving import time_limit_or
from inverse_service.service.jobs.batch import BatchPlan, Summary, run_batch
from inverse_service.service.jobs.batch_files import Line, count_lines
from inverse_service.service.jobs.options import JobOptions
from inverse_service.settings import read_settings

Report = Callable[[Line], None]


def batch_file(
    source: Path, output: Path, workers: int | None, time_limit: float | None, cluster: str | None = None
) -> ExitCode:
    """Answer every line; exit 0 when every line has its answer, 3 if one of them is a fault of ours."""
    settings = read_settings()
    options = JobOptions(time_limit_or(settings.time_limit, time_limit), settings.memory_limit)
    plan = BatchPlan(source, output, options, workers or settings.workers, cluster or settings.cluster)
    began = time.monotonic()
    with _progress(source) as report:
        summary = run_batch(plan, report)
    _show(summary, time.monotonic() - began)
    return ExitCode.FAULT if summary.faults else ExitCode.DONE


def rows_of(summary: Summary) -> list[tuple[str, int]]:
    """What was counted, with its names."""
    rows = [(verdict.replace("_", " "), count) for verdict, count in sorted(summary.verdicts.items())]
    if summary.errors or not summary.skipped:
        rows.append(("error line" if summary.errors == 1 else "error lines", summary.errors))
    others = (
        ("faults of the program", summary.faults),
        ("answered by an earlier run", summary.skipped),
        ("computed once with another line", summary.duplicates),
    )
    return rows + [(name, count) for name, count in others if count]


def summary_sentence(summary: Summary) -> str:
    """One line with all counts."""
    return ", ".join(f"{count} {name}" for name, count in rows_of(summary)) + "."


def _show(summary: Summary, seconds: float) -> None:
    """A table on a terminal, one sentence elsewhere."""
    if not sys.stderr.isatty():
        print(summary_sentence(summary), file=sys.stderr)
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("lines", "", title="Batch", caption=f"{seconds:.1f} s")
    for name, count in rows_of(summary):
        table.add_row(name, str(count))
    Console(stderr=True).print(table)


@contextmanager
def _progress(source: Path) -> Iterator[Report]:
    """A progress bar on a terminal, silence elsewhere."""
    if not sys.stderr.isatty() or not source.is_file():
        yield lambda line: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("systems", total=count_lines(source))
        yield lambda line: progress.update(task, completed=line.number)
