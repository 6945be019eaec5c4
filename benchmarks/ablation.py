"""Measure what each search method is worth: which one finds L, and what is still found without it.

python -m benchmarks ablation --generated 300 --disguised 34 --catalogue --systems FILE.ndjson …

Every system is solved once with all rungs. The run records which of them found something, also in
nested searches, and solves up to --most systems of each such rung again without it. Seconds are
processor time of the whole solution.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

from benchmarks.lagrangians import generated, percentile
from benchmarks.tables import table
from inverse_service import catalogue
from inverse_service.decision.solutions import Solution, SolveOptions, Statement
from inverse_service.expressions.printing import to_text
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.search import ladder
from inverse_service.service.documents.accepting import to_given, to_schema, to_system
from inverse_service.solving.solving import solve_branches

Given = tuple[str, SecondOrderSystem, tuple[Any, ...]]


@dataclass(frozen=True, slots=True)
class Run:
    """One solution: `finders` are the rungs that found something for it, `text` is L as text or
    empty.
    """

    name: str
    text: str
    closed: bool
    family: str
    finders: tuple[str, ...]
    seconds: float

    @property
    def found(self) -> bool:
        return bool(self.text)


def from_entries(entries: Iterable[Mapping[str, Any]]) -> Iterator[Given]:
    """The variational systems among the entries of a list."""
    for entry in entries:
        if "variational" not in {
            entry.get(key) for key in ("expected", "verdict", "verdict_with_time")
        }:
            continue
        keys = ("coordinates", "equations", "parameters", "functions")
        schema = to_schema(
            entry.get("document") or {key: entry[key] for key in keys if key in entry}
        )
        yield entry["id"], to_system(schema), to_given(schema).residuals


def record(given: Given, limit: float) -> Run:
    """The better answer to the two questions, L(q, v) first."""
    name, system, equations = given
    finders: dict[str, None] = {}
    began = time.process_time()
    with observed(finders):
        solution = solve_branches(system, SolveOptions(time_limit=limit, given=equations))[0][0]
    seconds = time.process_time() - began
    answer = best(solution)
    if answer is None or answer.lagrangian is None:
        return Run(name, "", False, "", tuple(finders), seconds)
    closed = answer.hamiltonian is not None and not answer.hamiltonian.transform.implicit
    text = to_text(answer.lagrangian.expression)
    return Run(name, text, closed, answer.lagrangian.family, tuple(finders), seconds)


def best(solution: Solution) -> Statement | None:
    answers = map(solution.answer_to, solution.asked)
    return next((one for one in answers if one is not None and one.lagrangian), None)


@contextmanager
def observed(finders: dict[str, None]) -> Iterator[None]:
    """Record the names of the rungs that find something within the block."""
    plain_attempt = ladder.attempt

    def attempt(state: Any, rung: Any) -> Any:
        found = plain_attempt(state, rung)
        if found is not None:
            finders[rung.name] = None
        return found

    with mock.patch.object(ladder, "attempt", attempt):
        yield


@contextmanager
def without(*names: str) -> Iterator[None]:
    """Run the block without the rungs of these names."""
    kept = tuple(rung for rung in ladder.RUNGS if rung.name not in names)
    with mock.patch.object(ladder, "RUNGS", kept):
        yield


@dataclass(slots=True)
class Row:
    """The results without one rung, for the systems for which it found something."""

    found: int = 0
    tried: int = 0
    lost: list[str] = field(default_factory=list)
    closed_lost: int = 0
    seconds: tuple[float, float] = (0.0, 0.0)
    lengths: tuple[int, int] = (0, 0)

    def add(self, before: Run, after: Run) -> None:
        self.tried += 1
        self.seconds = (self.seconds[0] + before.seconds, self.seconds[1] + after.seconds)
        if not after.found:
            self.lost.append(before.name)
            return
        self.closed_lost += before.closed and not after.closed
        self.lengths = (self.lengths[0] + len(before.text), self.lengths[1] + len(after.text))


def options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks ablation", description=__doc__)
    add_collections(parser)
    parser.add_argument(
        "--most", type=int, default=20, help="systems solved again without a rung (default 20)"
    )
    return parser.parse_args(arguments)


def add_collections(parser: argparse.ArgumentParser) -> None:
    """Add the options that select the systems and their time limit."""
    parser.add_argument("--catalogue", action="store_true", help="the systems of the catalogue")
    parser.add_argument(
        "--systems", nargs="*", default=[], help="lists with one JSON object per line"
    )
    parser.add_argument(
        "--generated", type=int, default=0, help="number of systems of the test generator"
    )
    parser.add_argument(
        "--disguised", type=int, default=0, help="number in other coordinates, for three seeds"
    )
    parser.add_argument(
        "--shapes", type=int, default=0, help="number of systems of its less usual shapes"
    )
    parser.add_argument(
        "--limit", type=float, default=30.0, help="seconds for one system (default 30)"
    )


def given_systems(chosen: argparse.Namespace) -> Iterator[tuple[str, Given]]:
    """(collection, system)."""
    if chosen.catalogue:
        names = catalogue.names()
        entries = [
            {"id": one, **catalogue.entry(one)["expected"], "document": catalogue.document(one)}
            for one in names
        ]
        yield from (("catalogue", given) for given in from_entries(entries))
    for name in chosen.systems:
        lines = Path(name).read_text(encoding="utf-8").splitlines()
        yield from ((Path(name).stem, given) for given in from_entries(map(json.loads, lines)))
    if chosen.generated:
        yield from (("generated", plain(one)) for one in generated(chosen.generated, 7, False))
    if chosen.shapes:
        yield from (
            ("shapes", plain(one)) for one in generated(chosen.shapes, 90210, False, shapes=True)
        )
    for seed in (34, 7, 1) if chosen.disguised else ():
        yield from (("disguised", plain(one)) for one in generated(chosen.disguised, seed, True))


def plain(given: Any) -> Given:
    return given.id, read_system(given.coordinates, given.equations), ()


def main(arguments: Sequence[str] | None = None, report: Callable[[str], None] = print) -> None:
    chosen = options(arguments)
    runs: dict[str, list[Run]] = {}
    rows: dict[str, Row] = {
        rung.name: Row() for rung in sorted(ladder.RUNGS, key=lambda rung: rung.cost)
    }
    for collection, given in given_systems(chosen):
        before = record(given, chosen.limit)
        runs.setdefault(collection, []).append(before)
        line = f"{collection} {before.name}: {before.family or 'no closed form'}, {before.seconds:.2f} s"
        print(line, file=sys.stderr, flush=True)
        for name in before.finders if before.found else ():
            row = rows[name]
            row.found += 1
            if row.tried < chosen.most:
                with without(name):
                    row.add(before, record(given, chosen.limit))
    report(by_collection(runs))
    report(by_rung(rows))


def by_collection(runs: dict[str, list[Run]]) -> str:
    cells = []
    for name, found in runs.items():
        seconds, vain = (
            sorted(one.seconds for one in found),
            sorted(one.seconds for one in found if not one.found),
        )
        counts = [len(found), sum(one.found for one in found), sum(one.closed for one in found)]
        times = [
            statistics.median(seconds),
            percentile(seconds, 0.95),
            percentile(vain, 0.95) if vain else 0.0,
        ]
        cells.append([name, *map(str, counts), *(f"{one:.2f}" for one in times)])
    head = [
        "collection",
        "systems",
        "with L",
        "with H",
        "median, s",
        "95th percentile, s",
        "without L, 95th, s",
    ]
    missing = [one.name for found in runs.values() for one in found if not one.found]
    implicit = [
        one.name for found in runs.values() for one in found if one.found and not one.closed
    ]
    return (
        table(head, cells)
        + f"\nWithout L: {', '.join(missing)}\n\nWithout H: {', '.join(implicit)}\n"
    )


def by_rung(rows: dict[str, Row]) -> str:
    head = [
        "left out",
        "finds",
        "tried without",
        "no L then",
        "H lost",
        "seconds, with and without",
        "length of L",
    ]
    cells = []
    for name, row in rows.items():
        seconds, lengths = (
            f"{pair[0]:.4g} to {pair[1]:.4g}" for pair in (row.seconds, row.lengths)
        )
        counts = [row.found, row.tried, len(row.lost), row.closed_lost]
        cells.append([name, *map(str, counts), seconds, lengths])
    lost = [f"- {name}: {', '.join(row.lost)}" for name, row in rows.items() if row.lost]
    return "\n".join([table(head, cells), *lost])
