"""Equations with constants: where a printed L is no Lagrangian, the result says so, and answers.

The constants get the values -3 ... 3 and 1/2 one after another. The judge computes the
Euler-Lagrange equations and the Hessian at points where the equations have a value. Sources:
Polyanin and Zaitsev, Handbook of Exact Solutions (2003), sections 2.2 to 2.7 (PZ); Kamke,
Differentialgleichungen (K); Goldstein, Classical Mechanics (G); Nayfeh and Mook, Nonlinear
Oscillations (NM); Lane and Emden, Chandrasekhar, Stellar Structure (C); the textbook forms of drag
(D).
"""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import pytest
import sympy

import inverse_service
from inverse_service import catalogue
from tests.doors import letters
from tests.doors.rows import Row, systems

# (source, x'', constants)
FAST = [
    ("D, power of the speed", "a*x'^n", "a n"),
    ("PZ 2.3, Emden and Fowler without time", "a*x^n", "a n"),
    ("PZ 2.5 with l = 1", "x'*x^n", "n"),
    ("PZ 2.6, square of the rate", "a*x'^2/x + b*x", "a b"),
    ("D, linear drag and weight", "a*x' + b", "a b"),
    ("PZ 2.7", "exp(a*x')", "a"),
    ("K 2, Airy", "a*t*x", "a"),
    ("PZ 2.5", "x'^(a + 1)*x^b", "a b"),
]
SLOW = [
    ("PZ 2.3, Emden and Fowler", "t^a*x^b", "a b"),
    ("C, Lane and Emden", "-2*x'/t - x^n", "n"),
    ("C, cylinder and plane", "-k*x'/t - x^n", "k n"),
    ("C, isothermal", "-2*x'/t + a*exp(x)", "a"),
    ("PZ 2.3, Thomas and Fermi", "a*t^(-1/2)*x^(3/2)", "a"),
    ("PZ 2.2", "a*t^n*x", "a n"),
    ("PZ 2.2, power of the time before x'", "-a*x'/t - b*x", "a b"),
    ("PZ 2.4", "a*x^n + b*x", "a b n"),
    ("PZ 2.4", "a*x^n + b*x^m", "a b n m"),
    ("PZ 2.4", "a*exp(b*x)", "a b"),
    ("PZ 2.4", "a*exp(b*x) + c*exp(2*b*x)", "a b c"),
    ("PZ 2.5", "a*t^n*x^m*x'^2", "a n m"),
    ("PZ 2.5", "a*x^n*x'^2", "a n"),
    ("PZ 2.5", "a*x^n*x'^3", "a n"),
    ("PZ 2.5", "a*x'^n*x", "a n"),
    ("PZ 2.6", "a*x' + b*x^n", "a b n"),
    ("PZ 2.6, Lienard", "a*x*x' + b*x^3", "a b"),
    ("PZ 2.6, Lienard", "-3*a*x*x' - a^2*x^3 - b*x", "a b"),
    ("PZ 2.6", "a*x'^2 + b*x^n", "a b n"),
    ("PZ 2.6", "a*x'^2 + b", "a b"),
    ("PZ 2.7", "a*exp(b*x)*x'^n", "a b n"),
    ("PZ 2.7", "a*exp(b*x + c*x')", "a b c"),
    ("PZ 2.7", "a*cosh(b*x)", "a b"),
    ("PZ 2.7", "a*log(x) + b", "a b"),
    ("PZ 2.7", "a*x'*log(x')", "a"),
    ("K 6, logarithm", "a*x*log(x) + b*x", "a b"),
    ("K 6, square of the rate over x", "a*x'^2/x", "a"),
    ("K 6, square of the rate over x", "a*x'^2/x + b*x^n", "a b n"),
    ("K 6, square of the rate over t", "a*x'^2/t", "a"),
    ("K 6, projective", "a*x'^2/x - x'/t", "a"),
    ("K 2, Euler", "a*x'/t + b*x/t^2", "a b"),
    ("K 2, Bessel", "-x'/t - (1 - n^2/t^2)*x", "n"),
    ("K 2, constant coefficients", "-a*x' - b*x", "a b"),
    ("K 2, Mathieu", "-(a - 2*q*cos(2*t))*x", "a q"),
    ("K 2, Whittaker", "(1/4 - k/t + (m^2 - 1/4)/t^2)*x", "k m"),
    ("G, oscillator", "-k*x/m", "k m"),
    ("G, falling with drag", "-g - c*x'/m", "g c m"),
    ("G, radial Kepler motion", "l^2/(m^2*r^3) - k/(m*r^2)", "l m k"),
    ("G, pendulum", "-g*sin(th)/l", "g l"),
    ("G, bead on a turning parabola", "x*(w^2 - 2*g*a - 4*a^2*x'^2)/(1 + 4*a^2*x^2)", "w g a"),
    ("G, central power", "l^2/r^3 - k*r^n", "l k n"),
    ("NM, Duffing", "-w^2*x - b*x^3", "w b"),
    ("NM, Duffing with damping", "-d*x' - w^2*x - b*x^3", "d w b"),
    ("NM, Helmholtz", "-w^2*x - b*x^2", "w b"),
    ("NM, damping by the square", "-c*x'^2 - w^2*x", "c w"),
    ("NM, power damping", "-c*x'^n", "c n"),
    ("NM, wave in a plate", "-x - a*x*x'^2", "a"),
    ("NM, Rayleigh and Plesset", "-3*x'^2/(2*x) + p/x^n", "p n"),
    ("D, quadratic drag and weight", "g - k*x'^2", "g k"),
    ("D, drag of any power and weight", "-k*x'^n", "k n"),
    ("D, drag that decays", "-k*x'*exp(-b*t)", "k b"),
    ("D, drag by position", "-k*x^n*x'", "k n"),
    ("D, drag by position, square", "-k*x^n*x'^2 - b*x", "k n b"),
    ("D, rocket with burning fuel", "c*b/(m - b*t) - g", "c b m g"),
]


def _names(force: str) -> str:
    return next(
        (
            name
            for name in ("th", "r")
            if f"{name}" in force.replace("sqrt", "") and "x" not in force
        ),
        "x",
    )


def document(force: str, constants: str) -> dict[str, Any]:
    return {"equations": {_names(force): force}, "parameters": constants.split()}


def _sympy(text: str, coordinate: str, names: list[str]) -> sympy.Expr:
    x, v = sympy.symbols("position rate", real=True)
    table = {name: sympy.Symbol(name, real=True) for name in (*names, "t")} | {
        coordinate: x,
        "vv": v,
    }
    return sympy.sympify(text.replace(f"{coordinate}'", "vv").replace("^", "**"), locals=table)


def check_values(asked: dict[str, Any]) -> None:
    found = json.loads(inverse_service.solve(asked, time_limit=20).to_json())
    for answer, domain in letters.lagrangians_of(found):
        assert letters.false_values(found["system"], answer, domain, found["integrals"]) == []
    for part in found["left_out"]:
        if part["decided"] and part["lagrangian"]:
            left = [
                name for name in found["system"]["parameters"] if name not in part["where"]["text"]
            ]
            there = {**found["system"], "equations": part["equations"], "parameters": left}
            assert letters.false_values(there, part, integrals=part["integrals"]) == []


@pytest.mark.parametrize(
    ("force", "constants"), [row[1:] for row in FAST], ids=[row[1] for row in FAST]
)
def test_no_value_of_a_constant_makes_a_printed_lagrangian_false(
    force: str, constants: str
) -> None:
    check_values(document(force, constants))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "constants"), [row[1:] for row in SLOW], ids=[row[1] for row in SLOW]
)
def test_no_value_of_a_constant_makes_any_of_these_lagrangians_false(
    force: str, constants: str
) -> None:
    check_values(document(force, constants))


WITH_LETTERS = [
    row
    for row in systems()
    if isinstance(row["document"], dict)
    and row["document"].get("parameters")
    and "constraints" not in row["document"]
]
DAYS = 31


@pytest.mark.slow
def test_no_value_of_a_constant_makes_a_lagrangian_of_the_corpus_false() -> None:
    """Other rows each day of the month."""
    for row in WITH_LETTERS[datetime.now(tz=UTC).day :: DAYS]:
        check_values(row["document"] | {"first_integrals": False})


@pytest.mark.nightly
@pytest.mark.parametrize("row", [pytest.param(row, id=row["id"]) for row in WITH_LETTERS])
def test_no_value_of_a_constant_makes_any_lagrangian_of_the_corpus_false(row: Row) -> None:
    check_values(row["document"] | {"first_integrals": False})


def of_the_atlas() -> list[tuple[str, Mapping[str, Any], Mapping[str, Any], Sequence[str]]]:
    """(name, system, answer, domain) of each L with letters."""
    results = ((name, entry["result"]) for name, entry in catalogue.atlas().items())
    return [
        (name, result["system"], answer, domain)
        for name, result in results
        if result.get("system") and letters.letters_of(result["system"])
        for answer, domain in letters.lagrangians_of(result)
    ]


def test_no_value_of_a_constant_makes_a_lagrangian_of_the_atlas_false() -> None:
    """Other entries each day of the month."""
    found = of_the_atlas()
    assert len(found) > 200
    assert false_in(found[datetime.now(tz=UTC).day :: DAYS]) == {}


@pytest.mark.slow
def test_no_value_of_a_constant_makes_any_lagrangian_of_the_atlas_false() -> None:
    assert false_in(of_the_atlas()) == {}


def test_a_value_at_which_a_lagrangian_is_none_is_found() -> None:
    """J phi'^2/2 + x'^2/2 without a word about J = 0."""
    ((_, system, answer, domain),) = (one for one in of_the_atlas() if one[0] == "knife-edge")
    assert letters.false_values(system, {**answer, "exceptions": []}, domain) == ["J = 0"]


def false_in(
    found: Sequence[tuple[str, Mapping[str, Any], Mapping[str, Any], Sequence[str]]],
) -> dict[str, list[str]]:
    wrong = {name: letters.false_values(*rest) for name, *rest in found}
    return {name: values for name, values in wrong.items() if values}


@pytest.mark.parametrize(
    ("force", "constants", "special"),
    [
        ("a*x'^n", "a n", {"n = 1": "a*x'", "n = 2": "a*x'^2"}),
        ("a*x' + b", "a b", {"a = 0": "b"}),
        ("a*x'^2/x + b*x", "a b", {"a = 1": "(x'^2 + b*x^2)/x"}),
    ],
)
def test_the_values_left_out_have_their_own_answer(
    force: str, constants: str, special: dict[str, str]
) -> None:
    found = inverse_service.solve(document(force, constants), time_limit=20)
    parts = {part["where"]["text"]: part for part in found["left_out"]}
    assert {*parts} == {*special}
    for where, there in special.items():
        part = parts[where]
        assert part["decided"]
        difference = _sympy(part["equations"]["x"], "x", constants.split()) - _sympy(
            there, "x", constants.split()
        )
        assert sympy.simplify(difference) == 0
        assert part["verdict"] == "variational"
        assert part["checked"] == "valid"
    report = inverse_service.check(found)
    assert report["verdict"] == "valid"
    assert not any(place.endswith("/lagrangian/text") for place in report["not_checked"])


def test_a_check_refuses_a_result_that_hides_the_values_left_out() -> None:
    found = json.loads(inverse_service.solve(document("a*x'^n", "a n"), time_limit=20).to_json())
    for forged in (found | {"exceptions": [], "left_out": []}, found | {"exceptions": ["n = 1"]}):
        assert inverse_service.check(forged)["verdict"] == "invalid"
    swapped = [
        found["left_out"][0] | {"where": found["left_out"][1]["where"]},
        *found["left_out"][1:],
    ]
    assert inverse_service.check(found | {"left_out": swapped})["verdict"] == "invalid"


@pytest.mark.slow
def test_letters_in_exponents_of_one_distance_are_answered() -> None:
    """A power that is no atom of its own on a set of members was a fault of the program."""
    lines = [f"{q}'' = -a*{q}/(x^2 + y^2 + z^2)^b" for q in "xy"]
    document = {
        "equations": [*lines, "z'' = -c*z/(x^2 + y^2 + z^2)^d"],
        "parameters": ["a", "b", "c", "d"],
        "first_integrals": False,
    }
    result = inverse_service.solve(document, time_limit=30)
    assert result["verdict"] == "not_variational"
    assert inverse_service.check(dict(result))["verdict"] != "invalid"
