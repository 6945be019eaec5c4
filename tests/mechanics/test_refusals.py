"""The steps that refuse a motion: brackets and equations at one point, against SymPy and known Lagrangians."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
import sympy

from inverse_service.constrained import existence, refusal
from inverse_service.deadline import now
from inverse_service.expressions.tree import Symbol, Velocity
from inverse_service.linear_pde.involution import Finding
from inverse_service.statements.questions import PLAIN, TIMED, Question
from tests.certificate.motions import analyzed, knife_edge, particle
from tests.certificate.test_brackets_along_a_solution import CHAINED

x, y, z, u, v = sympy.symbols("x y z u v")
SLEIGH = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "(x'^2+y'^2)/2 + phi'^2 + phi'*(-x'*sin(phi)+y'*cos(phi))",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
}


def test_brackets_are_those_of_the_motion() -> None:
    """z' = -x y', x'' = 0, y'' = -(1 + x x' y')/(1 + x^2): the particle with V = y."""
    found = refusal.at_point(refusal.SmallPoints(analyzed(particle("y")), 2), 0)
    assert found is not None
    own, rates = (x, y, z, u, v), (u, v, -x * v, 0, -(1 + x * u * v) / (1 + x**2))
    names = (Symbol("x"), Symbol("y"), Symbol("z"), Velocity("x"), Velocity("y"))
    place = {
        letter: sympy.Rational(*found.values[name].as_integer_ratio())
        for letter, name in zip(own, names, strict=True)
        if name in found.values
    }
    for k, series in zip((3, 4), found.brackets, strict=True):
        vector = [sympy.Integer(int(i == k)) for i in range(5)]
        for row in series:
            assert [sympy.Rational(*a.as_integer_ratio()) for a in row] == [
                part.subs(place) for part in vector
            ]
            vector = [
                sum(rates[j] * part.diff(own[j]) - vector[j] * sympy.diff(rates[i], own[j]) for j in range(5))
                for i, part in enumerate(vector)
            ]  # fmt: skip


def test_the_form_of_a_lagrangian_satisfies_the_equations() -> None:
    """L = phi'^2/2 + x'^2/(2 cos(phi) phi') - y'^2/(2 sin(phi) phi') has the motion of the knife edge."""
    edge = analyzed(knife_edge("0"))
    assert edge.names == ("phi", "x", "y")
    found = refusal.at_point(refusal.SmallPoints(edge, 6), 2)
    assert found is not None
    s, c, w = sympy.symbols("s c w")  # sin and cos of phi, phi'

    def by(tree: sympy.Expr, place: int) -> sympy.Expr:
        if place:
            return sympy.diff(tree, (None, x, y, w, u)[place])
        return c * sympy.diff(tree, s) - s * sympy.diff(tree, c)

    slope = s / c * u  # y'
    momenta = (w - u**2 / (2 * c * w**2) + slope**2 / (2 * s * w**2), u / (c * w), -slope / (s * w), 0, 0)  # fmt: skip
    texts = {str(name): value for name, value in found.values.items()}
    place = {
        letter: sympy.Rational(*next(value for name, value in texts.items() if part in name).as_integer_ratio())
        for letter, part in ((s, "'sin'"), (c, "'cos'"), (w, "Velocity(coordinate='phi')"), (u, "Velocity(coordinate='x')"))
    }  # fmt: skip
    values = [
        sympy.nsimplify((by(sympy.S(momenta[j]), i) - by(sympy.S(momenta[i]), j)).subs(place))
        for i, j in itertools.combinations(range(5), 2)
    ]
    assert any(values)
    assert len(found.equations) > 3
    for row in found.equations.values():
        pairs = zip(row, values, strict=True)
        assert sum(sympy.Rational(*a.as_integer_ratio()) * b for a, b in pairs) == 0


@pytest.mark.parametrize("document", [SLEIGH, particle("x^2")])
def test_the_steps_end_in_a_combination_that_the_form_sends_to_zero(
    document: dict[str, Any],
) -> None:
    """Each equation is written, and the last step names the combination, which is not zero."""
    motion = analyzed(document)
    found = existence.refused_along_a_solution(motion, PLAIN, 1, now() + 60, lambda _: None)
    assert found is not None
    assert found.along is not None
    steps = [step.text for step in refusal.refusal_steps(motion, found, PLAIN)]
    equations = [step for step in steps if step.startswith("j = ")]
    assert len(equations) == found.along + 1
    assert all(step.count("Omega_") and " = 0." in step for step in equations)
    assert "Omega(" in steps[-2]
    assert "contradiction" in steps[-1]
    assert not any("too long" in step for step in steps)


@pytest.mark.parametrize("question", [PLAIN, TIMED])
def test_the_last_step_denies_what_was_asked(question: Question) -> None:
    """That of L(t, q, q') denies every L, that of L(q, q') one without t."""
    motion = analyzed(particle("x^2"))
    found = existence.refused_along_a_solution(motion, question, 1, now() + 60, lambda _: None)
    assert found is not None
    last = refusal.refusal_steps(motion, found, question)[-1].text
    assert ("L(q, q')" in last) is not question.timed
    assert ("is variational" in last) is question.timed


def test_equations_whose_numbers_fill_pages_are_shown_reduced() -> None:
    """The brackets of a chain of four constraints up to j = 26 have dozens of digits; what they say together is short."""
    finding = Finding(False, 0, along=26)
    steps = [step.text for step in refusal.refusal_steps(analyzed(CHAINED), finding, PLAIN)]
    assert "the 27 equations up to j = 26 fill pages" in steps[3]
    assert steps[4].startswith("These linear equations have the solution Omega_12 = Omega_13 = ")
    assert steps[5].startswith("Hence Omega(e_7, e_i) = 0 for all i.")
    assert "contradiction" in steps[-1]


def test_reduced_equations_say_the_same() -> None:
    """Those of the sleigh, reduced modulo primes, span the space of those that are shown in full."""
    points = refusal.SmallPoints(analyzed(SLEIGH), 6)
    whole = refusal.at_point(points, 2)
    reduced = refusal.reduced_at_point(points, 2)
    assert whole is not None
    assert reduced is not None
    assert whole.values == reduced.values

    def echelon(point: refusal.AtPoint) -> sympy.Matrix:
        rows = [
            [sympy.Rational(*a.as_integer_ratio()) for a in row] for row in point.equations.values()
        ]
        found, pivots = sympy.Matrix(rows).rref()
        return found[: len(pivots), :]

    assert echelon(whole) == echelon(reduced)
