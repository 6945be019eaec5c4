"""SymPy verifies each first integral of a result by its derivative along the motion."""

from typing import Any

import pytest
import sympy

import inverse_service
from inverse_service.sympy.from_sympy import expression, table_of_result
from tests.doors.rows import Row, marks, rows
from tests.values import slow

BY_NAME = {row["id"]: row["document"] for row in rows("integrals")}
ROWS = [pytest.param(row, id=row["id"], marks=marks(row)) for row in rows("integrals")]


def rates(
    result: inverse_service.Result, accelerations: dict[str, str], velocities: dict[str, str]
) -> list[Any]:
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
        numbers = {
            s: sympy.Rational(3 + k, 7)
            for k, s in enumerate(sorted(rate.free_symbols - {time}, key=str))
        }
        leaves = [*speed.values(), *(table.coordinates[name] for name in q)]
        values = {leaf: sympy.Rational(11 + 3 * k, 23) for k, leaf in enumerate(leaves)}
        found.append(rate.subs(values).subs(numbers).subs(time, sympy.Rational(2, 5)).evalf(30))
    return found


@pytest.mark.parametrize("row", ROWS)
def test_first_integrals_are_found_and_are_constant(row: Row) -> None:
    result = inverse_service.solve(row["document"])
    found = [one["name"] for one in result["first_integrals"]]
    assert len(found) >= len(row["integrals"])
    assert all(one.startswith(name) for one, name in zip(found, row["integrals"], strict=False)), (
        found
    )
    if "complete" in row:
        assert len(found) == len(row["integrals"])
        complete = result["first_integrals_complete"]
        assert [complete["degree"], complete["number"]] == row["complete"]
    accelerations, first = result["system"]["equations"], {}
    if result.get("nonholonomic"):
        motion = result["nonholonomic"]["equations_of_motion"]
        accelerations = {name: one["text"] for name, one in motion["accelerations"].items()}
        first = {name: one["text"] for name, one in motion["first_order"].items()}
    assert all(abs(rate) < 1e-25 for rate in rates(result, accelerations, first))


@pytest.mark.parametrize(
    ("equations", "place", "text"),
    [
        slow(
            "x'' = -k*x - c*x'",
            0,
            "log(x'^2+k*x^2+c*x*x')/2 - c/sqrt(4*k-c^2)*atan((c*x+2*x')/(x*sqrt(4*k-c^2)))",
        ),
        slow("x'' = -k*x - c*x'", 1, "t + 2*atan((c*x+2*x')/(x*sqrt(4*k-c^2)))/sqrt(4*k-c^2)"),
        slow("x' = a*x - b*x*y; y' = -c*y + d*x*y", 0, "d*x + (a-c)*log(x) - x'/x - a*log(a*x-x')"),
        slow("x'' + 3*k*x*x' + k^2*x^3 = 0", 0, "(k*x^2+2*x')/(k*x^2+x')^2"),
        ("x'' = -k*x*(1 - x'^2)^(3/2)", 0, "k*x^2/2 + 1/sqrt(1-x'^2)"),
        slow("x'' = t*y'; y'' = -t*x'", 1, "cos(t^2/2)*x' - sin(t^2/2)*y'"),
    ],
)
def test_a_first_integral_is_as_short_as_in_a_book(equations: str, place: int, text: str) -> None:
    found = inverse_service.solve(equations)["first_integrals"][place]
    assert len(found["text"].replace(" ", "")) <= 1.15 * len(text.replace(" ", ""))


def test_those_of_one_side_are_said_to_be() -> None:
    sides = inverse_service.solve("x'' = -sign(x)")["branches"]
    assert [side["first_integrals"][0]["domain"] for side in sides] == [["x > 0"], ["x < 0"]]


def test_they_are_left_out_when_asked() -> None:
    assert (
        inverse_service.solve({"equations": "x'' = -x", "first_integrals": False})[
            "first_integrals"
        ]
        == []
    )


@pytest.mark.slow
def test_a_part_of_the_coordinates_is_closed() -> None:
    result = inverse_service.solve(BY_NAME["integrals ball on a turntable"])
    assert (result["reduced"]["coordinates"], result["reduced"]["checked"]) == (["x", "y"], "valid")


@pytest.mark.slow
def test_the_measure_of_the_ball_is_real() -> None:
    document = {
        "coordinates": ["x", "y", "ph", "th", "ps"],
        "parameters": {"m": "1", "A": "1", "B": "2", "C": "3", "R": "1"},
        "lagrangian": f"m*(x'^2+y'^2)/2+{BY_NAME['integrals Suslov']['lagrangian']}",
        "constraints": BY_NAME["integrals Routh's sphere"]["constraints"],
        "associated": "any",
        "first_integrals": False,
    }
    density = inverse_service.solve(document)["nonholonomic"]["measure_density"]["density"]["text"]
    value = sympy.sympify(density.replace("^", "**")).subs({"th": 1, "ps": 2, "ph": 1}).evalf()
    assert value.is_real
    assert value > 0


@pytest.mark.parametrize(
    ("equations", "wanted"),
    [("x'' = -x'^2; w'' = 0", "x'*exp(x)"), ("x'' = -2*x'*y'; y'' = 0", "x'*exp(2*y)")],
)
def test_exponentials_of_coordinates_that_damp(equations: str, wanted: str) -> None:
    """v e^(c q) is constant for v' = -c q' v; 35 products, as of a free particle in the plane."""
    result = inverse_service.solve({"equations": equations})
    complete = result["first_integrals_complete"]
    assert (complete["degree"], complete["number"], complete["checked"]) == (4, 35, "valid")
    assert wanted in {one["text"] for one in (*complete["others"], *result["first_integrals"])}


def test_integrals_of_four_coordinates_are_counted() -> None:
    """1, H and the energies of three of four oscillators, to degree 2."""
    equations = "x'' = -x^3; y'' = -2*y^3; z'' = -3*z^2; w'' = -5*exp(w)"
    complete = inverse_service.solve({"equations": equations})["first_integrals_complete"]
    assert (complete["degree"], complete["number"], complete["checked"]) == (2, 5, "valid")


@slow
def test_three_bodies_on_a_line_have_seven_integrals_to_degree_two() -> None:
    """1, P, P^2, H, and three quadratic ones, two of which follow from those with t: Calogero's
    system has five independent ones (Wojciechowski 1983).
    """
    result = inverse_service.solve(BY_NAME["integrals Calogero"])
    complete = result["first_integrals_complete"]
    assert (complete["degree"], complete["number"]) >= (2, 7)
