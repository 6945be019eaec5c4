"""A picture begins with a general member of a family, the one that its answer is about."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.reading import names as nm, reader
from inverse_service.web.pages import constants

DAMPED = (["-a*x' + b*y", "c*x - d*y'"], "abcd")
SPRINGS = (["-a*x + b*y", "c*x - d*y"], "abcd")


def chosen(
    system: tuple[list[str], str], exceptions: list[str], **given: float
) -> dict[str, float]:
    texts, letters = system
    names = nm.Names(("x", "y")[: len(texts)], tuple(letters))
    accelerations = [reader.read_formula(text, names) for text in texts]
    return constants.general_values(names, accelerations, given, exceptions)


@pytest.mark.parametrize(
    ("system", "exceptions", "given", "holds"),
    [
        (DAMPED, ["a = d", "a = -d"], {}, lambda a, d, **_: abs(a) != abs(d)),
        (DAMPED, ["a = d", "a = -d"], {"a": 2.0}, lambda a, d, **_: abs(d) != 2 == a),
        (DAMPED, ["a = d and b = c"], {}, lambda a, b, c, d: (a, b) != (d, c)),
        (SPRINGS, [], {}, lambda a, b, c, d: a * d != b * c),
        ((["-x'^n"], "n"), ["n = 2", "n = 1"], {}, lambda n: n not in (1, 2)),
        (
            DAMPED,
            ["a = 1", "b = 1", "c = 1", "d = 1", "a = 2"],
            {},
            lambda **all_of_them: 1 not in all_of_them.values(),
        ),
    ],
)
def test_no_exception_of_the_answer_is_drawn(
    system: Any, exceptions: list[str], given: dict[str, float], holds: Any
) -> None:
    assert holds(**chosen(system, exceptions, **given))


@pytest.mark.parametrize(
    "exceptions",
    [[], ["b = 0"], ["single values of a, b"], ["special functions F(x)"], ["a = (", "= a"]],
)
def test_without_a_reason_each_constant_is_1(exceptions: list[str]) -> None:
    assert chosen((["-a*x - b*x'"], "ab"), exceptions) == {"a": 1, "b": 1}
    assert chosen((["-x", "-y - x'"], ""), exceptions) == {}


def test_given_values_stay_also_on_an_exception() -> None:
    assert chosen((["-a*x"], "a"), ["a = 1"], a=1.0) == {"a": 1}
    assert chosen(SPRINGS, [], a=1.0, b=1.0, c=1.0, d=1.0) == dict.fromkeys("abcd", 1)


def test_forces_on_one_line_for_each_member_have_the_simplest_values() -> None:
    assert chosen((["-a*(x - y)", "a*(x - y)"], "a"), []) == {"a": 1}


def test_a_force_in_pieces_has_the_simplest_values() -> None:
    assert chosen((["-a*abs(x)*x", "-y*Heaviside(x)"], "a"), []) == {"a": 1}
    assert chosen((["-a*abs(x)*x"], "a"), ["a = 1"]) == {"a": 2}
