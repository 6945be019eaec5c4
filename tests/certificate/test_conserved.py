"""That there are no other first integrals of a degree: dimensions from the literature, and false
claims.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Sequence
from typing import Any

import pytest
from flint import nmod_mat

import inverse_service
from inverse_service.certificate import checker, conserved

HENON = {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}
ENERGY = "(x'^2+y'^2)/2+(x^2+y^2)/2+x^2*y-y^3/3"
KEPLER = {"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}
OF_KEPLER = [
    "(x'^2+y'^2)/2-1/sqrt(x^2+y^2)",
    "x*y'-y*x'",
    "y'*(x*y'-y*x')-x/sqrt(x^2+y^2)",
    "-x'*(x*y'-y*x')-y/sqrt(x^2+y^2)",
]
# Equations, integrals, degree, order, products. The dimension is the number of products.
TRUE: dict[str, tuple[dict[str, str], list[str], int, int, list[list[int]]]] = {
    # Bountis, Segur, Vivaldi 1982: the original Henon-Heiles system has the energy alone.
    "Henon-Heiles": (HENON, [ENERGY], 4, 6, [[], [0], [0, 0]]),
    # With -y^2 for y^2 (e = 1/3) it separates in x + y and x - y: two quadratic ones.
    "Henon-Heiles, separable": (
        {"x": "-x-2*x*y", "y": "-y-x^2-y^2"},
        ["(x'^2+y'^2)/2+(x^2+y^2)/2+x^2*y+y^3/3", "x'*y'+x*y+x*y^2+x^3/3"],
        2, 4, [[], [0], [1]],
    ),
    # Momentum and energy, and the squares and products of Laplace, Runge and Lenz.
    "Kepler, linear": (KEPLER, OF_KEPLER, 1, 3, [[], [1]]),
    "Kepler, quadratic": (KEPLER, OF_KEPLER, 2, 4, [[], [0], [1], [1, 1], [2], [3]]),
    "Kepler, quartic": (
        KEPLER, OF_KEPLER, 4, 5,
        [[], [0], [1], [1, 1], [2], [3], [0, 1], [1, 1, 1], [1, 2], [1, 3], [0, 0], [0, 1, 1],
         [0, 2], [0, 3], [1, 1, 1, 1], [1, 1, 2], [1, 1, 3], [2, 2], [2, 3]],
    ),
    "Toda, three masses": (
        {"x": "-exp(x-y)", "y": "exp(x-y)-exp(y-z)", "z": "exp(y-z)"},
        ["x'+y'+z'", "(x'^2+y'^2+z'^2)/2+exp(x-y)+exp(y-z)"], 2, 4, [[], [0], [1], [0, 0]],
    ),
    "free particle": ({"x": "0", "y": "0"}, ["x'", "y'", "x*y'-y*x'"], 1, 3, [[], [0], [1], [2]]),
    "pendulum on a spring": (
        {"x": "-sin(x-y)-x", "y": "sin(x-y)"}, ["(x'^2+y'^2)/2+x^2/2-cos(x-y)"], 2, 4, [[], [0]],
    ),
    "general constants": (
        {"x": "-a*x-2*b*x*y", "y": "-y-b*x^2"}, ["(x'^2+y'^2)/2+(a*x^2+y^2)/2+b*x^2*y"], 2, 4, [[], [0]],
    ),
    "cubic friction": ({"x": "-x-x'^3"}, [], 4, 6, [[]]),
}  # fmt: skip

SEPARABLE, FREE = TRUE["Henon-Heiles, separable"], TRUE["free particle"]


def document(
    equations: dict[str, str],
    integrals: Sequence[str],
    degree: int,
    order: int,
    products: list[list[int]],
    **more: Any,
) -> dict[str, Any]:
    names = [name for name in "ab" if any(f"{name}*" in text for text in equations.values())]
    system = {
        "coordinates": [*equations],
        "equations": equations,
        "parameters": names,
        "functions": {},
    }
    claim = {"degree": degree, "order": order, "number": len(products), "products": products}
    about = {
        "format": conserved.FORMAT,
        "system": system,
        "question": "autonomous",
        "integrals": [*integrals],
    }
    return {**about, **claim, **more}


@pytest.mark.parametrize("name", TRUE)
def test_the_dimension_is_that_of_the_literature(name: str) -> None:
    found = checker.check_certificate(document(*TRUE[name]), seed=1)
    assert found.verdict == "valid", found.reasons


@pytest.mark.parametrize("name", TRUE)
def test_one_more_or_one_less_is_refused(name: str) -> None:
    equations, integrals, degree, order, products = TRUE[name]
    for claimed in ([*products, [0, 0, 0, 0][:degree]], products[:-1], [*products, []]):
        found = checker.check_certificate(
            document(equations, integrals, degree, order, claimed), seed=1
        )
        assert found.verdict != "valid"


@pytest.mark.parametrize(
    "false",
    [
        document(
            HENON, ["(x'^2+y'^2)/2+(x^2+y^2)/2+x^2*y+y^3/3"], 2, 4, [[], [0]]
        ),  # is not conserved
        document(HENON, [ENERGY, f"2*({ENERGY})"], 2, 4, [[], [0], [1]]),  # depends on the other
        document(HENON, [ENERGY], 2, 4, [[], [0, 0]]),  # has degree 4
        document(HENON, [ENERGY], 4, 3, [[], [0], [0, 0]]),  # to an order that determines nothing
        document(HENON, [ENERGY], 2, 2, [[], [0]]),  # at this order more are possible
        document(HENON, [ENERGY], 2, 4, [[], [0]], number=3),
        document(HENON, [ENERGY], 2, 4, [[], [1]]),
        document(HENON, [f"exp({ENERGY})"], 2, 4, [[], [0]]),  # no polynomial
        document({"x": "-x-x'/(1+x'^2)"}, [], 2, 4, [[]]),
        document(
            {"x": "-x"}, ["x'^2+x^2"], 2, 4, [[], [0]], question="time_dependent"
        ),  # sin(t) x' - ... are others
        document(
            {"x": "-x", "y": "-y"}, ["x'^2+x^2", "y'^2+y^2", "x*y'-y*x'"], 2, 4, [[], [0], [1], [2]]
        ),
        document({"x": "V(x)"}, [], 1, 3, [[]]),
        # As many as there are, but not those: the dimension alone proves nothing.
        document(KEPLER, OF_KEPLER, 1, 3, [[], [0]]),
        document(
            *SEPARABLE[:1],
            [SEPARABLE[1][0], f"2*({SEPARABLE[1][0]})"],
            *SEPARABLE[2:4],
            [[], [0], [1]],
        ),
        # To first order the square of x y' - y x', the tenth, cannot be told from the other nine.
        document(*FREE[:2], 2, 1, [[], [0], [1], [2], [0, 0], [0, 1], [1, 1], [0, 2], [1, 2]]),
        document(HENON, [ENERGY], 2, 4, [[], [0]], conditions=["x' > 0"]),
    ],
)
def test_false_claims_are_refused(false: dict[str, Any]) -> None:
    assert checker.check_certificate(false, seed=1).verdict != "valid"


def test_a_function_is_not_taken_for_another_one() -> None:
    """sin(2 x) = 2 sin(x) cos(x): as independent functions they would leave fewer integrals."""
    equations = {"x": "-x+(sin(2*y)-2*sin(y)*cos(y))*x", "y": "0"}
    integrals = ["x'^2+x^2", "y'"]
    found = checker.check_certificate(document(equations, integrals, 1, 3, [[], [1]]), seed=1)
    assert found.verdict == "valid"
    assert (
        checker.check_certificate(document(equations, integrals, 1, 3, [[]]), seed=1).verdict
        != "valid"
    )


@pytest.mark.parametrize(
    "zero",
    [
        "exp(2*y)-exp(y)^2",
        "sqrt(x^2*y^2)-x*y",
        "sqrt(x)*sqrt(y)-sqrt(x*y)",
        "tan(y)-2*tan(y/2)/(1-tan(y/2)^2)",
        "exp(x+1)-exp(1)*exp(x)",
    ],
)
def test_a_force_that_is_zero_leaves_the_momentum(zero: str) -> None:
    """x'' = 0, y'' = -y near x = y = 1/2; functions taken for independent ones would leave no x'."""
    claim = document({"x": f"({zero})*x", "y": "-y"}, [], 1, 3, [[]], near={"x": "1/2", "y": "1/2"})
    assert checker.check_certificate(claim, seed=1).verdict != "valid"


@pytest.mark.parametrize(
    "zero",
    [
        # Ramanujan, J. Indian Math. Soc.: Question 525.
        "(2^(1/3)-1)^(1/3)-(1/9)^(1/3)+(2/9)^(1/3)-(4/9)^(1/3)",
        "sqrt(2+sqrt(3))-(sqrt(6)+sqrt(2))/2",
        "sin(pi/5)-sqrt((5-sqrt(5))/8)",
    ],
)
def test_a_constant_that_is_zero_leaves_the_energy(zero: str) -> None:
    """x'' = -x + 0 x y has x'^2 + x^2; modulo a prime other roots may be taken, and only y' and its
    square are left.
    """
    claim = document({"x": f"-x+({zero})*x*y", "y": "0"}, ["y'"], 2, 4, [[], [0], [0, 0]])
    assert checker.check_certificate(claim, seed=3).verdict != "valid"


def test_an_order_that_leaves_room_for_more_refutes_nothing() -> None:
    assert (
        checker.check_certificate(document(HENON, [ENERGY], 2, 2, [[], [0]]), seed=1).verdict
        == "incomplete"
    )
    # Five of the six of Kepler's problem: one more is possible, as it is there.
    few = document(KEPLER, OF_KEPLER, 2, 4, [[], [0], [1], [1, 1], [2]])
    assert checker.check_certificate(few, seed=1).verdict == "incomplete"


@pytest.fixture(scope="module")
def result() -> Any:
    return inverse_service.solve({"equations": HENON})


def test_the_result_says_that_there_are_no_others_and_proves_it(result: Any) -> None:
    complete = result["first_integrals_complete"]
    assert (complete["degree"], complete["number"], complete["timed"]) == (4, 3, False)
    checked = inverse_service.check(result)
    assert checked["verdict"] == "valid"
    assert not [
        place for place in checked["not_checked"] if place.startswith("/first_integrals_complete")
    ]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("degree",), 3), (("number",), 2), (("number",), 4), (("timed",), True), (("checked",), "no"),
        (("certificate", "number"), 2), (("certificate", "degree"), 5), (("certificate", "order"), 3),
        (("certificate", "integrals"), ["x'^2"]), (("certificate", "products"), [[], [0], [0]]),
        (("certificate", "system", "equations", "y"), "-y-x^2-y^2"), (("certificate", "format"), "other"),
        (("certificate",), {}),
    ],
)  # fmt: skip
def test_a_forged_statement_in_a_result_is_refused(
    result: Any, place: tuple[str, ...], value: Any
) -> None:
    forged = copy.deepcopy(dict(result))
    part = forged["first_integrals_complete"]
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    assert inverse_service.check(forged)["verdict"] != "valid"


def test_an_integral_that_is_not_listed_proves_nothing(result: Any) -> None:
    forged = copy.deepcopy(dict(result))
    forged["first_integrals"] = []
    assert inverse_service.check(forged)["verdict"] != "valid"


@pytest.mark.parametrize(
    ("lines", "unknowns", "entries", "seed"),
    [(0, 0, 0, 1), (1, 1, 1, 2), (5, 9, 2, 3), (40, 30, 2, 4), (60, 60, 3, 5), (30, 60, 30, 6)],
)
def test_the_rank_of_few_and_many_entries_is_that_of_the_whole_matrix(
    lines: int, unknowns: int, entries: int, seed: int
) -> None:
    prime, generator = 2**61 - 1, random.Random(seed)
    rows = {
        place: {
            generator.randrange(unknowns): generator.choice([0, 1, -1, 2, prime, -prime - 3])
            for _ in range(entries)
        }
        for place in range(lines)
    }
    rows |= {lines + place: dict(row) for place, row in rows.items()}  # nothing new
    whole = nmod_mat(2 * lines, unknowns, prime)
    for place, row in rows.items():
        for unknown, value in row.items():
            whole[place, unknown] = value % prime
    assert conserved.rank_modulo(rows, prime) == whole.rank()
