"""Names that the writer of a form did not declare."""

from __future__ import annotations

import pytest

from inverse_service import solve
from inverse_service.errors import InputError
from inverse_service.reading.document_names import Declared, document_names
from inverse_service.web.pages.form_documents import (
    document_of,
    equations_text,
    fields_from,
    fields_of,
    functions_of,
    lean_fields,
    parameters_of,
)
from inverse_service.web.pages.form_tasks import echo_task
from inverse_service.web.pages.forms import Form, Upload


def document(**fields: str) -> dict[str, object]:
    return document_of(Form({name: (value,) for name, value in fields.items()}))


@pytest.mark.parametrize(
    ("text", "coordinates", "parameters", "functions"),
    [
        ("x'' = -k*x", ("x",), ("k",), {}),
        ("x'' = -a*x + b*y; y'' = -c*y + d*x", ("x", "y"), ("a", "b", "c", "d"), {}),
        ("m x'' + c x' + k x = 0", ("x",), ("m", "c", "k"), {}),
        ("x''(t) = -k x(t)", ("x",), ("k",), {}),
        ("diff(x, t, 2) = -k x", ("x",), ("k",), {}),
        (r"\ddot x = -f(x-y) - k(x-y); \ddot y = f(x-y)", ("x", "y"), ("k",), {}),
        ("x'' = -F*(x - 1)", ("x",), ("F",), {}),
        (r"\ddot r = \frac{M(r-2M)}{r^3}", ("r",), ("M",), {}),
        (r"\frac{d^{2}}{d t^{2}} x{\left(t \right)} + \omega_0 x{\left(t \right)} = 0", ("x",), ("omega_0",), {}),
        (r"\frac{d}{dt}\left(t^2 \dot y\right) + t^2 y^n = 0", ("y",), ("n",), {}),
        (r"\ddot{x} = -\omega^2 x", ("x",), ("omega",), {}),
        ("x_ddot = -x; y_ddot = x_dot", ("x", "y"), (), {}),
        ("r1'' = A(r1)*r1'", ("r1",), (), {"A": ("r1",)}),
        ("x'' = V(x, y); y'' = t", ("x", "y"), (), {"V": ("x", "y")}),
        ("x'' = k*(x + 1) + k(x + 1)", ("x",), ("k",), {}),
        ("x'' = sinn(x)", ("x",), (), {}),
        ("x'' = sin(x) + pi + e^x", ("x",), (), {}),
    ],
)
def test_unknown_names_are_guessed_by_how_they_stand(
    text: str, coordinates: tuple[str, ...], parameters: tuple[str, ...], functions: dict[str, tuple[str, ...]]
) -> None:
    found = document_names(Declared(parameters="guess"), {"": text})
    assert (found.coordinates, found.parameters, found.functions) == (coordinates, parameters, functions)


def test_a_lagrangian_shows_its_coordinates_by_one_prime() -> None:
    found = document_names(Declared(parameters="guess"), {"/a": "M/2*(x'^2 + y'^2) - V(x)", "/b": "y' - x*z'"}, 1)
    assert (found.coordinates, found.parameters, found.functions) == (("x", "y", "z"), ("M",), {"V": ("x",)})


def test_what_is_declared_is_not_guessed() -> None:
    assert document_names(Declared(None, "guess", {"F": ["t"]}), {"": "x'' = F''(t)"}).coordinates == ("x",)
    found = document(equations="x'' = -k*x + c", parameters="k = 1/2", coordinates="x")
    assert found == {"coordinates": ["x"], "equations": "x'' = -k*x + c", "parameters": {"k": "1/2", "...": None}}


def test_a_nonholonomic_form_is_a_nonholonomic_document() -> None:
    found = document(
        kind="nonholonomic", lagrangian="(x'^2 + y'^2)/2", constraints="y' - x*x'\n\n", associated="second"
    )
    assert found == {
        "parameters": "guess",
        "lagrangian": "(x'^2 + y'^2)/2",
        "constraints": ["y' - x*x'"],
        "associated": "second",
    }
    assert document_of(Form({k: (v,) for k, v in fields_from(found).items()})) == found


def test_a_lagrangian_without_constraints_asks_about_no_associated_system() -> None:
    """The form always has one of them ticked; a Lagrangian alone is asked for its equations."""
    found = document(kind="nonholonomic", lagrangian="x'^2/2 - x^2/2", constraints="\n", associated="second")
    assert found == {"parameters": "guess", "lagrangian": "x'^2/2 - x^2/2"}
    assert solve(found)["system"]["equations"] == {"x": "-x"}


def test_a_document_fills_the_form_and_comes_back() -> None:
    given = {"coordinates": ["x", "y"], "equations": {"x": "-A(x)*y'", "y": "k"}, "parameters": {"k": "2"}}
    given |= {"functions": {"A": ["x"]}, "time_dependent_lagrangian": True}
    found = document_of(Form({name: (value,) for name, value in fields_from(given).items()}))
    parameters = {"k": "2", "...": None}
    assert found == {**given, "equations": equations_text(given["equations"]), "parameters": parameters}


def test_names_that_would_be_guessed_are_left_out_of_the_form() -> None:
    lean = lean_fields({"coordinates": ["x"], "equations": {"x": "-k*x"}, "parameters": ["k"]})
    assert (lean["coordinates"], lean["parameters"]) == ("", "")
    kept = lean_fields({"coordinates": ["x"], "equations": {"x": "-k*x"}, "parameters": ["k", "unused"]})
    assert (kept["coordinates"], kept["parameters"]) == ("x", "k, unused")


def test_uploaded_and_pasted_documents_are_taken_as_they_are() -> None:
    upload = Upload("a.toml", b'coordinates = ["x"]\nequations = "x\'\' = 0"\n')
    assert document_of(Form({}, {"document": upload})) == {"coordinates": ["x"], "equations": "x'' = 0"}
    assert document(equations='{"equations": "x\'\' = 0"}') == {"equations": "x'' = 0"}
    with pytest.raises(InputError):
        document(equations='{"equations": ')
    with pytest.raises(InputError):
        document_of(Form({}, {"document": Upload("a.json", b"[1]")}))


def test_lists_of_names_are_read() -> None:
    assert parameters_of(" k, m = 1/2; c\n") == {"k": None, "m": "1/2", "c": None}
    assert functions_of("A(r1), V(x, y)") == {"A": ("r1",), "V": ("x", "y")}
    assert functions_of(" ") == {}
    with pytest.raises(InputError, match="V\\(x, y\\)"):
        functions_of("A")


@pytest.mark.parametrize("typed", ["-kx", "-sinx", "-0,5 x", "-k/m x", "-k [x]"])
def test_each_reading_that_a_button_offers_can_be_read(typed: str) -> None:
    fields = {"kind": "equations", "equations": f"x'' = {typed}"}
    (place,) = echo_task(fields)["problem"].places
    assert place.choices
    for _, sent in place.choices:
        chosen = fields_of(Form({name: (value,) for name, value in (fields | {"instead": sent}).items()}))
        assert "understood" in echo_task(chosen)


@pytest.mark.parametrize("typed", ["-k [x", "-k(x + 1", "-k((x - 1)"])
def test_a_bracket_that_is_not_closed_is_the_fault_that_is_told(typed: str) -> None:
    (place,) = echo_task({"kind": "equations", "equations": f"x'' = {typed}"})["problem"].places
    assert "never closed" in place.detail
    assert place.choices == ()
