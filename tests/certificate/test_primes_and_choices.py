"""The requirements of Lemma 2 of FORMAT.md for primes, and the choices of roots that the checker
tries.
"""

from __future__ import annotations

import random
import time
from typing import Any

import pytest
from flint import fmpz

from inverse_service.certificate.formulas import Ended, read_tokens, value_of
from inverse_service.certificate.numbers import PI, Pair, Plan
from inverse_service.certificate.question import Question, Tools


def question(formula: str = "x", near: str = "2") -> Any:
    """A question about one equation that also parses this formula."""
    tools = Tools(random.Random(1), time.thread_time() + 60)
    asked = Question(
        tools,
        {"coordinates": ["x"], "equations": {"x": "0"}},
        True,
        {"near": {"x": near, "x'": "3"}},
    )
    tokens = read_tokens(formula, "formula")
    asked.prepare(lambda ring: [value_of(ring, tokens)], [tokens])
    return asked


def planned(turn: int, roots: int, primes: dict[int, int]) -> Any:
    """The plan for e^(pi i/turn), roots of this degree of a function, and roots of prime
    numbers.
    """
    asked = question()
    asked.plan = Plan([[]], 192)
    asked.plan.pairs = [Pair(False, False, 1), Pair(True, False, 1), Pair(True, False, -1, turn),
                        *(Pair(False, True, q, n) for q, n in primes.items()), Pair(True, True, 0, roots)]  # fmt: skip
    assert asked.plan.pairs[PI].scale == turn
    return asked


def test_a_prime_has_61_bits_and_all_roots_that_are_needed() -> None:
    asked = planned(36, 5, {2: 2, 3: 2, 7: 4})
    for _ in range(12):
        prime = asked.prime()
        assert 1 << 60 < prime < 1 << 61
        assert fmpz(prime).is_prime()
        assert all((prime - 1) % n == 0 for n in (24, 2 * 36, 2 * 5))
        assert all(pow(q, (prime - 1) // n, prime) == 1 for q, n in ((2, 2), (3, 2), (7, 4)))


def test_no_prime_is_drawn_where_fewer_than_one_in_2_to_the_18_has_all_roots() -> None:
    square_roots = {2: 2, 3: 2, 5: 2, 7: 2}
    assert planned(720, 11, square_roots).prime()  # one in 253440
    for asked in (
        planned(720, 11, square_roots | {13: 2}),
        planned(12, 1, square_roots | {5: 24, 7: 24, 11: 24}),
    ):
        with pytest.raises(Ended, match="too few primes"):
            asked.prime()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formula", "choices"),
    [
        ("sqrt(x^2)", 2),
        ("(x^3)^(1/3)", 3),
        ("(x^5)^(1/5)", 5),
        ("sqrt(x^2)*sqrt(x'^2)", 4),
        ("sqrt(1 + x + 2*sqrt(x))", 4),
        ("(9*x^4)^(1/4)", 4),
        ("(x^2)^(1/4)", 4),
        ("sqrt(x*(x'^2 + 1)^2)*sqrt(x)", 4),
        ("sqrt(x^2 + sqrt(x))", 1),
        ("log(x')*sqrt(x)", 1),
        ("sqrt(x)*sqrt(x'^2 + 1)", 1),
        ("(x)^(1/3)*sqrt(x)", 1),
        ("(x)^(1/5)", 1),
        ("cos(acos(x/8)/3)*sin(atan(x'*x)/2)", 1),
        ("sin(asin(3*x/8 - 4*x^3/512)/3)", 6),
    ],
)
def test_one_choice_of_the_roots_is_enough_only_where_they_are_seen_to_be_independent(
    formula: str, choices: int
) -> None:
    assert len(question(formula).plan.choices) == choices


def test_a_root_of_a_function_counts_with_its_degree_and_has_its_roots_of_unity() -> None:
    plan = question("(x^3)^(1/3)").plan
    assert plan.split == 3
    assert plan.turns % 3 == 0
