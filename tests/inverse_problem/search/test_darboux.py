"""Darboux polynomials and first integrals are invariant, and Lagrangians come out that no other family has.

Groups with their canonical connection, g'' = g' g^-1 g' in the entries of matrices, are those of Thompson and others
(G. Thompson, Variational connections on Lie groups, 2003); the goldfish is Calogero's (2001).
"""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy

from benchmarks.sympy_form import to_sympy, velocity
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.inverse_problem.search.darboux.cofactors import cofactors, divergences
from inverse_service.inverse_problem.search.darboux.forms import darboux_polynomials
from inverse_service.inverse_problem.search.darboux.terms import of_darboux_polynomials
from inverse_service.inverse_problem.search.factors import find_factors
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.terms import terms_of
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.forty_digits import defects, legendre_defects
from tests.inverse_problem.search.given import material, tree

NAME = "Darboux polynomials and first integrals"
# x'' = -x' y, y'' = -y' x with x y in the place of x.
PRODUCT = {"x": "(x^2*y*y' - x*y*y' - x'*y^2 - 2*x'*y')/y", "y": "-x*y*y'"}
TRIANGULAR = {"a": "a'^2/a", "b": "(a*b'*c' - a'*b*c' + a'*b'*c)/(a*c)", "c": "c'^2/c"}
FOUND = {
    "upper triangular matrices": TRIANGULAR,
    "triangular matrices of determinant 1": {"a": "a'^2/a", "b": "a'^2*b/a^2"},
    "similarities with a shear": {
        "a": "a'^2/a",
        "b": "a'*(2*a*b' - a'*b)/a^2",
        "c": "(a*a'*c' + a*b'*d' - a'*b*d')/a^2",
        "d": "a'*d'/a",
    },
    "x'' = 0, y'' = x' y' in x y and y": {"x": "-y'*(x^2*y' + x*x'*y + 2*x')/y", "y": "y'*(x*y' + x'*y)"},
    "x'' = 0, y'' = x' y'/x in projective coordinates": {
        "x": "-y'*(x*y' - 3*x'*y)/y^2", "y": "y'*(x*y' + x'*y)/(x*y)",
    },
    "goldfish in projective coordinates": {
        "x": "2*y'*(x^2*y' + x*y' - 2*x'*y)/(y^2*(x - 1))", "y": "2*y'*(2*x*y' - x'*y - y')/(y*(x - 1))",
    },
    "x'' = -x' y, y'' = -y' x in x y and y": PRODUCT,
    "x'' = x' y', y'' = -x' y' in projective coordinates": {
        "x": "y'*(x^2*y' - x*x'*y + x*y' + 2*x'*y^2 - x'*y)/y^3", "y": "y'*(x*y' - x'*y + 2*y*y')/y^2",
    },
}  # fmt: skip


LONG = ("goldfish", "similarities", "x'' = x' y'")
CASES = [
    pytest.param(equations, id=name, marks=[pytest.mark.slow] if name.startswith(LONG) else [])
    for name, equations in FOUND.items()
]


@pytest.mark.parametrize("equations", CASES)
def test_the_family_has_a_regular_lagrangian_where_the_families_before_it_have_none(equations: dict[str, str]) -> None:
    system = read_system(list(equations), equations)
    answer = solve(system, SolveOptions(time_dependent=False, time_limit=60.0)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == NAME
    numbers = defects(system, answer.lagrangian)
    assert numbers
    assert all(residual < 1e-30 and determinant > 1e-12 for residual, determinant in numbers)
    if answer.hamiltonian is not None and not answer.hamiltonian.implicit:
        assert all(defect < 1e-30 for defect in legendre_defects(system, answer.lagrangian, answer.hamiltonian))


@pytest.mark.parametrize("equations", [PRODUCT, TRIANGULAR, {"x": "-x", "y": "-4*y"}, {"x": "x'^2*y", "y": "0"}])
def test_the_derivative_along_the_motion_is_divisible_by_each_polynomial(equations: dict[str, str]) -> None:
    given = _material(equations)
    forms = darboux_polynomials(given, find_factors(given, 1), 1)
    assert forms
    for form in forms:
        p = to_sympy(form.base)
        rate = sum((p.diff(sympy.Symbol(name)) * velocity(name) for name in equations), sympy.Integer(0))
        rate += sum(
            p.diff(velocity(name)) * to_sympy(f)
            for name, f in zip(equations, given.analysis.system.accelerations, strict=True)
        )
        numerator = sympy.numer(sympy.together(rate))
        assert sympy.rem(sympy.Poly(numerator, *_velocities(equations)), sympy.Poly(p, *_velocities(equations))).is_zero


def test_the_eigenvalues_of_the_linear_part_are_cofactors() -> None:
    """In X = x y and y the cofactors are those of X'' = -X' y, y'' = -y' X."""
    found = [frozenset(terms.items()) for terms in cofactors(_material(PRODUCT))]
    assert frozenset(terms_of(tree("-y")).items()) in found
    assert frozenset(terms_of(tree("-x*y")).items()) in found
    assert found[0] == frozenset()


def test_forms_that_a_change_of_coordinates_hides_are_found() -> None:
    given = _material(PRODUCT)
    bases = {form.base for form in darboux_polynomials(given, find_factors(given, 1), 1)}
    assert tree("x*y' + y*x'") in bases
    assert tree("y'") in bases


def test_the_energy_is_found_where_it_is_the_only_integral() -> None:
    given = _material({"x": "-2*x*y", "y": "-x^2 + y^2"})
    (energy,) = darboux_polynomials(given, find_factors(given, 1), 1)
    assert energy.degree == 2
    ratio = sympy.simplify(to_sympy(energy.base) / to_sympy(tree("x'^2/2 + y'^2/2 + x^2*y - y^3/3")))
    assert ratio.is_Rational


def test_the_divergence_follows_a_change_of_coordinates() -> None:
    """X'' = X' Y', Y'' = -X' Y' has Y' - X'; with X = x y and Y = y twice the rate of log y is subtracted."""
    given = _material({"x": "y'*(x^2*y' + x*x'*y + x*y' + x'*y - 2*x')/y", "y": "-y'*(x*y' + x'*y)"})
    assert divergences(given)[0] == terms_of(tree("y' - x*y' - x'*y - 2*y'/y"))


def test_a_system_in_velocities_alone_has_no_further_terms() -> None:
    given = material({"x": "-a*x'", "y": "-b*y'^3"})
    assert of_darboux_polynomials(given, find_factors(given, 1)) == []


def test_terms_are_many_only_up_to_a_bound() -> None:
    given = _material(FOUND["similarities with a shear"])
    terms = of_darboux_polynomials(given, find_factors(given, 1))
    assert 100 < len(set(terms)) <= 1_500
    assert any(e == Fraction(-1) for key in terms for _, e in key)


def _velocities(equations: dict[str, str]) -> list[sympy.Symbol]:
    return [velocity(name) for name in equations]


def _material(equations: dict[str, str]) -> Material:
    return gather(analyse(read_system(list(equations), equations)), False)
