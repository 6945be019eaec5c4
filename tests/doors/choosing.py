"""Which rows the default tests read: `python -m tests.doors.choosing` writes corpus/quick.json.

Of the texts that are read, those that together run each line of the package that any of them runs
OFTEN times, if there are so many, and take the least time. The others are slow, but for rows that
are new since: they are default until the list is written again. It takes some minutes.
"""

from __future__ import annotations

import heapq
import json
import sys
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import inverse_service
from tests.doors.rows import CORPUS, Row

STORED = CORPUS / "quick.json"
PACKAGE = str(Path(inverse_service.__file__).parent)
OFTEN = 3
MEASURING = 0.004  # s, what a row costs besides
Line = tuple[str, int]


def mark(row: Row) -> str:
    return f"{zlib.crc32(row['id'].encode()):08x}"


def is_quick(name: str, place: int, row: Row) -> bool:
    """Whether a row is among the default ones of its file: it was chosen, or it is new."""
    known = CHOSEN.get(name, {"known": 0, "quick": []})
    return place >= known["known"] or mark(row) in known["quick"]


def lines_of(work: Callable[[], object]) -> frozenset[Line]:
    """The lines of the package that a call runs."""
    met = set[Line]()

    def note(frame: FrameType, event: str, _: Any) -> Any:
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        if event == "line":
            met.add((frame.f_code.co_filename, frame.f_lineno))
        return note

    sys.settrace(note)
    try:
        work()
    finally:
        sys.settrace(None)
    return frozenset(met)


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


def main() -> None:
    """Write the list."""
    from tests.doors.test_readings import FILES, parsed

    seen: dict[tuple[str, str], tuple[float, frozenset[Line]]] = {}
    for name, rows in FILES.items():
        for row in rows:
            began = time.process_time()
            parsed(row["document"])
            cost = time.process_time() - began
            seen[name, mark(row)] = cost, lines_of(lambda row=row: parsed(row["document"]))  # type: ignore[misc]
    write(covering(seen), FILES)


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
    main()
