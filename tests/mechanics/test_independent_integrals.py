"""Which integrals are functions of those before: their gradients are dependent, whatever their
values are.
"""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
import sympy

from inverse_service.expressions import collecting, tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.mechanics import first_integrals
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.solving import complete_integrals

NAMES = nm.Names(("x", "y"), ())


@pytest.mark.parametrize(
    ("texts", "kept"),
    [
        (["x'^2 + x^2", "(x'^2 + x^2)^2"], [True, False]),
        (["x'^2 + x^2", "3*(x'^2 + x^2) + 5"], [True, False]),
        (["x'^2 + x^2", "y'^2 + y^2", "x'^2 + x^2 + y'^2 + y^2"], [True, True, False]),
        (["x'^2 + x^2", "y'^2 + y^2", "(x'^2 + x^2)*(y'^2 + y^2)"], [True, True, False]),
        (["x'^2 + x^2", "y'^2 + y^2", "x*y' - y*x'"], [True, True, True]),
        # (x^2 + x'^2) (y^2 + y'^2) = (x y' - y x')^2 + (x y + x' y')^2
        (["x'^2 + x^2", "y'^2 + y^2", "x*y' - y*x'", "x*y + x'*y'"], [True, True, True, False]),
    ],
)
def test_functions_of_integrals_are_not_independent(texts: list[str], kept: list[bool]) -> None:
    motion = first_integrals.unconstrained_motion(read_system(["x", "y"], {"x": "-x", "y": "-y"}))
    given = [
        first_integrals.FirstIntegral(f"F{k}", reader.read_formula(text, NAMES), "")
        for k, text in enumerate(texts)
    ]
    found = first_integrals.independent_integrals(motion, given, 1)
    assert [one is not None for one in found] == kept


@pytest.mark.parametrize("complete", list(itertools.product([False, True], repeat=3)))
@pytest.mark.parametrize("unproven", [set(), {2}, {1, 2}, {2, 3}])
def test_a_claim_of_a_degree_is_one_of_all_lower_ones(
    complete: tuple[bool, ...], unproven: set[int]
) -> None:
    """Degree 4 is not claimed where 2 is open, whatever is known of 4; the claim is the highest of
    those that the checker proves.
    """
    known = dict(enumerate((*complete, False, False, False, False, False, False, False), 1))
    found: Any = SimpleNamespace(
        completed=lambda degree: {"degree": degree} if known.get(degree) else None,
        proven=lambda products, degree: None if degree in unproven else products,
        unknowns=lambda *sizes: 10**9,
    )
    claim = complete_integrals._Known.highest(found)
    first_open = next(degree for degree in known if not known[degree])
    claimed = [degree for degree in range(1, first_open) if degree not in unproven]
    assert claim == ({"degree": claimed[-1]} if claimed else None)


def test_what_is_left_of_functions_of_t_is_conserved() -> None:
    """Two bodies that repel each other by 2/(x - y)^3 have P t - X and H t^2 - S t + R. By SymPy,
    H X^2 - S P X + R P^2 and S^2 - 4 H R do not change along their motion.
    """
    force = "2/(x - y)^3"
    motion = first_integrals.unconstrained_motion(
        read_system(["x", "y"], {"x": force, "y": f"-{force}"})
    )
    given = [
        "t*x' + t*y' - x - y",
        "t^2*((x'^2 + y'^2)/2 + 1/(x - y)^2) - t*(x*x' + y*y') + (x^2 + y^2)/2",
    ]
    work = first_integrals._Integrals(motion, None, 1, float("inf"))
    found = work.from_others([reader.read_formula(text, NAMES) for text in given], 2)
    assert len(found.forms) == 2
    x, y, v, w = sympy.symbols("x y v w")
    pull = 2 / (x - y) ** 3
    for form in found.forms:
        text = to_text(form).replace("x'", "v").replace("y'", "w").replace("^", "**")
        tree = sympy.sympify(text, {"x": x, "y": y, "v": v, "w": w})
        rate = v * tree.diff(x) + w * tree.diff(y) + pull * (tree.diff(v) - tree.diff(w))
        assert sympy.simplify(rate) == 0
        assert tree.diff(v) != 0


def test_of_a_motion_with_time_nothing_is_made_without_t() -> None:
    motion = first_integrals.unconstrained_motion(read_system(["x", "y"], {"x": "t", "y": "1"}))
    work = first_integrals._Integrals(motion, None, 1, float("inf"))
    given = [reader.read_formula(text, NAMES) for text in ("x' - t^2/2", "y' - t")]
    assert not work.from_others(given, 1).forms


def test_brackets_are_taken_where_the_mass_depends_on_the_position() -> None:
    """Kepler's problem in polar coordinates: the bracket of the angular momentum and one component
    of the Runge-Lenz vector is the other component (Goldstein 3.9).
    """
    names = nm.Names(("r", "p"), ())
    forces = {"r": "r*p'^2 - 1/r^2", "p": "-2*r'*p'/r"}
    motion = first_integrals.unconstrained_motion(read_system(["r", "p"], forces))
    given = [
        "(r'^2 + r^2*p'^2)/2 - 1/r",
        "r^2*p'",
        "(r^3*p'^2 - 1)*cos(p) + r^2*r'*p'*sin(p)",
    ]
    work = first_integrals._Integrals(motion, None, 1, float("inf"))
    found = work.from_others([reader.read_formula(text, names) for text in given], 2)
    other = reader.read_formula("(r^3*p'^2 - 1)*sin(p) - r^2*r'*p'*cos(p)", names)
    sums = [one + sign * other for one in found.forms for sign in (-1, 1)]
    assert ex.ZERO in map(collecting.collect, sums)


@pytest.mark.parametrize(
    ("forces", "total", "parts"),
    [
        # r -> s r, t -> s^(3/2) t; p -> -p; t -> -t
        ({"r": "r*p'^2 - 1/r^2", "p": "-2*r'*p'/r"}, 2, True),
        # exp(x - y) by the translations of x and y
        ({"r": "exp(r - p)", "p": "-exp(r - p)"}, 2, True),
        # no scaling
        ({"r": "-r - p", "p": "-r - 2*p - 1"}, 2, False),
    ],
)
def test_integrals_are_sought_by_weight(forces: dict[str, str], total: int, parts: bool) -> None:
    """Each term is tried once, and each integral of all terms is a sum of those of the parts."""
    motion = first_integrals.unconstrained_motion(read_system(["r", "p"], forces))
    work = first_integrals._Integrals(motion, None, 1, float("inf"))
    letters = next(work.units.alphabets())
    whole = next(work.units.of_degree(work.velocities, total, letters))
    split = work.by_weight(whole)
    assert (len(split) > 1) == parts
    assert sorted(term for one in split for term in one.terms) == sorted(whole.terms)
    assert sum(len(work._candidates(one)) for one in split) == len(work._candidates(whole)) > 0
