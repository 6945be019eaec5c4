"""What is called readable without reading is readable: held against the reader."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings, strategies

from inverse_service import catalogue, errors
from inverse_service.service.documents import documents, plain_system

OPERANDS = strategies.sampled_from([
    "x", "q1", "k", "a_2", "w", "y", "x'", "q1'", "x^2", "k^ 3", "(x - k)", "(w)^2", "sin(x)", "exp(-k*x')^2", "2", "0.5",
    "10", "0", "1.", "t", "e", "i", "z", "x2", "X", "k'", "x^", "x^2.5", "x^12", "2^2", "(x", "x)", "log(x)", "x(2)", "- x",
])  # fmt: skip
SIGNS = strategies.sampled_from(["+", "-", "*", "/", " ", "", " + ", "**"])
FORMULAS = strategies.lists(strategies.tuples(OPERANDS, SIGNS), min_size=1, max_size=6).map(
    lambda pairs: "".join(operand + sign for operand, sign in pairs[:-1]) + pairs[-1][0]
)


def is_refused(document: object) -> bool:
    """Whether the reader refuses it."""
    try:
        documents.refuse_unreadable(document)
    except errors.InputError:
        return True
    return False


@settings(max_examples=60, deadline=None)
@given(FORMULAS, FORMULAS)
def test_what_is_called_readable_is_read(first: str, second: str) -> None:
    declared = {
        "coordinates": ["x", "q1"],
        "equations": {"x": first, "q1": second},
        "parameters": ["k", "a_2", "w", "y"],
    }
    for document in (declared, {"equations": f"x'' = {first}; q1''={second}"}):
        if plain_system.is_readable(json.dumps(document)):
            assert not is_refused(document), document


@pytest.mark.parametrize("formula", [
    "-x", "-k*x - w*x'", "a_2*x^3/2", "-sin(x)*cos(x')", "(x + 2)*(x - k)^2", "0.5*x/k", "-(-x)",
])  # fmt: skip
def test_plain_formulas_are_readable(formula: str) -> None:
    document = {
        "coordinates": ["x"],
        "equations": {"x": formula},
        "parameters": ["k", "a_2", "w"],
    }
    assert plain_system.is_readable(json.dumps(document))
    assert not is_refused(document)


@pytest.mark.parametrize("formula", [
    "", "x +", "x/0", "x/0.0", "x/(y - y)", "2 x", "x^2^3", "2^3", "x**2", "x''", "k'", "z", "t*x", "(x", "x)", "--x",
    "x^10", "x^2.5", "log(x)", "sin x", "x(2)", "sin(", "()", "e*x", "k x", "1e5*x",
])  # fmt: skip
def test_what_needs_a_reader_is_left_to_it(formula: str) -> None:
    document = {
        "coordinates": ["x", "y"],
        "equations": {"x": formula, "y": "x"},
        "parameters": ["k"],
    }
    assert not plain_system.is_readable(json.dumps(document))


@pytest.mark.parametrize("document", [
    [], {}, {"equations": {}}, {"coordinates": [], "equations": {}}, {"coordinates": ["x"], "equations": {"y": "x"}},
    {"coordinates": ["x"], "equations": "x'' = -x"}, {"equations": "x' = -x"}, {"equations": "x'' = -x; x'' = x"},
    {"equations": "x'' = -x", "parameters": ["k"]}, {"coordinates": ["t"], "equations": {"t": "-1"}},
    {"coordinates": ["x", "x"], "equations": {"x": "-x"}}, {"coordinates": "x", "equations": {"x": "-x"}},
    {"coordinates": ["x"], "equations": {"x": 1}}, {"coordinates": ["x"], "equations": {"x": "-x"}, "clock": "x"},
    {"coordinates": ["x"], "equations": {"x": "-x" + " + x" * 200}},
])  # fmt: skip
def test_other_documents_are_left_to_the_reader(document: object) -> None:
    assert not plain_system.is_readable(json.dumps(document))


def test_systems_of_the_catalogue_that_are_called_readable_are_read() -> None:
    texts = [json.dumps(catalogue.entry(name)["document"]) for name in catalogue.names()]
    found = [text for text in texts if plain_system.is_readable(text)]
    assert len(found) > 10
    assert not [text for text in found if is_refused(json.loads(text))]


@pytest.mark.parametrize("other", ["x''", "d2x/dt2", "ddot(x)", r"\ddot{x}"])
def test_two_equations_for_one_coordinate_are_refused(other: str) -> None:
    """However its second derivative is written."""
    with pytest.raises(errors.InputError, match="two equations for x"):
        documents.parse_document({"equations": {"x": "-x", other: "-x", "y": "-y"}})


@pytest.mark.parametrize("time", ["s", "tau", "time"])
def test_where_the_time_is_named_no_other_letter_is_it(time: str) -> None:
    """In y'' = -x y the x alone is taken for the independent variable only where none is named."""
    found = documents.parse_document({"equations": "y'' = -x*y", "time": time, "parameters": ["x"]})
    assert found["parameters"] == ["x"]
    with pytest.raises(errors.InputError, match="'x' is not declared"):
        documents.parse_document({"equations": "y'' = -x*y", "time": time, "parameters": ["k"]})
