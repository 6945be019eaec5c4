"""docs/kinds.md lists the systems of the tests: `python -m tests.docs.test_known_kinds` writes it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.inverse_problem import test_definite, test_kinds, test_rayleigh
from tests.service import test_clock, test_reduced

PAGE = Path(__file__).parents[2] / "docs" / "kinds.md"
HEAD = """# Systems with known answers, by kind of Lagrangian

Written by `python -m tests.docs.test_known_kinds` from the data of `tests/inverse_problem/test_kinds.py`,
`test_definite.py`, `test_rayleigh.py`, `tests/service/test_reduced.py` and `test_clock.py`, where each row is a test:
each *yes* with a Lagrangian is verified by SymPy alone, each certificate by the checker. What the kinds are:
[guide](guide.md#kinds-of-lagrangians).

| system | q'' | question | answer |
| --- | --- | --- | --- |
"""
SAID = {"variational": "yes", "not_variational": "no", "undetermined": "open", None: "no other clock"}


def rows() -> Iterator[tuple[str, str, str, str]]:
    """(source, system, question, answer)."""
    for source, equations, kind, verdict in test_kinds.KNOWN:
        yield source, written(equations), kind if isinstance(kind, str) else json.dumps(kind), SAID[verdict]
    for source, equations, _, near, verdict in test_definite.KNOWN:
        point = ", ".join(f"{name} = {value}" for name, value in near.items())
        yield source, written(equations), "positive_definite" + (f" at {point}" if point else ""), SAID[verdict]
    for kind, listed, answer in (
        ("rayleigh", test_rayleigh.WITH_FRICTION, "yes"),
        ("rayleigh", test_rayleigh.WITHOUT, "no"),
        ("rayleigh_general", test_rayleigh.WITH_ANY_FRICTION, "yes"),
        ("rayleigh_general", test_rayleigh.WITHOUT_ANY_FRICTION, "no"),
    ):
        yield from ((source, written(equations), kind, answer) for source, equations in listed)
    for source, asked, plain, clocked in test_reduced.KNOWN:
        system = f"{asked['lagrangian']}; {', '.join(asked['constraints'])}"
        yield source, system, "reduced; with another clock", f"{SAID[plain]}; {SAID[clocked]}"
    for source, equations, factor in test_clock.FOUND:
        yield source, written(equations), "a clock", f"N = {factor}"


def written(equations: Any) -> str:
    return "; ".join(f"{name}'' = {force}" for name, force in equations.items())


def page() -> str:
    return HEAD + "".join(f"| {source} | `{system}` | {question} | {answer} |\n"
                          for source, system, question, answer in rows())  # fmt: skip


def test_the_page_lists_the_systems_of_the_tests() -> None:
    assert PAGE.read_text() == page()
    assert len({system for _, system, _, _ in rows()}) >= 60


if __name__ == "__main__":
    PAGE.write_text(page())
