"""Steps of the search: gauges, regular Lagrangians only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from itertools import combinations_with_replacement
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from inverse_service import solve
from inverse_service.decision import deciding
from inverse_service.explanation import explaining
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, modular, real_branch
from inverse_service.mechanics import euler_lagrange, writing
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.search import (
    ansatz,
    antiderivatives,
    families,
    homogeneous,
    ladder,
    material as mt,
    one_coordinate,
    row_factors,
    tidy,
)
from inverse_service.solving import solving
from inverse_service.statements.questions import PLAIN, TIMED
from tests.values import slow


def terms(text: str) -> tm.Terms:
    return tm.terms_of(reader.read_formula(text, nm.Names(("x", "y"), (), {})))


def test_a_hidden_zero_adds_no_total_derivative() -> None:
    system = read_system(["x"], {"x": "-x"}, [], {})
    hidden = terms("x - x'*(t*(t-1)^(1/2) - (t-1)^(1/2) - (t-1)^(3/2))")
    assert any(tm.has_velocity(p) for key in hidden for p, _ in key)
    found = antiderivatives.Integrator(system, None).linear_terms([hidden])
    assert found == tm.scaled(terms("x^2/2"), -1) or found == terms("x^2/2")


@pytest.mark.parametrize("weight", [3, -2, Fraction(1, 2)])
def test_total_derivatives_are_left_out_of_a_lagrangian(weight: Fraction | int) -> None:
    kinetic, gauge = terms("x'^2/2 + y'^2/2"), terms("x*y' + y*x'")
    assert ansatz.without_gauge(tm.add_terms(kinetic, gauge, weight), [gauge]) == kinetic


def test_what_is_no_total_derivative_stays_in_a_lagrangian() -> None:
    magnetic = terms("x'^2/2 + y'^2/2 + x*y'/2 - y*x'/2")
    assert ansatz.without_gauge(magnetic, [terms("x'^2"), terms("x*y' + y*x'")]) != terms("y'^2/2")
    total = ansatz.without_gauge(magnetic, [terms("x*y' + y*x'")])
    names, still = ("x", "y"), (ex.Symbol("a"), ex.Symbol("b"))
    found, given = (
        euler_lagrange.euler_lagrange_residual(tm.tree_of(one), names, still)
        for one in (total, magnetic)
    )
    assert found == given


@pytest.mark.parametrize(
    "text", ["y*x'^2 - 5*x'^2/2 - y'^2", "x^2/2 - x'^2/2 - y'^2", "-x'^2/2 + y*x' - y'^2/2"]
)
def test_the_coefficient_of_squared_velocities_becomes_positive(text: str) -> None:
    """Of L and -L, which have the same equations, the one with a kinetic energy upright."""
    system = read_system(["x", "y"], {"x": "-x", "y": "0"}, [])
    shown = tidy.shorten_lagrangian(reader.read_formula(text, nm.Names(("x", "y"), (), {})), system)
    for velocity in map(ex.Velocity, system.coordinates):
        twice = calculus.differentiate(calculus.differentiate(shown, velocity), velocity)
        assert calculus.evaluate(ex.substitute(twice, {ex.Symbol("y"): ex.ZERO}), {}) > 0


def test_a_linear_term_vanishes_at_the_pole_where_the_kinetic_energy_does() -> None:
    """cos(u)^2 p' is not continuous at the pole u = 0 of the sphere, where p has no direction;
    -sin(u)^2 p' is.
    """
    system = read_system(
        ["u", "p"],
        {"u": "(p'^2 - 2*B*p')*sin(u)*cos(u)", "p": "2*(B - p')*u'*cos(u)/sin(u)"},
        ["B"],
    )
    names = nm.Names(("u", "p"), ("B",), {})
    given = reader.read_formula("u'^2/2 + sin(u)^2*p'^2/2 + B*cos(u)^2*p'", names)
    shown = tidy.shorten_lagrangian(given, system)
    residuals = euler_lagrange.euler_lagrange_residual(
        shown, system.coordinates, system.accelerations
    )
    assert {str(tm.collected(each)) for each in residuals} == {str(ex.ZERO)}
    momentum = calculus.differentiate(shown, ex.Velocity("p"))
    at_pole = ex.substitute(momentum, {ex.Symbol("u"): ex.ZERO})
    assert (
        calculus.evaluate(
            at_pole,
            {ex.Velocity("p"): 3, ex.Velocity("u"): 2, ex.Symbol("B"): 5, ex.Symbol("p"): 1},
        )
        == 0
    )


@pytest.mark.parametrize(
    ("lagrangian", "holds"),
    [
        ("x'^2/2 + y'^2/2", True),
        ("x'*y'", True),
        ("(x' + y')^2/2", False),
        ("x*y' - y*x'", False),
        ("x'^2/2 - x", False),
    ],
)
def test_the_search_takes_regular_lagrangians_only(lagrangian: str, holds: bool) -> None:
    analysis = deciding.analyze(read_system(["x", "y"], {"x": "0", "y": "0"}))
    tree = reader.read_formula(lagrangian, nm.Names(("x", "y"), (), {}))
    assert ladder.holds_numerically(analysis, tree, 1) is holds


def test_the_common_factor_of_all_equations_is_seen() -> None:
    system = read_system(["x", "y"], {"x": "x'*sqrt(x'^2 + y'^2)/x", "y": "y'*sqrt(x'^2 + y'^2)/x"})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    factor = homogeneous.common_factor(material)
    assert factor is not None
    assert tm.monomial_tree(factor) * ex.Velocity("x") == tm.tree_of(material.motion.forces[0])
    other = read_system(
        ["x", "y"], {"x": "x'*sqrt(x'^2 + y'^2)/x", "y": "2*y'*sqrt(x'^2 + y'^2)/x"}
    )
    assert not homogeneous.has_common_factor(mt.gather_material(deciding.analyze(other), PLAIN))


def test_a_norm_with_any_root_is_found_in_the_denominator_of_the_common_factor() -> None:
    """F = |v| + d(x*y), with |v| the fourth root of x'^4 + y'^4, has straight paths (Hamel 1903)."""
    norm = "((x'^4 + y'^4)^(1/4) + x*y' + y*x')"
    system = read_system(["x", "y"], {q: f"-2*x'*y'*{q}'/{norm}" for q in ("x", "y")})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    (found,) = homogeneous.propose_sums(material, 1)
    known = reader.read_formula(f"{norm}^2", nm.Names(("x", "y"), (), {}))
    ratio = found / known
    slopes = [calculus.differentiate(ratio, ex.Velocity(q)) for q in ("x", "y")]
    assert all(map(real_branch.vanishes, slopes))


def test_a_force_whose_derivatives_have_too_many_terms_does_not_end_the_search() -> None:
    """It has no factor of time and is that of no oscillator."""
    letters = ["1", "x", "y", "z", "x'", "y'"]
    products = map("*".join, combinations_with_replacement(letters, 5))
    force = f"({' + '.join(products)})*sqrt(1 + y^9*x'^2 + z^9*x'^3 + y^9*z^9*x'^4)"
    system = read_system(["x", "y", "z"], {"x": force, "y": "0", "z": "0"})
    material = mt.gather_material(deciding.analyze(system), TIMED)
    with pytest.raises(tm.TooManyTerms):
        tm.derivative_of_terms(material.motion.forces[0], ex.Velocity("x"))
    assert families.divergence_factor(material) is None
    lines = row_factors.lines_of(system, row_factors.solved_lines(system))
    assert not lines.are_oscillators


@pytest.mark.parametrize(
    "slope",
    [
        "sin(x) + 27*x^4/(x + y)^2 + 3/(x + y)^2",
        "(x^2*sin(x) + 2*x*y*sin(x) + y^2*sin(x) + 1)/(x + y)^2",  # sin(x) + 1/(x + y)^2
        "exp(x) + x^3/(x^2 + y^2) + cos(x)",
    ],
)
def test_each_part_of_a_slope_is_integrated_where_the_sum_is_not(slope: str) -> None:
    """The derivative of what is found is the slope, and nothing is left."""
    x, names = ex.Symbol("x"), nm.Names(("x", "y"))
    system = read_system(["x", "y"], {"x": "0", "y": "0"})
    integrator = antiderivatives.Integrator(system)
    given = reader.read_formula(slope, names)
    found, left = integrator.integral(tm.terms_of(given), x)
    assert not left
    difference = ex.add(calculus.differentiate(tm.tree_of(found), x), -given)
    assert writing.quotient(difference, exact_field.Budget.long(), system.variables) == ex.ZERO


@pytest.mark.parametrize("force", ["a^b*x'", slow("2^b*x'"), slow("sqrt(a^b)*x' + x'^2")])
def test_powers_of_letters_may_be_coefficients_of_a_lagrangian(force: str) -> None:
    """Over 2^b there are combinations with 2^(2 b), which f does not hold."""
    names = [name for name in "ab" if name in force]
    asked = {"equations": {"x": force}, "parameters": names, "first_integrals": False}
    found = solve(asked)
    system = read_system(["x"], {"x": force}, names)
    lagrangian = reader.read_formula(found["lagrangian"]["text"], system.names)
    (left,) = euler_lagrange.euler_lagrange_sums(lagrangian, ["x"], system.accelerations)
    assert real_branch.vanish([left], [*system.variables, *map(ex.Symbol, names)])


def test_functions_in_one_another_are_integrated_by_a_name() -> None:
    """No candidates are made for 32, where 5 took as long as all else; log^3(x) is found."""
    x, system = ex.Symbol("x"), read_system(["x"], {"x": "0"})
    slope: ex.Expression = x
    for _ in range(32):
        slope = ex.Apply("sin", x + slope) ** 2
    terms_of_slope = tm.terms_of(slope)
    with mock.patch.object(mt, "antiderivative_candidates", side_effect=AssertionError):
        named = antiderivatives.Integrator(system, integral_signs=True).function_of(
            [x], [terms_of_slope]
        )
    assert named is not None
    assert ex.has(tm.tree_of(named), ex.Integral)
    rate = calculus.differentiate(tm.tree_of(named), x)
    assert tm.terms_of(rate) == terms_of_slope
    shallow = terms("1/(x*log(x)*log(log(x)))")
    found = antiderivatives.Integrator(system).function_of([x], [shallow])
    assert found is not None
    assert tm.terms_of(calculus.differentiate(tm.tree_of(found), x)) == shallow


@pytest.mark.parametrize(("levels", "fits"), [(1, True), (8, False)])
def test_no_multipliers_are_made_of_functions_that_are_nested_deeply(
    levels: int, fits: bool
) -> None:
    """Their terms in one another are too many: for 8 levels a search had no end in a minute."""
    force = "x"
    for _ in range(levels):
        force = f"sin(x + {force})^2"
    system = read_system(["x"], {"x": f"{force}*x'"})
    material = SimpleNamespace(
        motion=SimpleNamespace(forces=[tm.terms_of(system.accelerations[0])]),
        analysis=SimpleNamespace(real_point={}),
    )
    assert one_coordinate.applies(material) is fits  # type: ignore[arg-type]


@pytest.mark.parametrize("lines", [["x'^3*x''", "y'*y'' + x'"], ["x*x'^2*x''", "y''/2"]])
def test_the_kinetic_part_of_lines_has_their_matrix_as_its_hessian(lines: list[str]) -> None:
    """K = G_ij v_i v_j/((d + 1)(d + 2)) for G = dE/dq'' of degree d in the velocities."""
    names = ("x", "y")
    system = read_system([*names], {"x": "0", "y": "0"})
    given = [reader.read_formula(text, nm.Names(names)) for text in lines]
    found = row_factors.lines_of(system, given)
    kinetic = row_factors._kinetic(found)
    assert kinetic is not None
    hessian = euler_lagrange.hessian(tm.tree_of(kinetic), names)
    assert [list(map(tm.terms_of, row)) for row in hessian] == found.matrix


@pytest.mark.parametrize(
    ("text", "positive"),
    [
        ("-x'^2/2 - y'^2 + x*y", True),
        ("-3*x'^2 - k*y'^2 + x^2", True),
        ("x'^2/2 + y'^2 - x", True),
        ("y'^2 - x'^2/2 + x", False),  # neither of both is upright
    ],
)
def test_an_upside_down_lagrangian_is_turned(text: str, positive: bool) -> None:
    system = read_system(["x", "y"], {"x": "0", "y": "0"}, ["k"])
    names = nm.Names(("x", "y"), ("k",))
    tree = tidy.shorten_lagrangian(reader.read_formula(text, names), system)
    bend = calculus.differentiate(calculus.differentiate(tree, ex.Velocity("x")), ex.Velocity("x"))
    assert isinstance(bend, ex.Number)
    assert (bend.value > 0) is positive


def test_what_is_said_of_a_rejected_lagrangian_is_not_said_of_the_next_one() -> None:
    system = read_system(["x", "y"], {"x": "-x", "y": "-y"}, [], {})
    analysis, asked = deciding.analyze(system), list[ex.Expression]()

    def third(tree: ex.Expression) -> bool:
        asked.append(tree)
        return len(asked) > 2  # both forms of the first one

    first = ladder.search(analysis, PLAIN, 1, lambda _: None)
    other = ladder.search(analysis, PLAIN, 1, lambda _: None, holds=third)
    assert first.found is not None
    assert other.found is not None
    assert other.found.lagrangians[0] == asked[-1] != first.found.lagrangians[0]
    assert first.found.parts
    assert other.found.parts == ()


def test_where_a_lagrangian_is_in_hand_a_nicer_one_is_looked_for_among_quick_shapes_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """x'' = y' - x', y'' = -x' - y' has an L(q, v) with an arctangent and a closed H."""
    costs, searched = list[float](), solving._searched

    def seen(work: Any, decision: Any, highest: float) -> Any:
        costs.append(highest)
        return searched(work, decision, highest)

    monkeypatch.setattr(solving, "_searched", seen)
    result = solve({"equations": "x'' = y' - x'; y'' = -x' - y'", "first_integrals": False})
    assert result["lagrangian"] is not None
    first, *further = costs
    assert first == math.inf
    assert further
    assert max(further) < math.inf


@pytest.mark.parametrize(("length", "is_shown"), [(1, True), (400, False)])
def test_the_sum_of_multiples_of_parts_is_shown_if_it_is_short(length: int, is_shown: bool) -> None:
    parts = [ex.add(*(ex.Symbol(name) ** k for k in range(1, length + 1))) for name in "xy"]
    outcome = SimpleNamespace(found=SimpleNamespace(parts=parts), tried=[("none", "")])
    said = str(explaining.search_steps(outcome)[-1])  # type: ignore[arg-type]
    assert ("C_1" in said) is is_shown
    assert ("every sum of multiples" in said) is not is_shown


@pytest.mark.parametrize(
    ("forces", "multipliers"),
    [
        ({"x": "-x' - 2*x", "y": "y' - 2*y"}, ["x'*y'"]),
        ({"x": "-y", "y": "x"}, ["x'*y'", "x'^2 - y'^2"]),
        ({"x": "-x + y'", "y": "-y - x'"}, ["x'^2 + y'^2"]),
        ({"x": "-x' - x + y", "y": "-x - 2*y"}, []),
    ],
)
def test_the_squares_of_velocities_that_helmholtz_admits_are_found(
    forces: dict[str, str], multipliers: list[str]
) -> None:
    squares = [next(iter(terms(text))) for text in ("x'^2", "x'*y'", "y'^2")]
    analysis = deciding.analyze(read_system(["x", "y"], forces, [], {}))
    space = ansatz.solve_multiplier(ansatz.sampler_of(analysis, squares), squares, 1)

    def rank(*forms: Mapping[tm.Monomial, Fraction]) -> int:
        rows = [[float(form.get(key, 0)) for key in squares] for form in forms]
        return int(np.linalg.matrix_rank(rows)) if rows else 0

    found, wanted = space.combinations, [terms(text) for text in multipliers]
    assert rank(*found) == rank(*wanted) == rank(*found, *wanted)


def test_long_equations_of_motion_are_not_worked_out_to_be_left_out() -> None:
    """Momenta of the length that is shown at most are enough to say it in one sentence."""
    system = read_system(["x", "y"], {"x": "-x", "y": "-y"})
    whole = "+".join(f"sin({k}*x'+y)^2*y'^2/(x'+{k})" for k in range(1, 40))
    tree = reader.read_formula(whole, nm.Names(("x", "y"), (), {}))
    with mock.patch.object(calculus, "differentiate_in_time", side_effect=AssertionError):
        (step,) = explaining.euler_lagrange_steps(system, tree)
    assert "satisfies the Euler-Lagrange equations" in step.text
    short = reader.read_formula("x'^2/2 + y'^2/2 - x^2/2 - y^2/2", nm.Names(("x", "y"), (), {}))
    assert len(explaining.euler_lagrange_steps(system, short)) == 2


@pytest.mark.parametrize(
    "exponent", [Fraction(-2), Fraction(2, 3), Fraction(-1, 2), Fraction(3, 4)]
)
def test_values_of_products_have_the_roots_that_are_squares(exponent: Fraction) -> None:
    prime, x, y = modular.safe_prime(1), ex.Symbol("x"), ex.Symbol("y")
    squares = [[4, 9], [25, 3 * 3], [pow(7, 4, prime), pow(11, 2, prime)]]
    candidates = [frozenset({(x, exponent), (y, Fraction(1))})]
    found = ansatz.monomial_values(ansatz.to_montgomery(squares, prime), (x, y), candidates, prime)
    wanted = [modular.positive_power(a, exponent, prime) * b % prime for a, b in squares]
    assert ansatz.residues(found[:, 0], prime).tolist() == wanted
    if exponent.denominator % 2 == 0:  # -1 is not a square
        with pytest.raises(ValueError, match="even root"):
            ansatz.monomial_values(
                ansatz.to_montgomery([[4, 9], [prime - 1, 9]], prime), (x, y), candidates, prime
            )
