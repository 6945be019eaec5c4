"""Conditions that follow from others, modulo the relations of square roots."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest

from inverse_service.certificate.cell import Cell, lacking
from inverse_service.certificate.question import Question, Tools

ROOTED = Question(
    Tools(random.Random(1), float("inf")),
    {"coordinates": ["x", "y"], "equations": {"x": "0", "y": "0"}, "parameters": ["m"]},
    timed=False,
)


def follow(stated: str, known: Sequence[str]) -> bool:
    """Whether a condition holds wherever the known ones do."""
    missing, _ = lacking(ROOTED, known, Cell(domain=(stated,)))
    assert missing in ([], [stated])
    return not missing


@pytest.mark.parametrize(
    ("stated", "follows"),
    [
        ("x^2 + 2*x*sqrt(y) + y != 0", True),  # (x + sqrt(y))^2
        ("x^3 + 3*x^2*sqrt(y) + 3*x*y + y*sqrt(y) != 0", True),
        ("m*x + m*sqrt(y) != 0", True),
        ("x^2 - y != 0", False),  # x - sqrt(y) may be 0
        ("x - sqrt(y) != 0", False),
        ("x^2 + 3*x*sqrt(y) + 2*y != 0", False),  # x + 2 sqrt(y) may be 0
    ],
)
def test_a_product_of_what_is_nowhere_zero_is_nowhere_zero(stated: str, follows: bool) -> None:
    """By division modulo sqrt(y)^2 = y: what a power of x + sqrt(y) looks like multiplied out."""
    known = ["x + sqrt(y) != 0", "y > 0", "m != 0"]
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "known", "follows"),
    [
        ("x*y != 0", ["x != 0"], False),
        ("x*y != 0", ["x != 0", "y != 0"], True),
        ("x^2 - 1 != 0", ["x - 1 != 0"], False),
        ("x^2 - 1 != 0", ["x - 1 != 0", "x + 1 != 0"], True),
        ("m*x*y != 0", ["m*x != 0"], False),
        ("m*x*y != 0", ["m*x*y != 0"], True),
        ("x*(y^2 + 1) != 0", ["x != 0"], True),
        ("2 != 0", [], True),
    ],
)
def test_a_product_is_nonzero_where_each_factor_is(
    stated: str, known: list[str], follows: bool
) -> None:
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "follows"),
    [
        ("sqrt(5) - 1 != 0", True),
        ("2 - sqrt(3) > 0", True),
        ("sqrt(2) + sqrt(3) - sqrt(10) < 0", True),
        ("sqrt(2) + sqrt(3) - sqrt(9.8989) > 0", True),
        ("sqrt(2) - sqrt(3) > 0", False),
        ("sqrt(2)*sqrt(5) - sqrt(10) != 0", False),
    ],
)
def test_signs_of_roots_of_numbers_are_known(stated: str, follows: bool) -> None:
    assert follow(stated, []) is follows


@pytest.mark.parametrize(
    ("stated", "known", "follows"),
    [
        ("sqrt(x^4*y^2) + x^2*y != 0", ["x != 0", "y != 0"], False),  # it is 0 where y < 0
        ("sqrt(x^4*y^2) + x^2*y != 0", ["x != 0", "y > 0"], True),
        ("sqrt(x^4*y^2) != 0", ["x != 0", "y != 0"], True),
        ("sqrt(x^4*y^4) + x^2*y^2 != 0", ["x != 0", "y != 0"], True),  # both powers are even
    ],
)
def test_the_root_of_a_square_is_positive_next_to_one_of_a_fourth_power(
    stated: str, known: list[str], follows: bool
) -> None:
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "known", "follows"),
    [
        (
            "x^2 + m*x*y + y^2 > 0",
            ["x != 0", "m^2 < 4"],
            True,
        ),  # either name may be the nonzero one
        ("x^2 + m*x*y + y^2 > 0", ["y != 0", "m^2 < 4"], True),
        ("x^2 + m*x*y + y^2 > 0", ["x != 0"], False),
        ("x^2 + m*x*y + y^2 > 0", ["m^2 < 4"], False),  # x = y = 0
        ("(x - y)^2 + m*(x - y)*(x' - y') + (x' - y')^2 > 0", ["x - y != 0", "m^2 < 4"], True),
        ("(x - y)^2 + m*(x - y)*(x' - y') + (x' - y')^2 > 0", ["x' - y' != 0", "m^2 < 4"], True),
        ("(x - y)^2 + m*(x - y)*(x' - y') + (x' - y')^2 > 0", ["x + y != 0", "m^2 < 4"], False),
        ("(x - y)^2 + m*(x - y)*(x' - y') + (x' - y')^2 > 0", ["x - y != 0", "m < 2"], False),
    ],
)
def test_a_definite_form_is_positive_where_one_of_its_arguments_is_not_zero(
    stated: str, known: list[str], follows: bool
) -> None:
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "known", "follows"),
    [
        ("sqrt(exp(x) + 1) - 1 > 0", [], True),
        ("sqrt(x^2 + 1) - 1 > 0", ["x != 0"], True),
        ("sqrt(x^2 + 1) - 1 > 0", [], False),  # x = 0
        ("sqrt(x^2 + y) + x > 0", ["y > 0"], True),  # the root is larger, whatever x is
        ("sqrt(x^2 + y) - x > 0", ["y > 0"], True),
        ("sqrt(x^2 + y) + x > 0", [], False),  # x < 0 and y < 0
        ("m*sqrt(x^2 + 1) + x > 0", ["m > 1"], True),
        ("m*sqrt(x^2 + 1) + x > 0", ["m^2 > 1"], False),
        ("2*sqrt(y) - y - 1 < 0", ["y - 1 != 0", "y > 0"], True),  # -(sqrt(y) - 1)^2
        ("y + 1 + sqrt(y) > 0", ["y > 0"], True),
        ("x - sqrt(y) > 0", ["x^2 > y", "y > 0"], False),  # x < 0
        ("x - sqrt(y) > 0", ["x^2 > y", "x > 0", "y > 0"], True),
    ],
)
def test_the_larger_of_a_root_and_the_rest_gives_the_sign(
    stated: str, known: list[str], follows: bool
) -> None:
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "known", "follows"),
    [
        ("m*sin(x)^2 + y != 0", ["2*y + m - m*cos(2*x) != 0"], True),
        ("sin(x)*cos(y) + cos(x)*sin(y) != 0", ["sin(x + y) != 0"], True),
        ("4*sin(x)^3 - 3*sin(x) != 0", ["sin(3*x) != 0"], True),
        ("cos(x) != 0", ["sin(2*x) != 0"], True),
        ("cos(x) != 0", ["cos(2*x) != 0"], False),
        ("sin(x) + sin(y) != 0", ["sin(x + y) != 0"], False),
    ],
)
def test_angles_and_their_multiples_are_compared(
    stated: str, known: list[str], follows: bool
) -> None:
    assert follow(stated, known) is follows


@pytest.mark.parametrize(
    ("stated", "follows"),
    [
        ("cos(atan(x)) > 0", True),  # 1/sqrt(1 + x^2)
        ("cos(atan(x)/2) > 0", True),
        ("cos(-atan(x)) > 0", True),
        ("cos(2*atan(x)) > 0", False),  # (1 - x^2)/(1 + x^2)
        ("cos(3*atan(x)/2) > 0", False),
        ("sin(atan(x)) > 0", False),
        ("cos(x) > 0", False),
        ("exp(x) > 0", True),
        ("exp(x) + x^2 != 0", True),
        ("exp(x) - x^2 != 0", False),
        ("cosh(x) > 0", True),
        ("sinh(x) != 0", False),
        ("sqrt(1 + x^2) - 1 > 0", False),  # 0 for x = 0
        ("x^2 + x + 1 > 0", True),
        ("x^2 + 2*x + 1 > 0", False),
        ("x^4 - x^2 + 1 > 0", True),
    ],
)
def test_a_function_is_positive_where_it_is_for_every_argument(stated: str, follows: bool) -> None:
    assert follow(stated, []) is follows
