"""Lines that go on in the next one, and what stands around a name."""

from __future__ import annotations

import pytest

from inverse_service.reading import document_names, tokens as tk
from inverse_service.service.documents.documents import parse_document


@pytest.mark.parametrize("sign", ["+", "-", "*", "/", "^", "="])
def test_a_line_that_ends_with_a_sign_goes_on_in_the_next(sign: str) -> None:
    left, right = ("x''", "2*x") if sign == "=" else (f"x'' = -x {sign}", "2")
    broken = left + (f" {sign}" if sign == "=" else "") + "\n" + right
    found, whole = (
        parse_document({"equations": text}) for text in (broken, broken.replace("\n", " "))
    )
    assert found["equations"] == whole["equations"]


@pytest.mark.parametrize(
    ("text", "around"),
    [
        ("2*sin(x) + cos(y)", {"x": "sin", "y": "cos"}),
        ("a*(b + sin(x))*tan(y)", {"b": "*", "x": "sin", "y": "tan"}),
    ],
)
def test_each_name_knows_what_is_before_its_bracket(text: str, around: dict[str, str]) -> None:
    line = tk.nested(tk.tokenize(text))
    found = {tokens[k].text: outer.text for tokens, k, outer in tk.places(line)}
    assert {name: found[name] for name in around} == around


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("sin(u)", {"u"}),
        ("-a*cos(2*u)", {"u"}),
        ("3*sin(u - v) + cos(w)", {"u", "v", "w"}),
        ("sin(k*u)", set()),
        ("cos(u + w*t)", set()),
        ("exp(u) + a*(u + 1)", set()),
        ("cos 2 u", {"u"}),
        ("a + sin u", {"u"}),
    ],
)
def test_angles_are_what_sines_are_of_with_numbers_alone(text: str, angles: set[str]) -> None:
    line = tk.nested(tk.tokenize(text))
    found = {
        each[k].text
        for each, k, outer in tk.places(line)
        if each[k].kind == "name" and document_names.is_angle(each, k, outer)
    }
    assert found - {"sin", "cos", "exp"} == angles
