"""An elimination proves something only if it is the same at all points, and a symbol only if it is
involutive.
"""

from __future__ import annotations

import itertools
import random
import time
from typing import Any

import pytest

from inverse_service.certificate import checker, question
from inverse_service.certificate.checker import CheckResult, check_certificate
from inverse_service.certificate.formulas import Ended
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.series import Step, Symbol
from tests.certificate.documents import (
    Document,
    changed,
    existence,
    lagrangian,
    nonexistence,
    system,
)

PENDULUM = existence("van-der-pol", 2, [1, 2], [1, 1, 1])


def asked() -> Question:
    return Question(Tools(random.Random(1), time.thread_time() + 60), system("free"))


def test_a_coefficient_is_left_out_in_balls_only_if_it_is_zero_at_every_point() -> None:
    scripts = [[Step("row", 5, frozenset(others))] for others in ({1, 2}, {2, 3}, {4})]
    assert asked().agreed(scripts) == [Step("row", 5, frozenset({1, 2, 3, 4}))]


@pytest.mark.parametrize(
    "other", [[Step("row", 6, frozenset[int]())], [Step("other", 5, frozenset[int]())], []]
)
def test_other_pivots_at_another_point_settle_nothing(other: list[Any]) -> None:
    with pytest.raises(Ended, match="different pivots") as end:
        asked().agreed([[Step("row", 5, frozenset[int]())], other])
    assert end.value.args[0] == "incomplete"


def with_sizes(
    monkeypatch: pytest.MonkeyPatch, document: Document, *symbols: Symbol
) -> CheckResult:
    """The verdict if the symbol has these sizes at the successive points."""
    found, plain = itertools.cycle(symbols), question.sr.symbol_of
    monkeypatch.setattr(question.sr, "symbol_of", lambda *parts: (next(found), plain(*parts)[1]))
    return check_certificate(document, seed=1)


def test_a_symbol_that_is_not_involutive_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    claimed = changed(PENDULUM, "symbol.prolonged", 2)
    found = with_sizes(monkeypatch, claimed, Symbol(1, 2, (1, 0)))
    assert found == CheckResult("invalid", ("The symbol is not involutive.",))


def test_a_symbol_of_other_dimensions_at_another_point_settles_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pair = existence("free-pair", 2, [3, 8], [5, 7, 3, 2])
    assert (
        with_sizes(
            monkeypatch, pair, Symbol(5, 7, (3, 2, 0, 0)), Symbol(5, 8, (3, 2, 0, 0))
        ).verdict
        == "incomplete"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "verdict"), [("cos(pi/61)", "valid"), ("{zero}", "incomplete")])
def test_rows_that_a_hidden_zero_makes_dependent_refute_nothing(factor: str, verdict: str) -> None:
    """The number is 0, which the checker cannot see for such a small part of pi: the motion is
    free.
    """
    zero = "(1+2*(" + "+".join(f"cos({k}*2*pi/61)" for k in range(1, 31)) + "))"
    equations = {"x": f"{factor.format(zero=zero)}*(x^2+y^2)", "y": "0"}
    document = changed(nonexistence("douglas-IIIb", 2), "system.equations", equations)
    assert check_certificate(document, seed=1).verdict == verdict


class Unlucky(random.Random):
    """A generator that draws the same numbers for the first directions."""

    left = 16

    def randrange(self, *bounds: Any) -> int:
        if bounds == (1, 1 << 20) and self.left:
            self.left -= 1
            return 7
        return super().randrange(*bounds)


def test_directions_are_drawn_again_until_they_are_independent() -> None:
    tools = Tools(Unlucky(1), time.thread_time() + 60)
    assert (
        "involutive"
        in checker.certified(existence("free-pair", 2, [3, 8], [5, 7, 3, 2]), tools).reasons[0]
    )
    assert tools[0].left == 0


@pytest.mark.parametrize(
    ("arguments", "by"),
    [
        ([], "x'"),
        (["x'", "x'"], "x'"),
        (["x'"], "x"),
        (["x'"], "z"),
        (["x", "y", "z", "x'", "y'", "z'", "x'"], "x'"),
        (["w"], "w"),
    ],
)
def test_an_integral_is_one_of_its_own_arguments(arguments: list[str], by: str) -> None:
    integrals = {"F": {"arguments": arguments, "derivatives": {by: "1"}}}
    document = lagrangian("free", f"x'^2 + F({', '.join(arguments)})", integrals=integrals)
    assert check_certificate(document, seed=1).verdict == "invalid"
