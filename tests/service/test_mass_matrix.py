"""A long H of three coordinates is also given by its mass matrix M and its potential V: H = p^T
M^-1 p/2 + V.
"""

from __future__ import annotations

import copy
import functools
import json
import random
from typing import Any

import pytest
from mpmath import lu_solve, matrix, mp, mpf

from inverse_service import check, solve
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.mechanics import legendre
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents import printed_pages
from inverse_service.service.scenes import scene_lagrangian

ANGLES = ("a1", "a2", "a3")
# Three pendulums in a chain, lengths and masses 1 (Goldstein, Poole, Safko 2002, ch. 1, by T - V).
CHAIN = (
    "L = (3*a1'^2 + 2*a2'^2 + a3'^2)/2 + 2*cos(a1-a2)*a1'*a2' + cos(a1-a3)*a1'*a3' + cos(a2-a3)*a2'*a3'"
    " + 3*g*cos(a1) + 2*g*cos(a2) + g*cos(a3)"
)
MASSES = [
    ["3", "2*cos(a1 - a2)", "cos(a1 - a3)"],
    ["2*cos(a1 - a2)", "2", "cos(a2 - a3)"],
    ["cos(a1 - a3)", "cos(a2 - a3)", "1"],
]


@functools.cache
def chain() -> dict[str, Any]:
    return dict(solve({"equations": CHAIN}))


def test_the_mass_matrix_is_that_of_the_book() -> None:
    energy = chain()["hamiltonian"]
    assert energy["mass_matrix"] == MASSES
    assert energy["potential"]["text"] == "-3*g*cos(a1) - 2*g*cos(a2) - g*cos(a3)"


@pytest.mark.parametrize("linear", ["y*x'", "sin(y)*x' + x*y'", "x*y'", "y'"])
def test_an_energy_whose_momenta_hold_more_than_velocities_has_no_mass_matrix(linear: str) -> None:
    """With p = M v + A the energy is (p - A)^T M^-1 (p - A)/2 + V."""
    for more in (linear, "0"):
        tree = read_formula(f"(x'^2 + y'^2)/2 - x^2*y + {more}", Names(("x", "y"), ()))
        found = legendre.by_mass_matrix(legendre.legendre(tree, ("x", "y")))
        assert (found is None) is (more == linear)


def test_both_forms_of_h_have_the_same_values() -> None:
    energy, names = chain()["hamiltonian"], Names(ANGLES, ("g", "p_a1", "p_a2", "p_a3"))
    rng = random.Random(1)
    with mp.workdps(30):
        point = {ex.Symbol(name): mpf(rng.uniform(-2, 2)) for name in (*ANGLES, *names.parameters)}
        value = functools.partial(calculus.evaluate, table=point)
        masses = matrix(
            [[value(read_formula(entry, names)) for entry in row] for row in energy["mass_matrix"]]
        )
        p = matrix([point[ex.Symbol(f"p_{name}")] for name in ANGLES])
        kinetic = (p.T * lu_solve(masses, p))[0] / 2
        whole = kinetic + value(read_formula(energy["potential"]["text"], names))
        assert abs(whole - value(read_formula(energy["text"], names))) < mpf(10) ** -20


def test_text_and_latex_print_the_short_form() -> None:
    lines = "\n".join(
        printed_pages.plain_text(line.said, line.most)
        for line in printed_pages.outline(chain(), False)
    )
    assert "H = p^T M^(-1) p/2 + V" in lines
    assert "M = [[3, 2*cos(a1 - a2), cos(a1 - a3)], " in lines


@pytest.mark.parametrize("change", [None, ("mass_matrix", 0, 1), ("potential",)])
def test_the_checker_confirms_m_and_v_and_no_others(change: tuple[Any, ...] | None) -> None:
    found = copy.deepcopy(_of_equations())
    if change == ("potential",):
        found["hamiltonian"]["potential"]["text"] += " + a1"
    elif change:
        found["hamiltonian"]["mass_matrix"][0][1] = "cos(a1 - a2)"
    judged = check(json.dumps(found))
    assert judged["verdict"] == ("valid" if change is None else "invalid")
    if change is None:
        assert not [place for place in judged["not_checked"] if place.startswith("/hamiltonian/")]
    else:
        assert judged["contradictions"][0]["field"] == "/hamiltonian/mass_matrix"


@functools.cache
def _of_equations() -> dict[str, Any]:
    lines = [
        "3*a1'' + 2*cos(a1-a2)*a2'' + cos(a1-a3)*a3'' + 2*sin(a1-a2)*a2'^2 + sin(a1-a3)*a3'^2 + 3*sin(a1) = 0",
        "2*cos(a1-a2)*a1'' + 2*a2'' + cos(a2-a3)*a3'' - 2*sin(a1-a2)*a1'^2 + sin(a2-a3)*a3'^2 + 2*sin(a2) = 0",
        "cos(a1-a3)*a1'' + cos(a2-a3)*a2'' + a3'' - sin(a1-a3)*a1'^2 - sin(a2-a3)*a2'^2 + sin(a3) = 0",
    ]
    return dict(
        solve({"equations": lines, "first_integrals": False, "time_dependent_lagrangian": False})
    )


@pytest.mark.parametrize(
    ("text", "is_separate"),
    [
        ("m*(x'^2 + y'^2)/2 + x'^2 - x*y^2", True),
        ("x'^2/2 - x + y'^2*m", True),
        ("x'^2/2 + y'^2/2 + x'*y'", False),
        ("(1 + x^2)*x'^2/2 + y'^2/2", False),
        ("x'^2/2 + y'^2/2 + x*y'", False),
        ("x'^2/2 - y^2", False),
        ("x'^2/2 + y'^4", False),
        ("x'^2/2 + t*y'^2", False),
        ("x'^2/2 + (m - 2)*y'^2", False),
    ],
)
def test_the_hamiltonian_of_own_masses_is_that_of_the_legendre_transform(
    text: str, is_separate: bool
) -> None:
    tree = read_formula(text, Names(("x", "y"), ("m",)))
    found = scene_lagrangian._of_own_masses(tree, ("x", "y"), {"m": 2.0})
    assert (found is not None) == is_separate
    if found is not None:
        whole = legendre.legendre(tree, ("x", "y")).hamiltonian
        assert collecting.collect(ex.subtract(found, whole)) == ex.ZERO
