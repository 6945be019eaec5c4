"""The power series of l and lambda_a solve the equations on the constraints, by SymPy, as far as they go."""

from __future__ import annotations

import re

import sympy as sp

from inverse_service.inverse_problem.constrained.existence import decide_motion
from inverse_service.inverse_problem.constrained.motion_sentences import series_steps
from tests.inverse_problem.constrained.motions import analyzed, knife_edge, particle

X, Y, Z, U, V = sp.symbols("x y z u v")


def read(text: str) -> sp.Expr:
    """A polynomial of the series, without its name and dots."""
    plain = text.split(" = ", 1)[1].replace(" + ...", "").replace("x'", "u").replace("y'", "v").replace("^", "**")
    assert re.fullmatch(r"[xyzuv0-9+\-*/() ]*", plain)
    return sp.sympify(plain)


def test_the_series_of_a_particle_solves_the_equations_to_its_degree_at_its_point() -> None:
    motion = analyzed(particle("x"))
    found = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    (step,) = series_steps(motion, found, False)
    shown = [part.text for part in step.parts if re.match(r"(l|lambda_1) = ", part.text)]
    l, mu = map(read, shown)  # noqa: E741
    w = -X * V  # z' = -x y'; x'' = -1 and y'' = -x x'y'/(1 + x^2) by Lagrange and d'Alembert
    force = {U: -1, V: -X * U * V / (1 + X**2)}

    def along(e: sp.Expr) -> sp.Expr:
        return sum(e.diff(q) * r for q, r in ((X, U), (Y, V), (Z, w), *force.items()))

    def across(e: sp.Expr, q: sp.Symbol, p: sp.Symbol) -> sp.Expr:
        return e.diff(q) + w.diff(p) * e.diff(Z)

    equations = [
        along(l.diff(p)) - across(l, q, p) + mu * (across(w, q, p) - along(w.diff(p))) for q, p in ((X, U), (Y, V))
    ]
    equations.append(along(mu) - l.diff(Z) + mu * w.diff(Z))
    point = {X: 1, Y: 2, Z: 3, U: 4, V: 5}
    for residual in equations:  # l is known to degree 3, so its second derivatives are to degree 1
        assert [e.subs(point) for e in (residual, *(residual.diff(q) for q in point))] == [0] * 6
    rows = [[l.diff(p, q).subs(point) for q in (U, V)] for p in (U, V)] + [[mu.diff(q).subs(point) for q in (U, V)]]
    assert sp.Matrix(rows).rank() == 2


def test_there_is_no_series_where_the_motion_is_not_rational() -> None:
    motion = analyzed(knife_edge("x^2+y^2"))
    found = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    assert found.exists
    assert series_steps(motion, found, False) == ()
