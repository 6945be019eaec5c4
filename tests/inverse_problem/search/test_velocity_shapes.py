"""A multiplier without velocities is excluded exactly where there is none."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import pytest

from inverse_service.algebra.point import variables_in
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Apply, Expression, Symbol, add, multiply, number, power, square_root
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.factors import find_factors
from inverse_service.inverse_problem.search.families import kinetic_terms, possible_shapes
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.motion_terms import irreducible_factors
from inverse_service.inverse_problem.search.rungs import ANSATZ
from inverse_service.inverse_problem.search.shapes import carried, functions, polynomials, quadratic
from inverse_service.inverse_problem.search.terms import EMPTY, Monomial, monomial, terms_of, tree_of
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.reading import read_system
from inverse_service.service.documents.documents import solve_document
from tests.generator import random_systems
from tests.inverse_problem.search.given import tree

POSSIBLE = [
    ({"x": "0"}, False),
    ({"x": "0", "y": "0", "z": "0"}, False),
    ({"x": "-sin(x)"}, False),
    ({"theta": "sin(theta)*cos(theta)*phi'^2", "phi": "-2*cos(theta)/sin(theta)*theta'*phi'"}, False),
    ({"x": "-x - x'"}, True),
    ({"x": "-2*x'/t - x^3"}, True),
    ({"x": "-2*x*x'/t - x'^2*log(t) - x"}, True),
    ({"x": "y'/sqrt(1 + x^2)", "y": "-x'/sqrt(1 + x^2)"}, False),
]
EXCLUDED = [
    ({"x": "-x - x'"}, False),
    ({"x": "-x*(1 - x'^2)^(3/2)"}, False),
    ({"x": "-x*exp(x')"}, False),
    ({"x": "-x*x' - x"}, True),
    ({"x": "-2*x*x'/t - x'^2*log(t + 1) - x"}, True),
    ({"w": "0", "x": "-w'*y'", "y": "w'*x'"}, False),
    ({"x": "x'^2*y'", "y": "2*y' + 2*x'^2*y'"}, True),
]


def possible(equations: dict[str, str], with_time: bool, seed: int = 1) -> bool:
    system = read_system(list(equations), equations)
    given = gather(analyze(system), with_time)
    return bool(possible_shapes(given, quadratic(given), seed).shapes)


@pytest.mark.parametrize(("equations", "with_time"), POSSIBLE)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_system_with_a_quadratic_lagrangian_is_never_excluded(
    equations: dict[str, str], with_time: bool, seed: int
) -> None:
    assert possible(equations, with_time, seed)


@pytest.mark.parametrize("family", ["natural", "metric", "magnetic"])
def test_generated_quadratic_lagrangians_are_never_excluded(family: str) -> None:
    for given in random_systems(8, seed=5, families=(family,)):
        assert possible(dict(given.equations), given.time_dependent), given.id


@pytest.mark.parametrize(("equations", "with_time"), EXCLUDED)
def test_a_system_without_one_is_excluded(equations: dict[str, str], with_time: bool) -> None:
    assert not possible(equations, with_time)


def test_shapes_without_common_points_do_not_stop_the_others() -> None:
    """sqrt(-1 - x'^2) is nowhere real: what is in velocities alone is tested all the same, and nothing else kept."""
    given = gather(analyze(read_system(["x", "y"], {"x": "-x - y", "y": "-x - 2*y"})), False)
    v = given.motion.velocities[0]
    nowhere = add(number(-1), multiply(number(-1), power(v, 2)))
    shapes = [*quadratic(given), monomial(square_root(nowhere)), monomial(Apply("log", v))]
    assert set(possible_shapes(given, shapes, 1).shapes) == set(quadratic(given))


def equations_of(lagrangian: str, coordinates: str) -> dict[str, str]:
    """q'' = f of its Euler-Lagrange equations."""
    result = solve_document({"lagrangian": lagrangian, "coordinates": coordinates.split()}, SolveOptions())
    return {name: formula["text"] for name, formula in result["equations"].items()}


GROWING = [
    ("exp(t)*(x'^2 + x'*w'^3 + w*x)", "x w", polynomials, 1),
    ("exp(-2*t)*(w'^2 + 3*x*w'^4 + w'*x'^2)", "x w", carried, -2),
    ("x'^2 + x'*w'^3 + w*x", "x w", polynomials, 0),
]


@pytest.mark.parametrize(("lagrangian", "coordinates", "shapes", "growth"), GROWING)
def test_the_growth_of_coefficients_is_seen_at_one_place(
    lagrangian: str, coordinates: str, shapes: Callable[[Material], list[Monomial]], growth: int
) -> None:
    """Terms of different degrees leave no damping -c q' in f, and f holds no t."""
    equations = equations_of(lagrangian, coordinates)
    given = gather(analyze(read_system(list(equations), equations)), True)
    possible = possible_shapes(given, shapes(given), 1)
    assert possible.growth == growth
    assert possible.alone


HOLDING = [
    ("x'^2/2 + y'^2/2 + x^2*y + x^4", {"x'^2": "", "x'*y'": "", "y'^2": ""}),
    ("exp(x)*y'^2/2 + x'^2/2 + x^2*y + x^4", {"x'^2": "", "y'^2": "x"}),
    ("x'^2*y/2 + y'^2/2 + x^2*y + x^4", {"x'^2": "y", "y'^2": ""}),
    ("t*x'^2/2 + x*y'^2/2 + x^2*y", {"x'^2": "t", "y'^2": "x"}),
]


@pytest.mark.parametrize(("lagrangian", "held"), HOLDING)
def test_what_coefficients_can_hold_is_seen_at_one_place(lagrangian: str, held: dict[str, str]) -> None:
    """t times x'^2/2 where L holds it, y times x'^2/2 where g_11 is y, and nothing for a constant g."""
    equations = equations_of(lagrangian, "x y")
    given = gather(analyze(read_system(list(equations), equations)), True)
    possible = possible_shapes(given, quadratic(given), 1)
    names = (TIME, Symbol("x"), Symbol("y"))
    free = {
        to_text(tree_of({shape: Fraction(1)})): "".join(
            to_text(name) for name in names if possible.may_have(monomial(name), shape)
        )
        for shape in possible.shapes
    }
    assert free == held
    assert all(possible.may_have(EMPTY, shape) for shape in possible.shapes)


def test_functions_are_offered_only_to_coefficients_that_can_hold_them() -> None:
    """A relativistic particle in a potential: its kinetic energy has constant coefficients, whatever the potential."""
    root = "(1 - x'^2 - y'^2)"
    equations = {
        "x": f"-{root}^(1/2)*(sin(x) - x'^2*sin(x) - x'*y'*y)",
        "y": f"-{root}^(1/2)*(y - y'^2*y - x'*y'*sin(x))",
    }
    given = gather(analyze(read_system(list(equations), equations)), False)
    row = next(rung for rung in ANSATZ if rung.name == "functions of velocities, short factors")
    for terms in kinetic_terms(given, row, find_factors(given, 1), 1):
        assert terms
        assert not any(name in given.motion.coordinates for key in terms for p, _ in key for name in variables_in(p))


def test_functions_of_four_velocities_are_all_tried() -> None:
    """250 of them, of which exp(2 b' + s') is no early one."""
    equations = {
        "r": "-2*r*s^2*exp(-r')",
        "a": "-b*exp(-2*a')/4",
        "s": "(a/2 + 2*r^2*s - 2*sin(s))*exp(s')",
        "b": "-a*exp(s')/4 - a*exp(-2*b')*exp(-s')/12 - r^2*s*exp(s') + exp(s')*sin(s)",
    }
    given = gather(analyze(read_system(list(equations), equations)), False)
    found = {to_text(tree_of({s: Fraction(1)})) for s in possible_shapes(given, functions(given), 1).shapes}
    assert {"exp(2*b' + s')", "exp(-s')", "exp(r')", "exp(2*a')"} <= found


def test_a_system_that_holds_the_time_shows_no_growth() -> None:
    equations = equations_of("exp(t)*(x'^2 + x'*w'^3 + t*x^2)", "x w")
    given = gather(analyze(read_system(list(equations), equations)), True)
    assert possible_shapes(given, polynomials(given), 1).growth is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lagrangian", "coordinates"),
    [
        *((lagrangian, coordinates) for lagrangian, coordinates, *_ in GROWING[:2]),
        ("x'*sqrt(x'^2 + y'^2/2)*exp(-x) + x'^2*sin(y)", "x y"),
    ],
)
def test_growing_terms_and_roots_of_fractions_are_found(lagrangian: str, coordinates: str) -> None:
    """The second has sqrt(1/2) sqrt(2 x'^2 + y'^2) beside rational terms."""
    result = solve_document({"equations": equations_of(lagrangian, coordinates)}, SolveOptions(time_limit=60))
    assert result["lagrangian"] or result["with_time"]["lagrangian"]


SUMS = [
    ("2*x*x'^2 + x/2 + 3*x'^2*y^2 + 3*y^2/4", ["2*x + 3*y^2", "4*x'^2 + 1"]),
    ("(1 + x'^2)*exp(-y) + (1 + x'^2)*y", ["x'^2 + 1", "y*exp(y) + 1"]),
    ("x'^2*sqrt(x) + sqrt(x) + x'^2 + 1", ["sqrt(x) + 1", "x'^2 + 1"]),
    ("x'^2 - y", ["x'^2 - y"]),
]


@pytest.mark.parametrize(("text", "factors"), SUMS)
def test_sums_fall_into_irreducible_factors(text: str, factors: list[str]) -> None:
    force = read_system(["x", "y"], {"x": text, "y": "0"}).accelerations[0]
    assert sorted(same_sum(p) for p in irreducible_factors(force)) == sorted(same_sum(tree(p)) for p in factors)


def same_sum(expression: Expression) -> str:
    """A text that equal sums up to a factor share."""
    return min(to_text(tree_of({k: sign * c for k, c in terms_of(expression).items()})) for sign in (1, -1))
