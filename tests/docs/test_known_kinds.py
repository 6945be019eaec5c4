"""docs/records/kinds.md lists the systems of the tests: `python -m tests.docs.test_known_kinds`
writes it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.doors.rows import rows

PAGE = Path(__file__).parents[2] / "docs" / "records" / "kinds.md"
HEAD = """# Systems with known answers, by kind of Lagrangian

Written by `python -m tests.docs.test_known_kinds` from the rows of `tests/corpus/kinds.ndjson` and
`constrained.ndjson`, each of which is a test: each *yes* with a Lagrangian is verified by numbers without the package,
each certificate by the checker. The source has the system and its answer, or the theorem from which the answer follows;
rows without one are our own examples. Types: [how to ask](../how-to/lagrangian-types.md#types-of-lagrangians).

| system | source | q'' | question | answer |
| --- | --- | --- | --- | --- |
"""
COSTS = "\n## What a kind costs\n"
SOURCES = {row["cited"]: row["title"] for row in rows("sources")}
CITED = re.compile(r"(.*) \(((.*?\d{4})[^()]*)\)")
SAID = {
    "variational": "yes",
    "not_variational": "no",
    "undetermined": "open",
    None: "no other clock",
}


def listed() -> Iterator[tuple[str, str, str, str]]:
    """(source, system, question, answer)."""
    for row in rows("kinds"):
        document = row["document"]
        ((_, verdict),) = row["kinds"].items()
        kind = document["kinds"][0]
        point = ", ".join(f"{name} = {value}" for name, value in document.get("near", {}).items())
        question = kind if isinstance(kind, str) else json.dumps(kind)
        yield (
            row["source"],
            written(document["equations"]),
            question + (f" at {point}" if point else ""),
            SAID[verdict],
        )
    for row in rows("constrained"):
        document = row["document"]
        if "reduced" in row:
            system = f"{document['lagrangian']}; {', '.join(document['constraints'])}"
            answer = f"{SAID[row['reduced']['verdict']]}; {SAID[row['reduced']['with_clock']]}"
            yield row["source"], system, "reduced; with another clock", answer
        elif "factor" in row.get("clock", {}):
            yield (
                row["source"],
                written(document["equations"]),
                "a clock",
                f"N = {row['clock']['factor']}",
            )


def written(equations: Any) -> str:
    return "; ".join(f"{name}'' = {force}" for name, force in equations.items())


def cited(named: str) -> tuple[str, str, str]:
    """The name of a row, its citation, and the name of the source; the last two are empty for our
    own systems.
    """
    found = CITED.fullmatch(named)
    return (found[1], found[2], found[3]) if found else (named, "", "")


def page(costs: str) -> str:
    lines = [
        f"| {cited(name)[0]} | {cited(name)[1]} | `{system}` | {question} | {answer} |\n"
        for name, system, question, answer in listed()
    ]
    sources = [f"- {name}. {title}.\n" for name, title in SOURCES.items()]
    return "".join([HEAD, *lines, "\n## Sources\n\n", *sources, COSTS, costs])


def test_the_page_lists_the_systems_of_the_tests() -> None:
    text = PAGE.read_text()
    assert text == page(text.split(COSTS)[1])


def test_sixty_systems_have_a_source() -> None:
    found = [(system, cited(name)[2]) for name, system, _, _ in listed()]
    assert {source for _, source in found if source} == {*SOURCES}
    assert len({system for system, source in found if source}) >= 60


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text().partition(COSTS)[2]))
