"""How often each move of `mechanics.moves` changes a formula: `python -m benchmarks moves
[--documents N]`.

The documents are those of the corpus that are not slow, evenly from each file. `--off NAME` leaves
a move out.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import inverse_service
from inverse_service import errors
from inverse_service.decision import certify
from inverse_service.mechanics import first_integrals, legendre, moves
from inverse_service.search import tidy

Listed = tuple[moves.Move[Any] | moves.Form[Any], ...]
TABLES: dict[str, Listed] = {
    "L, gauges": tidy.GAUGES,
    "L, forms": tidy.FORMS,
    "L, style": tidy.STYLE,
    "H": legendre.ENERGY,
    "integrals": first_integrals.INTEGRALS,
    "integrals, style": first_integrals.STYLE,
    "domains": certify.DOMAINS,
}
FILES = (
    "textbook",
    "books",
    "search",
    "pairs",
    "literature",
    "kamke",
    "generated",
    "tables",
    "branches",
    "identities",
)
LIMIT = 10.0  # s of processor time for one document


def documents(number: int) -> list[Any]:
    """So many documents of the corpus, evenly from its files."""
    from tests.doors.rows import rows

    found: list[Any] = []
    for name in FILES:
        quick = [
            row["document"]
            for row in rows(name)
            if "document" in row and not {"slow", "nightly"} & set(row)
        ]
        wanted = max(1, number // len(FILES))
        found += quick[:: max(1, len(quick) // wanted)][:wanted]
    return found


def table(asked: Sequence[Mapping[str, Any]], off: Sequence[str]) -> str:
    """A Markdown table: move, in what it keeps the formula, how many trees it changed or was chosen
    for.
    """
    with ExitStack() as stack:
        stack.enter_context(moves.without(*off))
        counts = stack.enter_context(moves.counted())
        for document in asked:
            try:
                inverse_service.solve(document, time_limit=LIMIT)
            except errors.InputError:
                continue
    lines = [
        f"| of | move | holds | changes in {len(asked)} documents |",
        "| --- | --- | --- | ---: |",
    ]
    for of, listed in TABLES.items():
        lines += [f"| {of} | {one.name} | {one.holds} | {counts[one]} |" for one in listed]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks moves", description=__doc__)
    parser.add_argument("--documents", type=int, default=200)
    parser.add_argument(
        "--off", action="append", default=[], help="the name of a move (may be repeated)"
    )
    options = parser.parse_args(arguments)
    print(table(documents(options.documents), options.off))
