"""Run many cases on all cores; each outcome is a line of a file, and cases with a line are not
repeated.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.soundness.cases import run_case

Line = dict[str, Any]
Task = tuple[str, int, int]
_EVERY = 5.0


def run(
    counts: Mapping[str, int], seed: int, folder: Path, processes: int | None = None
) -> list[Line]:
    """All outcomes of the kinds and counts, including those of earlier runs with this seed."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"cases-{seed}.ndjson"
    known = {(line["kind"], line["index"]): line for line in _read(path)}
    wanted = [(kind, index) for kind, count in counts.items() for index in range(count)]
    # All kinds progress together, so the outcomes of an interrupted run are a fair sample.
    ordered = sorted(wanted, key=lambda case: case[1] / counts[case[0]])
    open_tasks = [(kind, seed, index) for kind, index in ordered if (kind, index) not in known]
    with path.open("a", encoding="utf-8") as file:
        for line in _shown(
            _outcomes(open_tasks, processes or os.cpu_count() or 1), len(open_tasks)
        ):
            file.write(json.dumps(line) + "\n")
            file.flush()
            known[line["kind"], line["index"]] = line
    return [known[key] for key in wanted]


def done(counts: Mapping[str, int], seed: int, folder: Path) -> list[Line]:
    """The outcomes so far of an unfinished campaign."""
    order = {kind: place for place, kind in enumerate(counts)}
    lines = [
        line
        for line in _read(folder / f"cases-{seed}.ndjson")
        if line["index"] < counts.get(line["kind"], 0)
    ]
    return sorted(lines, key=lambda line: (order[line["kind"]], line["index"]))


def _read(path: Path) -> list[Line]:
    """The lines of earlier runs; an incomplete last line is removed."""
    if not path.exists():
        return []
    whole = path.read_text(encoding="utf-8")
    kept = whole[: whole.rfind("\n") + 1]
    if kept != whole:
        path.write_text(kept, encoding="utf-8")
    return [json.loads(line) for line in kept.splitlines()]


def _outcomes(tasks: list[Task], processes: int) -> Iterator[Line]:
    if processes == 1:
        yield from map(_one, tasks)
        return
    with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=500) as pool:
        yield from pool.imap_unordered(_one, tasks, chunksize=5)


def _one(task: Task) -> Line:
    return run_case(*task).document()


def _shown(lines: Iterator[Line], total: int) -> Iterator[Line]:
    """The same lines, with progress on standard error; a wrong verdict is reported at once."""
    last, wrong = time.monotonic(), 0
    for count, line in enumerate(lines, start=1):
        wrong += len(line["wrong"])
        for sentence in line["wrong"]:
            print(f"WRONG {line['kind']} {line['index']}: {sentence}", file=sys.stderr, flush=True)
        if time.monotonic() > last + _EVERY or count == total:
            last = time.monotonic()
            print(
                f"{count} of {total} cases, {wrong} wrong, now {line['kind']}",
                file=sys.stderr,
                flush=True,
            )
        yield line
