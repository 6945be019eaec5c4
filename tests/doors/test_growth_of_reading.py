"""What reading costs grows like the text: counted in calls, which do not depend on the machine."""

from __future__ import annotations

import sys
from itertools import pairwise, product
from types import FrameType
from typing import Any

import pytest

import inverse_service
from inverse_service.errors import LimitError
from inverse_service.expressions import calculus, printing, refusals, terms as tm, tree as ex
from inverse_service.reading import names as nm, reader, tokens
from inverse_service.service.documents import accepting

# What a text repeats: words that join a condition, ends of lines, names.
REPEATED = ("for ", "if ", "where ", "\n", "a ", ">>> x\n")


def _calls(text: str) -> int:
    """Calls of functions that reading the text makes."""
    count = 0

    def noted(frame: FrameType, event: str, _: Any) -> None:
        nonlocal count
        count += event == "call"

    before = sys.getprofile()
    sys.setprofile(noted)
    try:
        reader.read_tokens(text, nm.Names(guesses=True))
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize("repeated", REPEATED)
def test_a_text_twice_as_long_costs_twice_as_much(repeated: str) -> None:
    _calls("x'' = -x " + repeated)  # what is made once
    short, long = (_calls("x'' = -x " + repeated * n) for n in (300, 600))
    assert long < 2.2 * short


def chain(step: str, number: int) -> dict[str, str]:
    """u0 is the step of x, u1 that of u0, and so on."""
    names = ["x", *(f"u{k}" for k in range(number))]
    return {name: step.replace("@", before) for before, name in pairwise(names)}


@pytest.mark.parametrize(
    ("step", "what"),
    [
        ("@^2 + @", "has too many parts"),
        ("1/@ + @*y", "has too many parts"),
        ("(@ + y)^2", "is nested too deeply"),
        ("sin(x + @)", "is nested too deeply"),
    ],
)
def test_definitions_that_are_put_in_are_held_to_what_may_be_typed(step: str, what: str) -> None:
    """60 names of 8 characters each write out 2^60 parts, or a formula of depth 120."""
    where = {**chain(step, 60), "y": "2"}
    with pytest.raises(LimitError, match=what):
        inverse_service.solve({"equations": "x'' = u59", "where": where})


def test_a_function_of_itself_is_held_to_it_too() -> None:
    called = "f(" * 40 + "x" + ")" * 40
    with pytest.raises(LimitError, match="has too many parts"):
        inverse_service.solve({"equations": f"x'' = {called}", "where": {"f(x)": "x^2 + x"}})


def test_an_expansion_of_nested_squares_ends_before_its_generators_are_written_out() -> None:
    """Each generator holds the one before some 20 times: 40 squares were 3 GB of text."""
    tree: ex.Expression = ex.Symbol("x")
    for _ in range(40):
        tree = (tree + ex.Symbol("y")) ** 2
    with pytest.raises(tm.TooManyTerms):
        tm.terms_of(tree)
    (one,) = tm.terms_of((ex.Symbol("x") + ex.Symbol("y")) ** 20)
    assert len(printing.to_text(tm.monomial_tree(one))) < 12


def test_a_text_of_many_equations_has_as_many_parts_as_each_of_them_may_have() -> None:
    """Ten bodies in space are 30 equations of 340 parts each in one text."""
    part, most = "+x", refusals.LIMITS.tokens
    line = "x''=" + part * (most // 2 - 10)
    assert len(tokens.tokenize(f"{line};{line}")) > most
    for text in (line + part * 20, ";".join(["x''=x"] * 2_000)):
        with pytest.raises(LimitError, match="has too many parts"):
            tokens.tokenize(text)


def test_a_function_of_a_number_with_a_million_digits_has_no_value() -> None:
    tree: ex.Expression = ex.Symbol("x")
    for _ in range(9):
        tree = ex.Apply("exp", tree)
    with pytest.raises(calculus.NoRealValue):
        calculus.evaluate(tree, {ex.Symbol("x"): calculus.mpf(3)})


@pytest.mark.parametrize(
    "text",
    [
        "x'' = " + "x+" * 4_500 + "x",
        "L = x'^2; " + "d/dt \u2202L " * 2_000,
    ],
)
def test_a_text_of_too_many_parts_is_refused_before_it_is_read(text: str) -> None:
    *_, (step, ready) = accepting.steps_of({"equations": text})
    assert (step, ready.is_unread) == ("leave long texts", True)


@pytest.mark.parametrize(
    "text",
    [
        "x'' = -x*y + sin(x - y), y'' = -k_1*y^2",
        "\\ddot{x} = -\\omega^2 x + \\cos\\theta",
        "θ'' = -sin(θ)",
    ],
)
def test_forms_and_guesses_matter_for_derivatives_alone(text: str) -> None:
    """Such a text is translated once for all readings of its document."""
    kinds = [
        nm.Names(("x", "y"), forms=forms, guesses=guesses)
        for forms, guesses in product((False, True), repeat=2)
    ]
    asked = {reader._as_far_as_asked(text, names) for names in kinds}
    assert asked == {nm.Names(("x", "y"), raised=frozenset())}
    read = [reader._in_our_notation.__wrapped__(text, names, (0, 0)) for names in (*kinds, *asked)]
    assert all(one == read[0] for one in read)


@pytest.mark.parametrize(
    "text", ["x''*dy/dx = y", "\\partial_x V", "D x = y", "∂V/∂x", "diff(V, x)"]
)
def test_forms_and_guesses_are_asked_for_a_derivative(text: str) -> None:
    names = nm.Names(("x", "y"), forms=True, guesses=True)
    assert reader._as_far_as_asked(text, names) == nm.Names(
        ("x", "y"), forms=True, guesses=True, raised=frozenset()
    )
