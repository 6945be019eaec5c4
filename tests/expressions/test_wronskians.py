"""Wronskians of unknown functions of one variable, written out, are recognized."""

from __future__ import annotations

import pytest

from inverse_service.expressions import calculus, printing, tree as ex, wronskians
from inverse_service.reading import names as nm, reader

FUNCTIONS = dict.fromkeys("abcdhk", ("t",))


def read(text: str) -> ex.Expression:
    return reader.read_formula(text, nm.Names((), (), FUNCTIONS))


def wronskian(*texts: str) -> ex.Expression:
    rows = [[read(text) for text in texts]]
    for _ in texts[1:]:
        rows.append([calculus.differentiate(one, ex.TIME) for one in rows[-1]])

    def minor(row: int, columns: list[int]) -> ex.Expression:
        if not columns:
            return ex.ONE
        parts = (
            ex.multiply(ex.number((-1) ** k), rows[row][c], minor(row + 1, [*columns[:k], *columns[k + 1 :]]))
            for k, c in enumerate(columns)
        )  # fmt: skip
        return ex.add(*parts)

    return minor(0, [*range(len(texts))])


@pytest.mark.parametrize(
    ("functions", "shown"),
    [
        (("a(t) - d(t)", "b(t)", "c(t)"), ["a(t) - d(t)", "b(t)", "c(t)"]),
        (("a(t) + b(t)", "a(t) - b(t)", "2*c(t)"), ["a(t)", "b(t)", "c(t)"]),
        (("b(t)", "c(t)"), ["b(t)", "c(t)"]),
        (("a(t)", "b(t) + c(t)", "d(t)", "h(t)"), ["a(t)", "b(t) + c(t)", "d(t)", "h(t)"]),
    ],
)
def test_a_wronskian_is_that_of_its_functions(functions: tuple[str, ...], shown: list[str]) -> None:
    found = wronskians.dependent(wronskian(*functions))
    assert [printing.to_text(one) for one in found] == shown


def test_other_expressions_are_no_wronskians() -> None:
    """A sum of two with no function in common is none; nor is one with a sign changed."""
    both = ex.add(wronskian("a(t)", "b(t)", "c(t)"), wronskian("d(t)", "h(t)", "k(t)"))
    others = ("b(t)*c'(t) + b'(t)*c(t)", "a'(t)", "a(t)*b''(t) - a''(t)*b(t)", "a(t)^2", "0")
    assert not any(map(wronskians.dependent, (both, *map(read, others))))
