"""The rows of tests/corpus and of the catalog."""

import json
import zlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from inverse_service import catalogue

CORPUS = Path(__file__).parents[1] / "corpus"
SYSTEMS = (
    *("textbook", "books", "search", "pairs", "literature", "kamke", "generated", "tables"),
    *("kinds", "branches", "identities", "families", "constrained"),
)
DOORS = ("python", "python", "python", "python", "command line", "http")
COVERED = "covered"  # "slow" for a row whose branches other rows run, see `choosing`
Row = dict[str, Any]


def rows(*names: str) -> list[Row]:
    """The rows of these files, in order."""
    return [row for name in names for row in _rows(name)]


@cache
def _rows(name: str) -> tuple[Row, ...]:
    """Those of a file, which nobody changes."""
    lines = (CORPUS / f"{name}.ndjson").read_text(encoding="utf-8").split("\n")[:-1]
    return tuple(map(json.loads, lines))


def systems() -> list[Row]:
    """All rows that are solved, including the catalog, whose rows have their times in
    catalogue.ndjson.
    """
    return [*rows(*SYSTEMS), *_of_the_catalogue()]


def _of_the_catalogue() -> Iterator[Row]:
    for name in catalogue.names():
        entry = catalogue.entry(name)
        expected = entry["expected"]
        yield {
            "id": f"catalogue {name}",
            "source": entry["source"],
            "document": entry["document"],
            "verdict": expected["verdict"],
            "verdict_with_time": expected["verdict_with_time"],
            "known": expected["lagrangians"],
            **_COSTS.get(name, {}),
        }


def doors(row: Row) -> tuple[str, ...]:
    """One interface chosen by the hash of the id, or all of them if the row says so."""
    if row.get("doors") == "all":
        return ("python", "command line", "http")
    return (DOORS[zlib.crc32(row["id"].encode()) % len(DOORS)],)


def cases(chosen: Iterable[Row], *extra: str) -> list[Any]:
    """Parameters (row, door) with the marks that the rows carry."""
    return [
        pytest.param(row, door, id=f"{row['id']}-{door}".replace(" ", "-"), marks=marks(row))
        for row in chosen
        for door in (extra or doors(row))
    ]


def marks(row: Row) -> list[pytest.MarkDecorator]:
    found = [getattr(pytest.mark, name) for name in ("slow", "nightly") if row.get(name)]
    return [*found, pytest.mark.xfail(strict=True, reason=row["open"])] if "open" in row else found


_COSTS: dict[str, Row] = (
    {row["id"]: row for row in rows("catalogue")} if (CORPUS / "catalogue.ndjson").exists() else {}
)
