"""All forms of a document give the same system; each fault gives one sentence and its place."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Symbol, Velocity, number, substitute
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem


def _texts(system: SecondOrderSystem) -> dict[str, str]:
    return dict(zip(system.coordinates, map(to_text, system.accelerations), strict=True))


FORMS: list[tuple[dict[str, Any], dict[str, str]]] = [
    ({"equations": {"x": "-y'", "y": "0"}}, {"x": "-y'", "y": "0"}),
    ({"coordinates": ["y", "x"], "equations": {"x": "-y'", "y": "0"}}, {"y": "0", "x": "-y'"}),
    ({"equations": {"x''": "-y'", "y_ddot": "0"}}, {"x": "-y'", "y": "0"}),
    ({"equations": {r"\ddot{x}": "-y'", "yddot": "0"}}, {"x": "-y'", "y": "0"}),
    ({"equations": {"x": "x'' = -y'", "y": r"\ddot{y} = 0"}}, {"x": "-y'", "y": "0"}),
    ({"equations": {"x": "-y", "y": "x''"}}, {"x": "-y", "y": "-y"}),
    ({"equations": "x'' = -y'; y'' + y = 0"}, {"x": "-y'", "y": "-y"}),
    ({"equations": ["y'' + y", "x'' = -y'"]}, {"y": "-y", "x": "-y'"}),
    ({"equations": "xddot = -ydot\ny_ddot = 0"}, {"x": "-y'", "y": "0"}),
    (
        {"equations": "Derivative(x(t), (t, 2)) = -x(t); diff(y, t, t) = 0; diff(z, t, 2) = 1"},
        {"x": "-x", "y": "0", "z": "1"},
    ),
    ({"equations": r"\ddot{x} = -\dot{y} \\ \ddot{y} = 0"}, {"x": "-y'", "y": "0"}),
    ({"equations": r"\frac{d^2 x}{dt^2} = -x"}, {"x": "-x"}),
    ({"equations": "x'' + y'' = -x, x'' - y'' = y"}, {"x": "-(x - y)/2", "y": "-(x + y)/2"}),
    ({"coordinates": ["\u03c6"], "equations": {"phi": "-sin(\u03c6)"}}, {"phi": "-sin(phi)"}),
    ({"coordinates": [r"\theta"], "equations": {"theta": "0"}}, {"theta": "0"}),
    ({"coordinates": ["r_1"], "equations": {"r_1": "-r1"}}, {"r_1": "-r_1"}),
    ({"coordinates": ["x"], "equations": {"x": "t*x"}}, {"x": "t*x"}),
    ({"coordinates": ["x"], "equations": {"x": 0}}, {"x": "0"}),
    ({"equations": {"x": "-k*x"}, "parameters": ["k"]}, {"x": "-k*x"}),
    ({"equations": {"x": "-k*x"}, "parameters": {"k": None}}, {"x": "-k*x"}),
    ({"equations": {"x": "-k*x"}, "parameters": {"k": "1/2"}}, {"x": "-x/2"}),
    ({"equations": {"x": "-k*x"}, "parameters": {"k": "0.1"}}, {"x": "-x/10"}),
    ({"equations": {"x": "-k*x"}, "parameters": {"k": 0.1}}, {"x": "-x/10"}),
    ({"equations": {"x": "-k*x"}, "parameters": {"k": "sqrt(2)*pi"}}, {"x": "-sqrt(2)*pi*x"}),
    ({"equations": {"x": "x^k"}, "parameters": {"k": 3}}, {"x": "x^3"}),
    ({"equations": {"x": "A'(x)"}, "functions": {"A": ["x"]}}, {"x": "A'(x)"}),
    ({"equations": {"x": "A"}, "functions": {"A": ["x", "t"]}}, {"x": "A(x, t)"}),
    ({"equations": "A'(x)*x'' = 1", "functions": {"A": ["x"]}}, {"x": "1/A'(x)"}),
    ({"equations": "x'' = A''(x)", "functions": {"A": ["x"]}}, {"x": "A''(x)"}),
    ({"equations": {"E": "-I*E"}, "parameters": ["I"]}, {"E": "-I*E"}),
    (
        {"equations": {f"q{k}": "0" for k in range(8)}},
        {f"q{k}": "0" for k in range(8)},
    ),
]


def _read(document: dict[str, Any]) -> SecondOrderSystem:
    return read_system(
        document.get("coordinates"),
        document["equations"],
        document.get("parameters", []),
        document.get("functions", {}),
        document.get("name", ""),
    )


@pytest.mark.parametrize(("document", "accelerations"), FORMS, ids=range(len(FORMS)))
def test_form_is_read_as_explicit_accelerations(document: dict[str, Any], accelerations: dict[str, str]) -> None:
    system = _read(document)
    assert _texts(system) == accelerations
    assert list(system.coordinates) == list(accelerations)


def test_declarations_are_kept_and_values_are_put_in() -> None:
    system = read_system(None, {"x": "a*x + b"}, {"a": None, "b": 2}, {"A": ["x"]}, "two")
    assert (system.name, system.parameters, system.functions) == ("two", ("a",), (("A", ("x",)),))
    assert _texts(system) == {"x": "a*x + 2"}


def test_explicit_equations_keep_the_form_they_were_written_in() -> None:
    assert _texts(read_system(["x"], {"x": "x*(x + 1)*(x - 1)"}))["x"] == "x*(x + 1)*(x - 1)"


FAULTS: list[tuple[dict[str, Any], str, int | None, str]] = [
    ({"coordinates": ["x", "y"], "equations": {"x": "0"}}, "/equations", None, "equation of y is missing"),
    ({"coordinates": ["x"], "equations": {"x": "0", "z": "1"}}, "/equations/z", None, "coordinates are x"),
    ({"equations": {"x": "0", "x''": "1"}}, "/equations/x''", None, "two equations for x"),
    ({"coordinates": ["x", "x"], "equations": {"x": "0"}}, "/coordinates/1", None, "declared twice"),
    ({"coordinates": ["x"], "equations": {"x": "0"}, "parameters": ["x"]}, "/parameters/0", None, "declared twice"),
    ({"coordinates": ["x"], "equations": {"x": "0"}, "parameters": {"x": 1}}, "/parameters/x", None, "declared twice"),
    ({"equations": {"x": "0"}, "functions": {"x": ["x"]}}, "/functions/x", None, "declared twice"),
    ({"coordinates": ["t"], "equations": {"t": "0"}}, "/coordinates/0", None, "the time"),
    ({"coordinates": ["sin"], "equations": {"sin": "0"}}, "/coordinates/0", None, "a function"),
    ({"coordinates": ["pi"], "equations": {"pi": "0"}}, "/coordinates/0", None, "the number pi"),
    ({"coordinates": ["1x"], "equations": {"1x": "0"}}, "/coordinates/0", None, "letter first"),
    ({"coordinates": ["x y"], "equations": {}}, "/coordinates/0", None, "letter first"),
    ({"coordinates": ["__import__"], "equations": {}}, "/coordinates/0", None, "letter first"),
    ({"coordinates": [""], "equations": {}}, "/coordinates/0", None, "letter first"),
    ({"coordinates": ["x" * 50], "equations": {}}, "/coordinates/0", None, "40 characters"),
    ({"coordinates": [], "equations": {}}, "/coordinates", None, "no coordinates"),
    ({"equations": {}}, "/equations", None, "no coordinates"),
    ({"equations": "x' = 1"}, "/equations", None, "no coordinates"),
    ({"equations": ""}, "/equations", 1, "empty"),
    ({"equations": {f"q{k}": "0" for k in range(65)}}, "/equations", None, "limit is 64"),
    ({"coordinates": [f"q{k}" for k in range(65)], "equations": {}}, "/coordinates", None, "limit is 64"),
    ({"equations": [f"q{k}'' = 0" for k in range(65)]}, "/equations", None, "limit is 64"),
    ({"equations": "".join(f"q{k}'' = 0;" for k in range(65))}, "/equations", None, "limit is 64"),
    ({"equations": {"x": "0"}, "parameters": [f"p{k}" for k in range(201)]}, "/parameters", None, "limit is 200"),
    ({"equations": {"x": "k*x"}}, "/equations/x", 1, "parameters"),
    ({"equations": {"x": "0", "a/b": "1"}}, "/equations/a~1b", None, "letter first"),
    ({"equations": {"x": "x + "}}, "/equations/x", 5, "formula ends"),
    ({"equations": {"x": "y'' = 1", "y": "0"}}, "/equations/x", 1, "left side is not x''"),
    ({"equations": {"x": "x'' = 1; y'' = 1", "y": "0"}}, "/equations/x", 1, "several equations"),
    ({"equations": {"x": True}}, "/equations/x", None, "not a text"),
    ({"equations": {"x": 0.5}}, "/equations/x", None, "not a text"),
    ({"equations": ["x'' = 0", "y'' = foo"]}, "/equations/1", 7, "foo"),
    ({"equations": ["x'' = 0", None]}, "/equations/1", None, "not a text"),
    ({"equations": "x'' = y'"}, "/equations", 7, "add its equation too"),
    ({"equations": {"x": "1/k"}, "parameters": {"k": 0}}, "/parameters", None, "no real value"),
    ({"equations": {"x": "log(k)"}, "parameters": {"k": -1}}, "/parameters", None, "no real value"),
    ({"equations": {"x": "0"}, "parameters": {"k": "1/0"}}, "/parameters/k", 3, "division by zero"),
    ({"equations": {"x": "0"}, "parameters": {"k": "x"}}, "/parameters/k", 1, "write a number"),
    ({"equations": {"x": "0"}, "parameters": {"k": "t"}}, "/parameters/k", 1, "time"),
    ({"equations": {"x": "0"}, "parameters": {"k": "exit()"}}, "/parameters/k", 1, "write a number"),
    ({"equations": {"x": "0"}, "parameters": {"k": True}}, "/parameters/k", None, "not a number"),
    ({"equations": {"x": "0"}, "parameters": {"k": float("nan")}}, "/parameters/k", 1, "finite"),
    ({"equations": {"x": "0"}, "parameters": {"k": 10**5000}}, "/parameters/k", None, "digits"),
    ({"equations": {"x": "A(x)"}, "functions": {"A": ["z"]}}, "/functions/A/0", None, "not a coordinate"),
    ({"equations": {"x": "0"}, "functions": {"A": ["x", "x"]}}, "/functions/A/1", None, "twice"),
    ({"equations": {"x": "0"}, "functions": {"A": []}}, "/functions/A", None, "no list"),
    ({"equations": {"x": "0"}, "functions": {"A": "x"}}, "/functions/A", None, "no list"),
    ({"equations": {"x": "0"}, "functions": {"A": list("abcdfgh")}}, "/functions/A", None, "limit is 6"),
    ({"equations": {"x": "0"}, "functions": {"exp": ["x"]}}, "/functions/exp", None, "a function"),
    ({"equations": {"x": "0"}, "parameters": ["x_dot"]}, "/parameters/0", None, "derivative of the coordinate x"),
    ({"equations": {"x": "0"}, "parameters": ["p_x"]}, "/parameters/0", None, "momentum of the coordinate x"),
]


@pytest.mark.parametrize(("document", "pointer", "column", "fragment"), FAULTS, ids=range(len(FAULTS)))
def test_fault_is_named_with_its_place(
    document: dict[str, Any], pointer: str, column: int | None, fragment: str
) -> None:
    with pytest.raises(InputError) as caught:
        _read(document)
    error = caught.value
    assert (error.pointer, error.column, fragment in error.detail) == (pointer, column, True), error.detail
    assert error.detail.endswith(".")
    assert error.detail.isprintable()


def test_passed_limits_have_their_own_error() -> None:
    with pytest.raises(LimitError):
        read_system([f"q{k}" for k in range(65)], {})


def test_a_function_over_other_names_that_no_equation_uses_is_left_out() -> None:
    """The first document of the contract declares A over r1, and has neither."""
    found = read_system(["x", "y"], {"x": "-x", "y": "B(y)"}, functions={"A": ["r1"], "B": ["y"]})
    assert [name for name, _ in found.functions] == ["B"]


@pytest.mark.parametrize("twice", ["x_ddot", "xddot", "x_dot_dot", "x_dotdot", "xdotdot", "x''"])
def test_dots_written_as_words_are_derivatives(twice: str) -> None:
    found = read_system(None, f"{twice} = -x_dot - xdot - x")
    assert found.coordinates == ("x",)
    assert found.accelerations == read_system(["x"], {"x": "-x' - x' - x"}).accelerations


@pytest.mark.parametrize(
    "equation",
    [
        "diff(t^2*x', t) = -t^2*x",
        r"\frac{d}{dt}\left(t^2 \dot x\right) + t^2 x = 0",
        "t^2*x''(t) + 2*t*x'(t) + t^2*x(t)",
        "diff(x(t), (t, 2)) = -x - 2*x'/t",
        r"\frac{d^{2}}{d t^{2}} x{\left(t \right)} = - x{\left(t \right)} - 2 \frac{d}{d t} x{\left(t \right)} / t",
    ],
)
def test_coordinates_are_found_under_every_second_derivative(equation: str) -> None:
    system = read_system(None, equation)
    assert system.coordinates == ("x",)
    place = {Symbol("x"): number(3), Velocity("x"): number(5), TIME: number(2)}
    assert substitute(system.accelerations[0], place) == number(-8)


@pytest.mark.parametrize("equation", ["diff(x, t) = 0", "diff(x', y) = 0", "diff(x', t", "diff()", "diff(, t)"])
def test_other_derivatives_make_no_coordinate(equation: str) -> None:
    with pytest.raises(InputError):
        read_system(None, equation)


def test_of_first_order_equations_it_is_known_what_the_other_names_are() -> None:
    system = read_system(None, ["x' = a*x - b*x*y", "y' = -c*y + d*x*y"], ["a", "b", "c", "d"])
    assert system.coordinates == ("x",)
    assert [(name, to_text(tree)) for name, tree in system.others] == [("y", "(a*x - x')/(x*b)")]
    assert read_system(None, ["x'' = -x"]).others == ()


@pytest.mark.parametrize(
    ("equations", "coordinates", "others"),
    [
        ("x' = y^2; y' = -x", ("y",), [("x", "-y'")]),
        ("x' = sin(y); y' = -x; z' = w^3; w' = -z", ("y", "w"), [("x", "-y'"), ("z", "-w'")]),
    ],
)
def test_of_first_order_equations_those_are_coordinates_that_can_be(
    equations: str, coordinates: tuple[str, ...], others: list[tuple[str, str]]
) -> None:
    """x' = y^2 has no y of its own; y' = -x gives x."""
    system = read_system(None, equations)
    assert system.coordinates == coordinates
    assert [(name, to_text(tree)) for name, tree in system.others] == others
