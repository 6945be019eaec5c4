"""What looks like an entry, an index or an exponent, and is none, is not read as one."""

from __future__ import annotations

import pytest

from inverse_service import errors
from inverse_service.service.documents import renaming
from inverse_service.service.documents.documents import parse_document


@pytest.mark.parametrize(
    "text",
    [
        "dydt(1) = y(2); dydt(2) = -y(1,2)",  # an entry of a matrix
        "dydt = [y(2); -y(1, 2)]",
        "dydt = [y(2); -y'(1)]",  # a rate at a moment
        "x'' = e^-x^2/3",  # e^(-x^2/3), or e^(-x^2)/3
    ],
)
def test_what_has_no_one_meaning_is_refused(text: str) -> None:
    with pytest.raises(errors.InputError):
        parse_document({"equations": text})


def test_an_index_less_one_is_that_of_the_neighbor() -> None:
    """Three bodies in a row, each with a spring to the one before."""
    chain = r"\frac12\sum_{k=1}^{3}\dot x_{k}^2 - \frac12\sum_{k=2}^{3}(x_{k}-x_{k-1})^2"
    found = parse_document({"lagrangian": chain})
    assert {name: part["text"] for name, part in found["equations"].items()} == {
        "x_1": "-x_1 + x_2", "x_2": "x_1 - 2*x_2 + x_3", "x_3": "x_2 - x_3",
    }  # fmt: skip


def test_greek_letters_and_words_are_renamed_where_they_are() -> None:
    table = {"alpha": "a", "beta": "b"}
    assert renaming.in_plain_text("\u03b1*x + beta - \u03b2", table) == "a*x + b - b"


def motion_of(text: str) -> dict[str, str]:
    """The accelerations of a text of equations, as they are printed."""
    found = parse_document({"equations": text})
    return {name: part["text"] for name, part in found["equations"].items()}


@pytest.mark.parametrize(
    ("text", "meant", "other"),
    [
        ("x'' = -w0^2x", "-w0^2*x", "-w0^(2*x)"),
        ("x'' = -x^-2y; y'' = 1", "-x^(-2)*y", "-x^(-2*y)"),
        ("x'' = 1/x+1", "1/x + 1", "1/(x + 1)"),
        ("x'' = -k/x^2-l", "-k/x^2 - l", "-k/(x^2 - l)"),
        ("x'' = -\u221ax+1", "-sqrt(x) + 1", "-sqrt(x + 1)"),
        ("x'' = -sqrt x-k", "-sqrt(x) - k", "-sqrt(x - k)"),
        ("x'' = -1/2x^2", "-x^2/2", "-1/(2*x^2)"),
        ("x'' = -3/4kx^3", "-3*k*x^3/4", "-3/(4*k*x^3)"),
        ("x'' = -1/2sin x", "-sin(x)/2", "-1/(2*sin(x))"),
        ("x'' = -k tan x/2", "-k*tan(x/2)", "-k*tan(x)/2"),
        ("theta'' = -g sin theta/l", "-g*sin(theta)/l", "-g*sin(theta/l)"),
        ("x'' = -k(x)", "-k(x)", "-k*x"),
        ("y'' = -y - a(y)", "-y - a(y)", "-y - a*y"),
    ],
)
def test_of_two_meanings_the_usual_one_is_taken_and_the_other_offered(
    text: str, meant: str, other: str
) -> None:
    found = parse_document({"equations": text})
    name, rest = next(iter(found["equations"])), text.partition(";")[2]
    assert motion_of(text) == motion_of(f"{name}'' = {meant}; {rest}")
    offered = [one for one in found["readings"] if "not" in one]
    assert len(offered) == 1
    shown = offered[0]["text"]
    assert shown in text
    assert motion_of(text.replace(shown, offered[0]["not"])) == motion_of(
        f"{name}'' = {other}; {rest}"
    )


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("x'' = 1/1+x^2", ("1/(1+x^2)", "1+x^2")),  # the 1 would be there for nothing
        ("x'' = -1/2x", ("(1/2)*x", "1/(2*x)")),
        ("r'' = -1/2r^2", ("(1/2)*r^2", "1/(2*r^2)")),
        ("x'' = -\u221a2x", ("(2)*x", "(2*x)")),  # of sqrt(2 g h) as often as of sqrt(2) x
        ("x'' = -tan^2 x/2", ("(x)/2", "(x/2)")),
        ("theta'' = -sin theta/2", ("(theta)/2", "(theta/2)")),
    ],
)
def test_what_is_meant_as_often_as_the_other_is_asked_back(
    text: str, meant: tuple[str, ...]
) -> None:
    with pytest.raises(errors.InputError) as raised:
        parse_document({"equations": text})
    assert raised.value.instead == meant


def test_a_value_1_that_a_program_puts_in_is_no_question() -> None:
    found = parse_document({"equations": "x'' = -x^2/1+(x^2)/2"})
    assert found["equations"]["x"]["text"] == "-x^2 + x^2/2"


def test_a_frequency_that_changes_is_no_delay() -> None:
    found = parse_document({"equations": "x'' = -w^2 x(1 + h cos(2 w t))"})
    assert found["equations"]["x"]["text"] == "-w^2*x*(h*cos(2*w*t) + 1)"


@pytest.mark.parametrize("text", ["x'' = 1/x + 1", "x'' = x^2/3", "x'' = f(x)", "x'' = 1/2x'"])
def test_what_has_one_meaning_is_not_explained(text: str) -> None:
    assert parse_document({"equations": text})["readings"] == []


@pytest.mark.parametrize(
    ("text", "motion", "speed"),
    [
        ("L = 1/2m v^2 - mgh", {"h": "-g"}, "h'"),
        ("L = 1/2 m v\u00b2 - m g x sin alpha", {"x": "-g*sin(alpha)"}, "x'"),
        ("T = 1/2 m v^2; V = k(x^2 + y^2)/2", {"x": "-k*x/m", "y": "-k*y/m"}, "sqrt(x'^2 + y'^2)"),
        ("L = T - V, T = 1/2 m v^2, V = m g h", {"h": "-g"}, "h'"),
        (r"\mathcal{L} = \frac12 mv^2 - \frac12 kx^2", {"x": "-k*x/m"}, "x'"),
    ],
)
def test_the_speed_of_a_lagrangian_is_that_of_its_coordinates(
    text: str, motion: dict[str, str], speed: str
) -> None:
    found = parse_document({"equations": text})
    assert {name: part["text"] for name, part in found["equations"].items()} == motion
    assert {"text": "v", "as": speed} in found["readings"]


@pytest.mark.parametrize(
    "text",
    [
        "L = 1/2 m v^2 + G M m/r",  # v has a part across r
        "L = 1/2 m v^2 - m g l cos theta",
        "L = 1/2 m v^2 - q phi + q v A",
        "T = 1/2 m v^2",
    ],
)
def test_a_speed_without_its_coordinates_is_not_guessed(text: str) -> None:
    with pytest.raises(errors.InputError):
        parse_document({"equations": text})
