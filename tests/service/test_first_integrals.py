"""First integrals at the door: SymPy differentiates each along the motion."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import inverse_service
from inverse_service.sympy.from_sympy import expression, table_of_result

W1, W2, W3 = "(ph'*sin(th)*sin(ps)+th'*cos(ps))", "(ph'*sin(th)*cos(ps)-th'*sin(ps))", "(ph'*cos(th)+ps')"
TOP = f"A/2*{W1}^2+B/2*{W2}^2+C/2*{W3}^2"
ROLLING = ["x'-R*(th'*sin(ph)-ps'*sin(th)*cos(ph))", "y'+R*(th'*cos(ph)+ps'*sin(th)*sin(ph))"]
DOCUMENTS: dict[str, tuple[dict[str, Any], list[str]]] = {
    "oscillators": ({"equations": "x'' = -x; y'' = -4*y"}, ["energy", "quadratic", "quadratic"]),
    "Kepler": (
        {"equations": "x'' = -k*x/(x^2+y^2)^(3/2); y'' = -k*y/(x^2+y^2)^(3/2)", "parameters": ["k"]},
        ["energy", "angular momentum in x, y", "quadratic"],
    ),
    "Kepler, polar": (
        {"equations": "r'' = r*phi'^2 - k/r^2; phi'' = -2*r'*phi'/r", "parameters": ["k"]},
        ["energy", "momentum of phi", "quadratic"],
    ),
    "Kepler, spherical": (
        {
            "equations": "r'' = r*(th'^2 + sin(th)^2*ph'^2) - k/r^2; th'' = -2*r'*th'/r + sin(th)*cos(th)*ph'^2;"
            "ph'' = -2*r'*ph'/r - 2*cot(th)*th'*ph'",
            "parameters": ["k"],
        },
        ["energy", "momentum of ph", "linear", "linear"],
    ),
    "Calogero": (
        {
            "equations": "x'' = 2/(x-y)^3 + 2/(x-z)^3; y'' = 2/(y-x)^3 + 2/(y-z)^3; z'' = 2/(z-x)^3 + 2/(z-y)^3",
        },
        ["energy", "momentum along x, y, z", "quadratic", "linear", "scaling"],
    ),
    "Emden": ({"equations": "y'' = -2*y'/t - y^5"}, ["scaling"]),
    "Emden, other powers": ({"equations": "y'' = -5*y'/t - y^2"}, ["scaling"]),
    "magnetic pole": (
        {
            "equations": "x'' = g*(y*z'-z*y')/(x^2+y^2+z^2)^(3/2); y'' = g*(z*x'-x*z')/(x^2+y^2+z^2)^(3/2);"
            "z'' = g*(x*y'-y*x')/(x^2+y^2+z^2)^(3/2)",
            "parameters": ["g"],
        },
        ["energy", "angular momentum", "linear", "linear", "scaling"],
    ),
    "relativistic": (
        {"equations": "d/dt(m*x'/sqrt(1 - x'^2/c^2)) = -k*x", "parameters": ["m", "c", "k"]},
        ["energy"],
    ),
    "Toda": (
        {"equations": "x'' = -exp(x-y); y'' = exp(x-y)-exp(y-z); z'' = exp(y-z)"},
        ["energy", "momentum along x, y, z"],
    ),
    "free": ({"equations": "x'' = 0"}, ["energy", "linear"]),
    "not variational": ({"equations": "x'' = y; y'' = -x*y'"}, []),
}
MOTIONS: dict[str, tuple[dict[str, Any], list[str]]] = {
    "ball on a turntable": (
        {
            "coordinates": ["x", "y", "th", "ph", "ps"],
            "parameters": ["m", "I", "R", "W"],
            "lagrangian": "m*(x'^2+y'^2)/2+I/2*(th'^2+ph'^2+ps'^2+2*ph'*ps'*cos(th))",
            "constraints": [f"{ROLLING[0]} + W*y", f"{ROLLING[1]} - W*x"],
        },
        ["momentum of ph", "linear", "linear", "linear"],
    ),
    "Suslov": (
        {
            "coordinates": ["ph", "th", "ps"],
            "parameters": ["A", "B", "C"],
            "lagrangian": TOP,
            "constraints": ["ph'*cos(th)+ps'"],
        },
        ["energy", "linear"],
    ),
    "Routh's sphere": (
        {
            "coordinates": ["x", "y", "th", "ph", "ps"],
            "parameters": ["m", "A", "C", "R", "a", "g"],
            "lagrangian": "m/2*((x'-a*(ph'*cos(ph)*sin(th)+th'*sin(ph)*cos(th)))^2"
            "+(y'+a*(th'*cos(ph)*cos(th)-ph'*sin(ph)*sin(th)))^2+a^2*sin(th)^2*th'^2)"
            "+A/2*(th'^2+sin(th)^2*ph'^2)+C/2*(ps'+ph'*cos(th))^2+m*g*a*cos(th)",
            "constraints": ROLLING,
        },
        ["energy", "linear", "linear"],
    ),
}


def rates(result: inverse_service.Result, accelerations: dict[str, str], velocities: dict[str, str]) -> list[Any]:
    """dF/dt along the motion of each first integral, at a point."""
    table = table_of_result({"system": result["system"]})
    q = list(result["system"]["coordinates"])
    read = lambda text: expression(text, table)  # noqa: E731
    time = table.time
    speed = {name: sympy.Derivative(table.coordinates[name], time) for name in q}
    on = {speed[name]: read(text) for name, text in velocities.items()}
    bend = {sympy.diff(speed[name], time): read(text) for name, text in accelerations.items()}
    found = []
    for one in result["first_integrals"]:
        rate = sympy.diff(read(one["text"]), time).subs(bend).subs(on)
        numbers = {s: sympy.Rational(3 + k, 7) for k, s in enumerate(sorted(rate.free_symbols - {time}, key=str))}
        leaves = [*speed.values(), *(table.coordinates[name] for name in q)]
        values = {leaf: sympy.Rational(11 + 3 * k, 23) for k, leaf in enumerate(leaves)}
        found.append(rate.subs(values).subs(numbers).subs(time, sympy.Rational(2, 5)).evalf(30))
    return found


def is_named(result: inverse_service.Result, names: list[str]) -> None:
    found = [one["name"] for one in result["first_integrals"]]
    assert len(found) >= len(names)
    assert all(one.startswith(name) for one, name in zip(found, names, strict=False)), found


@pytest.mark.parametrize("name", DOCUMENTS)
def test_first_integrals_of_equations(name: str) -> None:
    document, names = DOCUMENTS[name]
    result = inverse_service.solve(document)
    is_named(result, names)
    assert all(abs(rate) < 1e-25 for rate in rates(result, result["system"]["equations"], {}))


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_first_integrals_along_constraints(name: str) -> None:
    document, names = MOTIONS[name]
    result = inverse_service.solve({**document, "associated": "any"})
    is_named(result, names)
    motion = result["nonholonomic"]["equations_of_motion"]
    accelerations = {name: one["text"] for name, one in motion["accelerations"].items()}
    first = {name: one["text"] for name, one in motion["first_order"].items()}
    assert all(abs(rate) < 1e-25 for rate in rates(result, accelerations, first))


@pytest.mark.parametrize(
    ("equations", "place", "text"),
    [
        ("x'' = -k*x - c*x'", 0, "log(x'^2+k*x^2+c*x*x')/2 - c/sqrt(4*k-c^2)*atan((c*x+2*x')/(x*sqrt(4*k-c^2)))"),
        ("x'' = -k*x - c*x'", 1, "t + 2*atan((c*x+2*x')/(x*sqrt(4*k-c^2)))/sqrt(4*k-c^2)"),
        ("x' = a*x - b*x*y; y' = -c*y + d*x*y", 0, "d*x + (a-c)*log(x) - x'/x - a*log(a*x-x')"),
        ("x'' + 3*k*x*x' + k^2*x^3 = 0", 0, "(k*x^2+2*x')/(k*x^2+x')^2"),
        ("x'' = -k*x*(1 - x'^2)^(3/2)", 0, "k*x^2/2 + 1/sqrt(1-x'^2)"),
        ("x'' = t*y'; y'' = -t*x'", 1, "2*atan(y'/x') + t^2"),
    ],
)
def test_a_first_integral_is_as_short_as_in_a_book(equations: str, place: int, text: str) -> None:
    found = inverse_service.solve(equations)["first_integrals"][place]
    assert len(found["text"].replace(" ", "")) <= 1.15 * len(text.replace(" ", ""))


def test_they_are_left_out_when_asked() -> None:
    assert inverse_service.solve({"equations": "x'' = -x", "first_integrals": False})["first_integrals"] == []


def test_a_part_of_the_coordinates_is_closed() -> None:
    result = inverse_service.solve({**MOTIONS["ball on a turntable"][0], "associated": "any"})
    assert (result["reduced"]["coordinates"], result["reduced"]["checked"]) == (["x", "y"], "valid")


@pytest.mark.slow
def test_the_measure_of_the_ball_is_real() -> None:
    document = {
        "coordinates": ["x", "y", "ph", "th", "ps"],
        "parameters": {"m": "1", "A": "1", "B": "2", "C": "3", "R": "1"},
        "lagrangian": f"m*(x'^2+y'^2)/2+{TOP}",
        "constraints": ROLLING,
        "associated": "any",
        "first_integrals": False,
    }
    density = inverse_service.solve(document)["nonholonomic"]["measure_density"]["density"]["text"]
    value = sympy.sympify(density.replace("^", "**")).subs({"th": 1, "ps": 2, "ph": 1}).evalf()
    assert value.is_real
    assert value > 0
