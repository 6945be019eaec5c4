"""`inverse-service batch`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from inverse_service.cli.exits import ExitCode
from inverse_service.cli.solving import time_limit_or
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.batch import BatchPlan, Summary, run_batch
from inverse_service.service.batch_files import Line, count_lines
from inverse_service.settings import read_settings

Report = Callable[[Line], None]


def batch_file(source: Path, output: Path, workers: int | None, time_limit: float | None) -> ExitCode:
    """Answer every line; exit 0 when every line has its answer, 3 if one of them is a fault of ours."""
    settings = read_settings()
    options = SolveOptions(time_limit=time_limit_or(settings.time_limit, time_limit))
    plan = BatchPlan(source, output, options, workers or settings.workers, settings.memory_limit)
    with _progress(source) as report:
        summary = run_batch(plan, report)
    print(summary_sentence(summary), file=sys.stderr)
    return ExitCode.FAULT if summary.faults else ExitCode.DONE


def summary_sentence(summary: Summary) -> str:
    """One line with all counts."""
    counts = [f"{count} {verdict.replace('_', ' ')}" for verdict, count in sorted(summary.verdicts.items())]
    counts.append(f"{summary.errors} error lines")
    if summary.faults:
        counts.append(f"{summary.faults} faults of the program")
    if summary.skipped:
        counts.append(f"{summary.skipped} answered by an earlier run")
    return ", ".join(counts) + "."


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
