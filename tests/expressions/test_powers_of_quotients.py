"""A power of a quotient that is not multiplied out is printed with the value that it has."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mpf

from inverse_service.expressions import calculus, printing, tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names

X, Y = ex.Symbol("x"), ex.Symbol("y")
AT = {X: mpf("1.7"), Y: mpf("0.9")}
NUMBERS = [Fraction(1), Fraction(3), Fraction(-1), Fraction(1, 2), Fraction(3, 2), Fraction(-3, 2)]
LETTERS = {
    "1/x": X**-1,
    "x": X,
    "x/y": ex.multiply(X, Y**-1),
    "1/(x y)": ex.multiply(X**-1, Y**-1),
    "1/(x + y)": ex.add(X, Y) ** -1,
}


@pytest.mark.parametrize("number", NUMBERS, ids=str)
@pytest.mark.parametrize("letters", LETTERS)
@pytest.mark.parametrize("exponent", [2, 3, -2])
def test_its_text_reads_back_as_the_same(number: Fraction, letters: str, exponent: int) -> None:
    base = ex.Product((ex.number(number), LETTERS[letters]))
    tree = ex.Power(base, ex.number(exponent))
    text = printing.to_text(tree)
    again = reader.read_formula(text, Names(("x", "y"), (), {}))
    assert calculus.evaluate(again, AT) == pytest.approx(calculus.evaluate(tree, AT)), text
