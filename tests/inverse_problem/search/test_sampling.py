"""Letters of an ansatz at points: those that are variables, and those that have no point in common."""

from __future__ import annotations

from fractions import Fraction
from functools import partial

import pytest

from inverse_service.algebra import truncated_series as ps
from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.point import Expansion, Point, evaluate
from inverse_service.algebra.series_program import SeriesProgram
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    Apply,
    Expression,
    Number,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    number,
    power,
    subtract,
)
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.kinds import helmholtz
from inverse_service.inverse_problem.search import multiplier_ansatz, sample_points
from inverse_service.inverse_problem.search.sampling import sampler_of
from inverse_service.inverse_problem.search.terms import Monomial, monomial
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.reading import read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import solve_document

SYSTEM = read_system(["x", "y"], {"x": "-x + c*y'*sin(t)", "y": "exp(x)*x'^2 - y/(1 + x^2)"}, ["c"])
NAMES = Names(("x", "y"), ("c",), {})
LETTERS = [
    "t", "x", "y", "c", "x^2 + 3*y", "c^2 + c", "sin(x) + x", "exp(t*x)", "1/(1 + y^2)", "log(1 + x^2)", "cos(x + 2*t)",
    "x*y + c*t", "atan(x)", "sqrt(4 + x^2)",
]  # fmt: skip


def velocity_letters() -> list[Expression]:
    """v_x, and sums of powers of velocities with factors of position."""
    u, v = Velocity("x"), Velocity("y")
    x = Symbol("x")
    return [u, add(power(u, 2), power(v, 2), ONE), add(multiply(x, u), power(v, 3)), add(multiply(TIME, u, v), x)]


def reference(
    point: Point, variables: list[Symbol | Velocity], letter: Expression, drift: list[int], order: int
) -> list[int]:
    """A row of the table by sparse series in all variables, and the quotient rule for log p as a series."""
    expansion = Expansion(point, variables, order)
    p, P, m, n = expansion.expand(letter), point.prime, len(variables), len(variables) // 2
    unit = pow(ps.value_at_point(p), -1, P)
    gradient = [ps.multiply(ps.derivative(p, a), ps.inverse(expansion.ring, p)) for a in range(m)]
    u = [ps.value_at_point(part) for part in gradient]
    second = [[ps.value_at_point(ps.derivative(gradient[a], b)) for b in range(m)] for a in range(m)]
    velocities, positions = range(1 + n, m), range(1, 1 + n)
    rates = [
        sum(drift[c] * ps.value_at_point(ps.derivative(ps.derivative(gradient[i], j), c)) for c in range(m)) % P
        if order > 2 else 0
        for i in velocities for j in velocities
    ]  # fmt: skip
    along = sum(d * a for d, a in zip(drift, u, strict=True)) % P
    mixed = [sum(drift[c] * second[i][c] for c in range(m)) % P for i in velocities]
    hessian = [second[i][j] for i in velocities for j in velocities]
    assert unit
    value = ps.value_at_point(p)
    return [value, along, *(u[i] for i in velocities), *mixed, *(u[i] for i in positions), *hessian, *rates]


@pytest.mark.parametrize("order", [2, 3])
def test_letters_have_the_logarithmic_derivatives_of_sparse_series(order: int) -> None:
    analysis = analyze(SYSTEM)
    letters = [*(to_kernels(read_formula(text, NAMES)) for text in LETTERS), *velocity_letters()]
    sampler, _ = sampler_of(analysis, [monomial(letter) for letter in letters])
    points = sampler.points(3)
    for k in range(3):
        rows = points.letters(k, letters, order)
        assert rows is not None
        point = points.point(k)
        forces = [evaluate(f, point) for f in analysis.accelerations]
        drift = [1, *(point.variable(v) for v in points.variables[3:]), *forces]
        for letter, row in zip(letters, rows, strict=True):
            assert [int(x) for x in row] == reference(point, points.variables, letter, drift, order), letter


def limit_series(monkeypatch: pytest.MonkeyPatch, words: int) -> None:
    """As for longer formulas: so many words are the most that the registers of a program may have."""
    limited = partial(SeriesProgram, most_words=words)
    monkeypatch.setattr(sample_points, "SeriesProgram", limited)
    monkeypatch.setattr(helmholtz, "SeriesProgram", limited)
    for made_once in (sample_points._programs, multiplier_ansatz._written):
        made_once.cache_clear()


def test_letters_too_long_for_one_program_have_more(monkeypatch: pytest.MonkeyPatch) -> None:
    letters = [to_kernels(read_formula(f"x^2 + {k}", NAMES)) for k in range(2, 22)]
    analysis = analyze(SYSTEM)
    points = [sampler_of(analysis, [monomial(letter) for letter in letters])[0].points(seed) for seed in (3, 3)]
    wanted = points[0].letters(0, letters, 2)
    points[1].places.clear()
    given = tuple(letters), tuple(points[1].variables), 2
    assert len(sample_points._programs(*given)) == 1
    limit_series(monkeypatch, 30)
    assert len(sample_points._programs(*given)) == 4
    found = points[1].letters(0, letters, 2)
    assert wanted is not None
    assert found is not None
    assert [row.tolist() for row in found] == [row.tolist() for row in wanted]


def test_what_is_too_long_for_series_is_searched_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    limit_series(monkeypatch, 1)
    found = solve_document(
        {"coordinates": ["x", "y"], "equations": {"x": "-y", "y": "x*y'"}}, SolveOptions(time_limit=10)
    )
    assert found["verdict"] in ("variational", "undetermined")
    with pytest.raises(IrreducibleAtoms):
        sampler_of(analyze(SYSTEM), [monomial(Symbol("x"))])[0].points(3).letters(0, [Symbol("x")], 2)


def test_a_letter_without_a_value_takes_nothing_from_the_others() -> None:
    """x - x(point) vanishes at one point, 1/(x - x(point)) has no value there."""
    sampler, _ = sampler_of(analyze(SYSTEM), [monomial(Symbol("x"))])
    points = sampler.points(3)
    there = Number(Fraction(points.point(0).variable(Symbol("x"))))
    zero = add(Symbol("x"), negate(there))
    pole, other = power(zero, -1), add(power(Symbol("x"), 2), ONE)
    assert points.letters(0, [zero], 2) is points.letters(0, [other, pole], 2) is None
    alone = points.letters(0, [other], 2)
    assert alone is not None
    assert points.letters(1, [zero, pole, other], 2) is not None
    fresh = sampler_of(analyze(SYSTEM), [monomial(Symbol("x"))])[0].points(3).letters(0, [other], 2)
    assert fresh is not None
    assert alone[0].tolist() == fresh[0].tolist()


def test_terms_without_a_value_where_the_others_have_one_are_left_out() -> None:
    """log(x' - 2) and sqrt(1 - x'^2) have no point in common, and f holds the latter."""
    analysis = analyze(read_system(["x"], {"x": "-x*(1 - x'^2)^(3/2)"}))
    v = Velocity("x")
    root: Monomial = frozenset([(subtract(ONE, power(v, 2)), Fraction(1, 2))])
    other = monomial(Apply("log", subtract(v, number(2))))
    sampler, kept = sampler_of(analysis, [other, monomial(v), root])
    assert kept == [monomial(v), root]
    assert sampler.real_point is not None
    assert abs(sampler.real_point[v]) < 1


def test_terms_whose_letters_cannot_be_reduced_beside_f_are_left_out() -> None:
    """Half powers of e^(log(w + sqrt(w^2 + 1))) are nested roots that are not settled beside sqrt(w^2 + 1)."""
    analysis = analyze(read_system(["w"], {"w": "w*w'^2/sqrt(w^2 + 1)"}))
    w, v = Symbol("w"), Velocity("w")
    root = power(add(power(w, 2), ONE), Fraction(1, 2))
    letter = Apply("exp", Apply("log", add(w, root)))
    nested: Monomial = frozenset([(letter, Fraction(3, 2)), (v, Fraction(2))])
    plain: Monomial = frozenset([(letter, Fraction(1)), (v, Fraction(2))])
    assert sampler_of(analysis, [nested, plain])[1] == [plain]
    with pytest.raises(IrreducibleAtoms):
        sampler_of(analysis, [nested])
