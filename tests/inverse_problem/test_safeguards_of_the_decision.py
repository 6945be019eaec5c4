"""The safeguards between a run at one point and a verdict: each one alone stops a wrong verdict."""

from __future__ import annotations

from dataclasses import replace

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.decision import certify
from inverse_service.decision.deciding import HelmholtzAt, analyze, decide
from inverse_service.linear_pde import involution, involution as settling
from inverse_service.linear_pde.involution import Finding, Limits
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import PLAIN
from inverse_service.statements.reasons import (
    TWO_ANSWERS,
    Open,
    Reason,
    not_by_order,
    too_many_unknowns,
)
from inverse_service.statements.stages import Stage

OSCILLATORS = read_system(["x", "y"], {"x": "-x", "y": "-2*y"})
ROTATION = read_system(["x", "y"], {"x": "x*y'", "y": "y*x'^2"})


def test_a_symbol_that_is_not_involutive_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert decide(OSCILLATORS, PLAIN).verdict == "variational"
    monkeypatch.setattr(involution, "symbol_of", lambda *_: involution.Symbol(2, 1, (2, 0, 0, 0)))
    found = decide(OSCILLATORS, PLAIN, limits=Limits(order=4))
    assert (found.verdict, found.open) == ("undetermined", not_by_order(4))


def test_a_dimension_that_still_falls_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    falling = property(lambda self: (99 - self.order,) * (1 + self.order))
    monkeypatch.setattr(settling.pde.Prolongation, "dimensions", falling)
    assert decide(OSCILLATORS, PLAIN, limits=Limits(order=4)).verdict == "undetermined"


FIRST = Finding(True, 3, history=((1,), (1, 2)))


@pytest.mark.parametrize(
    "second",
    [
        replace(FIRST, exists=False),
        replace(FIRST, order=4),
        replace(FIRST, history=((1,), (1, 3))),
    ],
)
def test_two_points_that_do_not_agree_leave_it_undetermined(
    second: Finding, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter((FIRST, second, FIRST, FIRST))
    monkeypatch.setattr(settling, "settle_once", lambda _: next(answers))
    found = decide(OSCILLATORS, PLAIN)
    assert (found.verdict, found.open) == ("undetermined", TWO_ANSWERS)
    assert decide(OSCILLATORS, PLAIN).verdict == "variational"


def test_a_second_point_that_meets_a_limit_leaves_it_undetermined(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter((FIRST, Finding(None, 2, Open(Reason.TIME, "the time limit"))))
    monkeypatch.setattr(settling, "settle_once", lambda _: next(answers))
    found = decide(OSCILLATORS, PLAIN)
    assert (found.verdict, found.open) == ("undetermined", Open(Reason.TIME, "the time limit"))


def test_the_second_point_expands_to_the_order_at_which_the_first_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    orders: list[int] = []
    plain = HelmholtzAt.at
    monkeypatch.setattr(
        HelmholtzAt,
        "at",
        lambda self, seed, order: orders.append(order) or plain(self, seed, order),
    )
    assert decide(OSCILLATORS, PLAIN).order == 3
    assert orders == [1, 3, 3]


def test_what_the_first_point_leaves_open_is_not_asked_at_a_second() -> None:
    told: list[Stage] = []
    assert (
        decide(OSCILLATORS, PLAIN, limits=Limits(order=1), progress=told.append).verdict
        == "undetermined"
    )
    assert [(stage.step, stage.order) for stage in told] == [
        ("prolongation", 0),
        ("prolongation", 1),
    ]


@pytest.mark.parametrize(("most", "order"), [(2, 0), (3, 1), (12, 1), (13, 2), (34, 2), (35, 3)])
def test_no_more_unknowns_than_the_limit_are_ever_made(most: int, order: int) -> None:
    """With two coordinates there are 3, 13, and 35 unknowns of degree 0, at most 1, and at most
    2.
    """
    found = decide(OSCILLATORS, PLAIN, limits=Limits(unknowns=most))
    assert (found.verdict, found.order) == ("undetermined", order - 1)
    assert found.open == too_many_unknowns(order, most)


def test_only_a_positive_verdict_has_a_degree_and_a_symbol() -> None:
    negative, positive = decide(ROTATION, PLAIN), decide(OSCILLATORS, PLAIN)
    assert (negative.degree, negative.symbol, negative.space) == (0, None, None)
    assert (positive.degree, positive.order) == (1, 3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "count"),
    [
        ({"x": "x*y'", "y": "y*x'^2"}, 2),
        ({"x": "x*y", "y": "0"}, 2),
        ({"x": "y'^3", "y": "x*y*x'"}, 2),
    ],
)
def test_consequences_that_are_not_needed_are_not_traced(
    equations: dict[str, str], count: int
) -> None:
    """g_11 = g_12 = 0 or similar suffices: without any one of the listed rows the proof fails."""
    system = read_system(["x", "y"], equations)
    analysis = analyze(system)
    proof = certify.of_decision(analysis, decide(system, PLAIN, analysis=analysis))
    assert check_certificate(proof, seed=1).verdict == "valid"
    assert len(proof["rows"]) >= count
    for k in range(len(proof["rows"])):
        less = proof | {"rows": proof["rows"][:k] + proof["rows"][k + 1 :]}
        assert check_certificate(less, seed=1).verdict == "invalid"
