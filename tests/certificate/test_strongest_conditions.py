"""The conditions that a certificate states hold at the points of those that its proof needs, and none
follows from the others.
"""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from fractions import Fraction

import pytest
from flint import fmpq

from inverse_service.certificate import cell
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.quotients import Quotient
from tests.certificate.documents import system


def ring_of_x_and_y() -> cell.Letters:
    return cell.Letters(
        Question(Tools(random.Random(1), time.thread_time() + 60), system("free-pair"))
    )


def needs(ring: cell.Letters, *each: tuple[str, list[int]]) -> list[cell.Need]:
    """The needs of products of `factors` of these numbers, positive or not zero."""
    x, y = (ring.generators[ring.texts.index(name)] for name in "xy")
    factors = (x, y, x - 1, x + 1, x + y, x - y, x**2 + 1, x**2 + y, y + 2, -ring.one, x)
    found = list[cell.Need]()
    for kind, places in each:
        whole = ring.one
        for place in places:
            whole = whole * factors[place]
        found += ring.pieces(kind, Quotient(whole, ring.one))
    return found


def are_true(needs: Sequence[cell.Need], values: Sequence[fmpq]) -> bool:
    each = ((one.kind, one.polynomial(*values)) for one in needs)
    return all(value > 0 if kind == ">" else value != 0 for kind, value in each)


def drawn(seed: int) -> list[tuple[str, list[int]]]:
    draw = random.Random(seed)
    return [
        (draw.choice((">", "!=")), draw.choices(range(11), k=draw.choice((1, 2, 3, 4))))
        for _ in range(draw.randrange(2, 5))
    ]


@pytest.mark.parametrize(
    "asked",
    [
        [
            (">", [2]),
            (">", [0, 2]),
        ],  # x - 1 and x (x - 1): x > 0 is left of the second, and follows
        [(">", [2]), (">", [2, 3]), ("!=", [6])],
        [("!=", [0, 1]), (">", [4, 4, 5]), (">", [6, 9, 9, 7])],
        *map(drawn, range(5)),
    ],
)
def test_what_is_stated_is_needed_and_enough(asked: list[tuple[str, list[int]]]) -> None:
    ring = ring_of_x_and_y()
    wanted = needs(ring, *asked)
    stated = cell.strongest(ring, wanted)
    for one in stated:
        others = cell.Knowledge(ring, [other for other in stated if other is not one])
        assert not others.implies(one)
        assert cell.smaller(others, one) == one
    draw = random.Random(7)
    for _ in range(40):
        values = [fmpq(draw.randrange(-12, 13), 4) for _ in ring.generators]
        assert are_true(stated, values) == are_true(wanted, values)


@pytest.mark.parametrize(
    ("number", "power", "exponent", "value"),
    [
        (-8, 3, Fraction(2, 3), 4),
        (8, 3, Fraction(2, 3), 4),
        (-1, 5, Fraction(4, 5), 1),
        (-27, 3, Fraction(4, 3), 81),
    ],
)
def test_a_root_of_an_even_power_is_that_of_the_absolute_value(
    number: int, power: int, exponent: Fraction, value: int
) -> None:
    """(-8 x^3)^(2/3) is 4 x^2, for all x."""
    ring = ring_of_x_and_y()
    x = ring.generators[ring.texts.index("x")]
    found = ring.root(Quotient(number * x**power, ring.one), exponent)
    assert found == Quotient(value * x ** int(power * exponent), ring.one)
    assert not ring.needs
