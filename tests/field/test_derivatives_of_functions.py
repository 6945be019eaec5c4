"""A ring has the derivatives of an arbitrary function, with little work and in the time there is."""

from __future__ import annotations

import pytest

from inverse_service.expressions.calculus import differentiate
from inverse_service.expressions.tree import TIME, Arbitrary, Expression, Symbol, Velocity
from inverse_service.field import exact_field

ALL = (TIME, Symbol("x"), Symbol("y"), Velocity("x"), Velocity("y"))


def ring_of(
    tree: Expression, orders: int, budget: exact_field.Budget | None = None
) -> exact_field.ExactRing:
    budget = budget or exact_field.Budget()
    return exact_field.exact_ring([tree], ALL, orders, budget, unused="kept")


@pytest.mark.parametrize("count", range(1, 6))
def test_derivatives_are_those_of_the_calculus(count: int) -> None:
    tree = Arbitrary("F", ALL[:count], (0,) * count) ** 2
    ring = ring_of(tree, 2)
    for place, by in enumerate(ALL):
        found = ring.partial(place)(ring.value(tree))
        assert (found - ring.value(differentiate(tree, by))).is_zero


def test_derivatives_of_a_function_of_a_function_are_those_of_the_calculus() -> None:
    inner = Arbitrary("G", (ALL[1],), (0,))
    tree = Arbitrary("F", (ALL[1] * ALL[2], inner), (0, 0))
    ring = ring_of(tree, 1)
    found = ring.partial(1)(ring.value(tree))
    assert (found - ring.value(differentiate(tree, ALL[1]))).is_zero


def test_a_derivative_that_was_not_prepared_is_refused() -> None:
    tree = Arbitrary("F", ALL[:2], (0, 0))
    ring = ring_of(tree, 1)
    once = ring.partial(1)(ring.value(tree))
    with pytest.raises(exact_field.TooLarge):
        ring.partial(1)(once)


def test_zero_and_constants_have_the_derivative_zero() -> None:
    """Also next to derivatives that were not prepared; the degrees of the polynomial 0 are -1."""
    ring = ring_of(Arbitrary("F", ALL[:2], (0, 0)), 1)
    for value in (ring.constant(0), ring.constant(7)):
        assert ring.partial(1)(value).is_zero


def test_arguments_are_differentiated_once_by_each_variable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not again for each of the 252 derivatives of F that have derivatives in the ring."""
    calls = list[exact_field.Quotient]()
    derive = exact_field.Derivation.__call__

    def counted(
        self: exact_field.Derivation, element: exact_field.Quotient
    ) -> exact_field.Quotient:
        calls.append(element)
        return derive(self, element)

    monkeypatch.setattr(exact_field.Derivation, "__call__", counted)
    ring_of(Arbitrary("F", ALL, (0,) * 5), 6)
    assert len(calls) == len(ALL) ** 2


def test_the_clock_is_asked_while_derivatives_are_added() -> None:
    with pytest.raises(exact_field.TooLarge, match="time"):
        ring_of(Arbitrary("F", ALL, (0,) * 5), 4, exact_field.Budget(deadline=0))
