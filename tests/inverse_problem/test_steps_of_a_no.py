"""A step of a proof says by what it divides: where numbers vanish it does not hold."""

from __future__ import annotations

import pytest

from inverse_service.explanation import hierarchy, negative
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names

NAMES = Names(("x", "y"), ("a", "b"))
PHI = hierarchy.EquationName(hierarchy.ConditionName(hierarchy.Kind.ENDOMORPHISM, 0), (0, 1))


@pytest.mark.parametrize(
    ("divisors", "said"),
    [
        ([], "Hence "),
        (["a"], "For a != 0, "),
        (["a", "a - b"], "For a != 0 and a - b != 0, "),
        (["x"], "Since x is not identically zero, "),
        (["a + x"], "Since a + x is not identically zero, "),
        (["x", "y'"], "Since x and y' are not identically zero, "),
        (["a", "a*x - 1"], "For a != 0, since a*x - 1 is not identically zero, "),
    ],
)
def test_a_step_says_which_letters_and_which_functions_it_divides_by(
    divisors: list[str], said: str
) -> None:
    """Letters are numbers, and get an exception; what depends on the state does not vanish."""
    trees = [reader.read_formula(text, NAMES) for text in divisors]
    zero, g = ex.ZERO, ex.Symbol("g_12")
    step = negative.equation_step(PHI, g, g, g, zero, trees, ("a", "b"))
    assert said in step.text.replace("`", "")
