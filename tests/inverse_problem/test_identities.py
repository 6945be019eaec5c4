"""Whether expressions vanish, and the rank of a matrix of them: yes, no, or not settled."""

from __future__ import annotations

import itertools

import pytest

from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.inverse_problem.hamiltonisation.hamiltonise import rank_at_point, values_modulo_primes, vanish
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

X, Y = Symbol("x"), Symbol("y")


def trees(*texts: str) -> list[Expression]:
    return [parse(text, Names(("x", "y"), ())) for text in texts]


@pytest.mark.parametrize(
    ("texts", "answer"),
    [
        ((), True),
        (("0",), True),
        (("(x+y)^2-x^2-2*x*y-y^2", "sin(x)^2+cos(x)^2-1", "exp(x+y)-exp(x)*exp(y)"), True),
        (("x-x", "x*y-y*x+1/10^30"), False),
        (("tan(x)*cot(x)-1",), True),
        (("sqrt(x^2*y^2)-sqrt(x^2)*sqrt(y^2)",), True),
        (("1/(x-x)",), None),
    ],
)
def test_vanishing_is_true_false_or_not_settled(texts: tuple[str, ...], answer: bool | None) -> None:
    assert vanish(trees(*texts), (X, Y)) is answer


def test_what_has_no_value_has_none_at_any_point() -> None:
    assert values_modulo_primes(trees("1/(sin(x)^2+cos(x)^2-1)"), (X, Y)) is None


@pytest.mark.parametrize(
    ("rows", "rank"),
    [
        ((), 0),
        (((), ()), 0),
        ((("0", "0"), ("0", "0")), 0),
        ((("x", "y"), ("x^2", "x*y")), 1),
        ((("0", "x"), ("y", "1")), 2),
        ((("0", "x", "y"), ("0", "2*x", "2*y"), ("0", "0", "1")), 2),
        ((("1",), ("x",), ("y",)), 1),
        ((("sin(x)", "cos(x)"), ("-cos(x)", "sin(x)")), 2),
        ((("1/(x-x)", "1"),), None),
    ],
)
def test_the_rank_is_that_at_a_generic_point(rows: tuple[tuple[str, ...], ...], rank: int | None) -> None:
    for order in itertools.permutations(rows):
        assert rank_at_point([trees(*row) for row in order], (X, Y)) == rank
