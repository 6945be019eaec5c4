"""Where only differentiated equations decide: each is right, and in the sums all derivatives of g cancel."""

from __future__ import annotations

import itertools
import random
import re
from collections import Counter
from fractions import Fraction

import pytest
import sympy

from inverse_service import catalogue
from inverse_service.algebra.modular import reconstruct, safe_prime
from inverse_service.inverse_problem.decision.analysis import Analysis, analyze
from inverse_service.inverse_problem.explanation.differential_numbers import differential_numbers, sufficient_rows
from inverse_service.inverse_problem.explanation.differentiated_equations import rows_at, variables_of_question
from inverse_service.inverse_problem.explanation.negative import explain_negative
from inverse_service.inverse_problem.explanation.numbers_at_a_point import SmallPoint, placed
from inverse_service.mechanics.reading import read_system

PENDULUM = catalogue.document("damped-double-pendulum")["equations"]
EQUATION = re.compile(r"^(E\d+), \(H[23]\)_\d\d(?: differentiated by (?:.*?))?, times a number: (.*) = 0\.$")
SUM = re.compile(r"^In (.*) all derivatives of g cancel: (.*) = 0\.$")


def analysis_of(equations: dict[str, str]) -> Analysis:
    return analyze(read_system(list(equations), equations))


def combination(text: str) -> Counter[str]:
    """The factors in a text such as 2*g_11 - g_12[a, b']."""
    found: Counter[str] = Counter()
    for piece in re.sub(r"(?<!^)([-+]) ", r"~\1", text).split("~"):
        sign, size, word = re.fullmatch(r"([-+]?)(?:(\d+)\*)?([gE][^ ]*(?:, [^ ]+)*) ?", piece).groups()
        found[word] += (-1 if sign == "-" else 1) * int(size or 1)
    return found


# Four coordinates: hundreds of equations, of which a few are needed.
FOUR = {"r": "(r + s)/4 - r'", "a": "(-8*a^3 + b)/5 - a'", "s": "(-r + s)/4 - s'", "b": "(32*a^3 + b)/10 - b'"}


def test_four_coordinates_are_argued_too() -> None:
    analysis = analysis_of(FOUR)
    chosen = sufficient_rows(analysis, False, 2, seed=1)
    assert chosen is not None
    assert len(chosen.names) < 200
    explanation = explain_negative(analysis, None)
    assert explanation.complete
    assert "det g is zero" in explanation.steps[-1].text


@pytest.mark.parametrize("equations", [PENDULUM, {**PENDULUM, "a": PENDULUM["a"] + " - a"}], ids=["real", "formal"])
def test_in_every_sum_the_derivatives_cancel_and_what_is_left_is_singular(equations: dict[str, str]) -> None:
    explanation = explain_negative(analysis_of(equations), None)
    assert explanation.complete
    texts = [step.text for step in explanation.steps]
    assert ("No real point" in texts[1]) is (equations is not PENDULUM)
    rows = {found[1]: combination(found[2]) for text in texts if (found := EQUATION.match(text))}
    sums = [(combination(found[1]), combination(found[2])) for text in texts if (found := SUM.match(text))]
    assert rows
    for factors, result in sums:
        total: Counter[str] = Counter()
        for name, factor in factors.items():
            total.update({unknown: factor * value for unknown, value in rows[name].items()})
        assert {k: v for k, v in total.items() if v} == dict(result)
    matrix = sympy.Matrix([[result[name] for name in ("g_11", "g_12", "g_22")] for _, result in sums])
    assert matrix.rank() == 3
    assert texts[-1].startswith("So g = 0")


def helmholtz(f: list[sympy.Expr], g: sympy.Matrix, variables: list[sympy.Symbol]) -> dict[str, sympy.Matrix]:
    """The left sides of (H2) and (H3), as the paper defines them."""
    *rest, x, y, u, v = variables
    rates = [*(sympy.Integer(1) for _ in rest), u, v, *f]

    def along(e: sympy.Expr) -> sympy.Expr:
        return sum(rate * sympy.diff(e, w) for rate, w in zip(rates, variables, strict=True))

    by_velocity, by_position = (sympy.Matrix(f).jacobian(pair) for pair in ([u, v], [x, y]))
    phi = by_velocity.applyfunc(along) - 2 * by_position - by_velocity * by_velocity / 2
    connected = -g * by_velocity / 2
    return {"H2": g.applyfunc(along) - connected - connected.T, "H3": g * phi - (g * phi).T}


@pytest.mark.parametrize(("with_time", "order"), [(False, 2), (True, 1)])
def test_the_equations_are_the_derivatives_of_the_helmholtz_conditions(with_time: bool, order: int) -> None:
    """Applied to the Hessian of any polynomial, a row is the derivative of the condition for that Hessian."""
    t, x, y, u, v = sympy.symbols("t x y u v")
    variables = [t, x, y, u, v][not with_time :]
    analysis = analysis_of({"x": "x*y' + x'^2*y/(1 + x^2)", "y": "x' - y*y'^2"})
    source = random.Random(3)
    monomials = [m for m in itertools.product(range(4), repeat=len(variables)) if sum(m[-2:]) >= 2 and sum(m) <= 5]
    L = sum(source.randint(-3, 3) * sympy.prod(w**e for w, e in zip(variables, m, strict=True)) for m in monomials)
    g = sympy.hessian(L, (u, v))
    sides = helmholtz([x * v + u**2 * y / (1 + x**2), u - y * v**2], g, variables)
    prime = safe_prime(5)
    point = SmallPoint(prime, 30)
    assert placed(analysis, point)
    rows = rows_at(analysis, with_time, order, point)
    names = variables_of_question(analysis, with_time)
    place = {w: reconstruct(point.variable(name), prime) for w, name in zip(variables, names, strict=True)}
    assert len(set(place.values())) > 3

    def value(e: sympy.Expr, by: tuple[int, ...]) -> Fraction:
        found = derivative(e, variables, by).subs({w: sympy.Rational(str(at)) for w, at in place.items()})
        return Fraction(str(found))

    for (kind, i, j, alpha), row in source.sample(sorted(rows.items()), 9):
        terms = [reconstruct(c, prime, 10**8) * value(g[each.i, each.j], each.by) for each, c in row.items()]
        assert sum(terms, Fraction(0)) == value(sides[kind][i, j], alpha)


def derivative(e: sympy.Expr, variables: list[sympy.Symbol], by: tuple[int, ...]) -> sympy.Expr:
    for w, times in zip(variables, by, strict=True):
        e = sympy.diff(e, w, times) if times else e
    return e


def test_what_is_variational_has_no_such_argument() -> None:
    """Without damping no rows leave only singular g, and with time the damped one has a Lagrangian."""
    free = {name: f.removesuffix(f" - {name}'") for name, f in PENDULUM.items()}
    assert sufficient_rows(analysis_of(free), False, 2, seed=1) is None
    assert sufficient_rows(analysis_of(PENDULUM), True, 2, seed=1) is None
    assert differential_numbers(analysis_of({"x": "-x"}), False) is None
