"""Which rows the default tests run: `python -m tests.doors.choosing [readings] [systems]`.

Rows that are new since are default until the command runs again, which takes some minutes.

Of the texts that are read, those that together run each branch of the package, from one line to the
next, OFTEN times, if so many run it, and take the least time; the choice stands in
corpus/quick.json. Of systems, those that run each branch and make each statement of a row
(`cousins`), beside the documents that tests/golden prints. A row of these that is left out is marked
in its file: `"slow": "covered"`.
"""

from __future__ import annotations

import heapq
import json
import sys
import time
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import coverage

import inverse_service
from tests.doors.cousins import Statement, is_cousin, statement
from tests.doors.rows import CORPUS, COVERED, SYSTEMS, Row, rows, systems

STORED = CORPUS / "quick.json"
PACKAGE = str(Path(inverse_service.__file__).parent)
OFTEN = 2
MEASURING = 0.004  # s, what a row costs besides
Line = tuple[str, int]
Chosen = TypeVar("Chosen")


def mark(row: Row) -> str:
    return f"{zlib.crc32(row['id'].encode()):08x}"


def is_quick(name: str, place: int, row: Row) -> bool:
    """Whether a row is among the default ones of its file: it was chosen, or it is new."""
    known = CHOSEN.get(name, {"known": 0, "quick": []})
    return place >= known["known"] or mark(row) in known["quick"]


def covering(rows: Mapping[Any, tuple[float, frozenset[Any]]], often: int = OFTEN) -> list[Any]:
    """Names of rows (seconds, lines) that run each line `often` times, greedily by lines a second."""
    left = dict.fromkeys(set().union(*(met for _, met in rows.values())), often)
    waiting = [(-len(met) / (MEASURING + cost), name) for name, (cost, met) in rows.items()]
    heapq.heapify(waiting)
    chosen = []
    while waiting:
        _, name = heapq.heappop(waiting)
        cost, met = rows[name]
        new = [line for line in met if left[line]]
        worth = -len(new) / (MEASURING + cost)
        if new and waiting and worth > waiting[0][0]:
            heapq.heappush(waiting, (worth, name))
        elif new:
            chosen.append(name)
            for line in new:
                left[line] -= 1
    return chosen


def choose_readings() -> None:
    """Write the list of texts."""
    from tests.doors.parsing import read
    from tests.doors.test_readings import FILES

    every = [(name, row) for name, of_file in FILES.items() for row in of_file]
    ran = measured(every, lambda one: read(one[1]["document"]))
    seen = {(name, mark(row)): found for (name, row), found in zip(every, ran, strict=True)}
    write(covering(seen), FILES)


def choose_systems() -> None:
    """Mark the rows of systems that are left out."""
    from tests.doors.test_systems import answered, is_printed
    from tests.golden import printed

    every = systems()
    quick = [row for row in every if is_candidate(row)]
    others = rows("ends", "motions", "integrals", "certificates")
    named = {row["cousin"] for row in (*every, *others) if "cousin" in row}
    said = {*map(statement, every), *named}
    names = [*printed.documents()]

    def work(one: Row | str) -> object:
        if not isinstance(one, str):
            return answered(one)
        return printed.forms(one, printed.answered(one))

    ran = [*measured([*names, *quick], work)]
    anyway = set().union(
        *(met for _, met in ran[: len(names)]),
        *(stated(row, said) for row in every if is_printed(row)),
    )
    seen = {
        row["id"]: (cost, (met | stated(row, said)) - anyway)
        for row, (cost, met) in zip(quick, ran[len(names) :], strict=True)
        if not is_printed(row)
    }
    left = seen.keys() - set(covering(seen, 1))
    for name in (*SYSTEMS, "catalogue"):
        relabel(CORPUS / f"{name}.ndjson", left)


def is_candidate(row: Row) -> bool:
    return row.get("slow") in (None, COVERED) and not {"nightly", "open"} & set(row)


def stated(row: Row, said: Iterable[Statement | str]) -> frozenset[Any]:
    """What some row states and this one, too; itself, where another one names it."""
    own = statement(row)
    return frozenset(
        one for one in said if (one == row["id"] if isinstance(one, str) else is_cousin(own, one))
    )


def measured(
    chosen: Sequence[Chosen], work: Callable[[Chosen], object]
) -> Iterator[tuple[float, frozenset[Any]]]:
    """Processor time of the second of two calls, as what is loaded once costs nothing, and the
    branches of both.
    """
    tracer = coverage.Coverage(
        data_file=None, branch=True, include=[f"{PACKAGE}/*"], config_file=False
    )
    numbers: dict[tuple[str, int, int], int] = {}
    for row in chosen:
        tracer.erase()
        with tracer.collect():
            work(row)
        data = tracer.get_data()
        arcs = ((file, *arc) for file in data.measured_files() for arc in data.arcs(file) or ())
        met = {numbers.setdefault(arc, len(numbers)) for arc in arcs}
        began = time.process_time()
        work(row)
        yield time.process_time() - began, frozenset(met)


def relabel(path: Path, left: Collection[str]) -> None:
    """Mark the rows that are left out, and no others."""
    mark = f', "slow": "{COVERED}"}}'
    lines = path.read_text(encoding="utf-8").split("\n")
    for place, line in enumerate(lines[:-1]):
        plain = line.replace(mark, "}")
        is_left = json.loads(plain)["id"] in left
        lines[place] = f"{plain.removesuffix('}')}{mark}" if is_left else plain
    path.write_text("\n".join(lines), encoding="utf-8")


def write(chosen: Sequence[tuple[str, str]], files: Mapping[str, Sequence[Row]]) -> None:
    found = {
        name: {
            "known": len(rows),
            "quick": sorted(one for where, one in chosen if where == name),
        }
        for name, rows in files.items()
    }
    STORED.write_text(json.dumps(found, indent=0) + "\n", encoding="utf-8")


CHOSEN: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}

if __name__ == "__main__":
    for one in sys.argv[1:] or ("readings", "systems"):
        {"readings": choose_readings, "systems": choose_systems}[one]()
