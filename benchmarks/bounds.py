"""Measure what each bound is worth: L found, other forms of L, and time with half of it and with
twice as much.

python -m benchmarks bounds --generated 24 --systems FILE.ndjson … [--only NAME …]

The bounds are those of `inverse_service.bounds`, each changed wherever it occurs. Seconds are
processor time of all systems together. If neither half nor twice a bound changes a result, no
measurement fixes that bound.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from unittest import mock

from benchmarks.ablation import Given, Run, add_collections, given_systems, record
from benchmarks.tables import table
from inverse_service import bounds as amounts
from inverse_service.search import ladder
from inverse_service.search.families import Family
from inverse_service.search.ladder import Rung

VALUES: dict[str, int] = {name: value for name, value in vars(amounts).items() if name.isupper()}
# These packages keep results that they computed with other bounds.
KEEP = (
    "decision",
    "search",
    "solving",
    "constrained",
    "explanation",
    "mechanics",
    "expressions",
    "field",
)


@contextmanager
def changed(name: str, value: int) -> Iterator[None]:
    """Give a bound another value within the block, also in the rows of the ansatz, and keep no
    cached results.
    """
    rows = tuple(_changed(rung, VALUES[name], value) for rung in ladder.RUNGS)
    with mock.patch.object(amounts, name, value), mock.patch.object(ladder, "RUNGS", rows):
        forget()
        yield
    forget()


def _changed(rung: Rung, before: int, after: int) -> Rung:
    return replace(rung, terms=after) if isinstance(rung, Family) and rung.terms == before else rung


def forget() -> None:
    """Empty the caches of functions."""
    for place, module in list(sys.modules.items()):
        if place.startswith(tuple(f"inverse_service.{room}" for room in KEEP)):
            for held in list(vars(module).values()):
                getattr(held, "cache_clear", int)()


def told(before: Sequence[Run], after: Sequence[Run]) -> str:
    """The Lagrangians lost, found, and written differently, and the total time."""
    pairs = list(zip(before, after, strict=True))
    lost = [a.name for a, b in pairs if a.found and not b.found]
    found = [a.name for a, b in pairs if b.found and not a.found]
    other = sum(a.found and b.found and a.text != b.text for a, b in pairs)
    parts = (
        [f"-{len(lost)}"] * bool(lost)
        + [f"+{len(found)}"] * bool(found)
        + [f"{other} otherwise"] * bool(other)
    )
    seconds = sum(one.seconds for one in after) / sum(one.seconds for one in before)
    return f"{', '.join(parts) or 'same'}; {seconds:.2f}"


def main(arguments: Sequence[str] | None = None, report: Callable[[str], None] = print) -> None:
    """The table, a row for each bound."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks bounds", description=__doc__)
    add_collections(parser)
    parser.add_argument("--only", nargs="*", default=[], help="these bounds alone")
    parser.add_argument(
        "--part",
        default="0/1",
        help="k/n: the k-th of n parts of the bounds, for several processes",
    )
    chosen = parser.parse_args(arguments)
    systems: list[Given] = [given for _, given in given_systems(chosen)]
    for given in systems:
        record(given, chosen.limit)  # compiles and loads what it needs
    forget()
    before = [record(given, chosen.limit) for given in systems]
    part, parts = map(int, chosen.part.split("/"))
    cells = []
    for name in [name for name in VALUES if not chosen.only or name in chosen.only][part::parts]:
        row = [name, f"{VALUES[name]:,}"]
        for value in (VALUES[name] // 2, 2 * VALUES[name]):
            with changed(name, value):
                row.append(told(before, [record(given, chosen.limit) for given in systems]))
        print(" | ".join(row), file=sys.stderr, flush=True)
        cells.append(row)
    report(f"{len(systems)} systems, {sum(one.seconds for one in before):.1f} s\n")
    report(table(["bound", "value", "half: L; time", "twice: L; time"], cells))
