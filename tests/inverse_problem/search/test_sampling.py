"""Letters of an ansatz at points: those that are variables, and those that have no point in common."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.algebra.modular import safe_prime
from inverse_service.algebra.point import Expansion, Point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    Apply,
    Number,
    Power,
    Symbol,
    Velocity,
    add,
    number,
    power,
    subtract,
)
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.sample_points import _logarithmic
from inverse_service.inverse_problem.search.sampling import sampler_of
from inverse_service.inverse_problem.search.terms import Monomial, monomial
from inverse_service.mechanics.reading import read_system

P = safe_prime(3)
NAMES = [TIME, Symbol("x"), Symbol("y"), Velocity("x"), Velocity("y")]
DRIFT = [1, 5, 7, 11, 13]


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("place", range(6))
def test_a_variable_has_the_derivatives_of_its_series(place: int, order: int) -> None:
    """A power with exponent one goes the way of the series; a parameter is displaced by nothing."""
    letter = [*NAMES, Symbol("c")][place]
    places = (place,) if place < len(NAMES) else ()

    def expansion() -> Expansion:
        return Expansion(Point(P, 4), [NAMES[k] for k in places], order)

    plain = _logarithmic(expansion(), places, Power(letter, Number(Fraction(1))), DRIFT, 2)
    assert _logarithmic(expansion(), places, letter, DRIFT, 2) == plain
    assert any(plain[1]) == bool(places)


def test_a_variable_that_vanishes_is_no_letter_at_that_point() -> None:
    point = Point(P, 4)
    point.variables[Symbol("x")] = 0
    with pytest.raises(SingularPoint):
        _logarithmic(Expansion(point, [Symbol("x")], 2), (1,), Symbol("x"), DRIFT, 2)


def test_terms_without_a_value_where_the_others_have_one_are_left_out() -> None:
    """log(x' - 2) and sqrt(1 - x'^2) have no point in common, and f holds the latter."""
    analysis = analyse(read_system(["x"], {"x": "-x*(1 - x'^2)^(3/2)"}))
    v = Velocity("x")
    root: Monomial = frozenset([(subtract(ONE, power(v, 2)), Fraction(1, 2))])
    other = monomial(Apply("log", subtract(v, number(2))))
    sampler, kept = sampler_of(analysis, [other, monomial(v), root])
    assert kept == [monomial(v), root]
    assert sampler.real_point is not None
    assert abs(sampler.real_point[v]) < 1


def test_terms_whose_letters_cannot_be_reduced_beside_f_are_left_out() -> None:
    """Half powers of e^(log(w + sqrt(w^2 + 1))) are nested roots that are not settled beside sqrt(w^2 + 1)."""
    analysis = analyse(read_system(["w"], {"w": "w*w'^2/sqrt(w^2 + 1)"}))
    w, v = Symbol("w"), Velocity("w")
    root = power(add(power(w, 2), ONE), Fraction(1, 2))
    letter = Apply("exp", Apply("log", add(w, root)))
    nested: Monomial = frozenset([(letter, Fraction(3, 2)), (v, Fraction(2))])
    plain: Monomial = frozenset([(letter, Fraction(1)), (v, Fraction(2))])
    assert sampler_of(analysis, [nested, plain])[1] == [plain]
    with pytest.raises(IrreducibleAtoms):
        sampler_of(analysis, [nested])
