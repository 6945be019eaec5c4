"""Solve a list of documents: how many get L and H in closed form, in what time, and which do not.

python -m benchmarks collection FILE.ndjson … [--limit 30] [--only NAME …]

A line is an entry with "id" and "expected", and a document under "document" or in its own keys;
those that are not expected to be variational are omitted. Both questions are solved, and the result
that is shown first counts. Seconds are processor time from the document to the result, so other
programs do not count.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.lagrangians import percentile
from benchmarks.tables import MISSING, table
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import stated
from inverse_service.service.documents.documents import solve_document

_KEYS = ("coordinates", "equations", "parameters", "functions")


@dataclass(frozen=True, slots=True)
class Answered:
    """One document: the first L that is shown (empty if there is none), whether it contains
    integral signs, and H.
    """

    name: str
    verdicts: str
    lagrangian: str
    integral: bool
    hamiltonian: bool
    seconds: float


def answered(entry: Mapping[str, Any], limit: float) -> Answered:
    """Solve one document. Raises InputError if it cannot be parsed."""
    document = entry.get("document") or {key: entry[key] for key in _KEYS if key in entry}
    began = time.process_time()
    result = solve_document(document, SolveOptions(time_limit=limit))
    seconds = time.process_time() - began
    answers = [one.part for one in stated.main_statements(result)]
    first = next((answer for answer in answers if answer["lagrangian"]), None)
    verdicts = ", ".join(dict.fromkeys(answer["verdict"] for answer in answers))
    if first is None:
        return Answered(entry["id"], verdicts, "", False, False, seconds)
    closed = bool(first["hamiltonian"]) and not first["hamiltonian"]["implicit"]
    text = first["lagrangian"]["text"]
    return Answered(entry["id"], verdicts, text, bool(result.get("integrals")), closed, seconds)


def entries(files: Iterable[Path], only: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """The variational entries of the files, restricted to the names in `only` if any are given."""
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            if entry.get("expected", entry.get("verdict_with_time")) == "variational" and (
                not only or entry["id"] in only
            ):
                yield entry


def markdown(measured: Sequence[Answered]) -> str:
    """One table over all of them, and the documents without L and without H in closed form."""
    found = [one for one in measured if one.lagrangian]
    vain = [one for one in measured if not one.lagrangian]
    cells = [_cells("with L", found), _cells("without L", vain), _cells("all", measured)]
    head = [
        "documents",
        "number",
        "integral signs",
        "H in closed form",
        "median, s",
        "95th percentile, s",
        "largest, s",
    ]
    implicit = [
        f"- {one.name}: H is implicit, L = {one.lagrangian}" for one in found if not one.hamiltonian
    ]
    without = [f"- {one.name}: no L, {one.verdicts}, {one.seconds:.1f} s" for one in vain]
    return "\n".join([table(head, cells), *implicit, *without])


def _cells(words: str, rows: Sequence[Answered]) -> list[str]:
    seconds = sorted(one.seconds for one in rows)
    times = [statistics.median(seconds), percentile(seconds, 0.95), seconds[-1]] if seconds else []
    counts = [len(rows), sum(one.integral for one in rows), sum(one.hamiltonian for one in rows)]
    return [words, *map(str, counts), *([f"{value:.2f}" for value in times] or [MISSING] * 3)]


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks collection", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+", help="lists of documents, one per line")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds for one document (default 60)"
    )
    parser.add_argument(
        "--only", nargs="*", default=[], help="names of the entries that are measured"
    )
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None, report: Callable[[str], None] = print) -> None:
    chosen = options(arguments)
    measured: list[Answered] = []
    for entry in entries(chosen.files, chosen.only):
        if not measured:
            answered(entry, chosen.limit)  # loads the compiled kernels
        measured.append(answered(entry, chosen.limit))
        last = measured[-1]
        print(
            f"{last.name}: {last.lagrangian or 'no L'}, {last.seconds:.2f} s",
            file=sys.stderr,
            flush=True,
        )
    report(markdown(measured))
