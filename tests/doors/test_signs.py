"""Rules about whole statements are patterns over signs, whose spans are those of the text."""

import pytest

from inverse_service.reading import signs
from inverse_service.reading.typed_text import Typed

ROWS = {
    "letter_l": (r"so \mathcal {L} = T", r"\mathcal {L}"),
    "metric": (r"d\,s^{2} = dr^2", r"d\,s^{2}"),
    "lagranges_equation": ("L = x'^2; d/dt(dL/dx') - dL/dx = 0", "d/dt(dL/dx') - dL/dx = 0"),
    "zero": ("f = x^2 + y^2 - 1 = 0", "f = x^2 + y^2 - 1"),
    "action": (r"S[q] = \int_{t_1}^{t_2} L\,dt", r"S[q] = \int_{t_1}^{t_2}"),
    "measure": ("x'^2 dt", "dt"),
    "vector": (r"\mathbf{r} = \left(x, y\right)", r"\mathbf{r} = \left(x, y\right)"),
    "span": ("D = span{∂_x + y ∂_z, ∂_y}", "D = span{∂_x + y ∂_z, ∂_y}"),
}


@pytest.mark.parametrize("rule", ROWS)
def test_what_a_rule_finds_is_where_it_was_typed(rule: str) -> None:
    text, found = ROWS[rule]
    first = signs.first(rule, text)
    assert first is not None
    start, stop = first.span()
    assert (first.text, text[start:stop]) == (found, found)


@pytest.mark.parametrize(("text", "begun"), [("dphi^2", 1), (r"d \phi^2", 2), ("2 dr dt", 3)])
def test_a_group_may_begin_inside_a_sign(text: str, begun: int) -> None:
    found = signs.first("differential", text)
    assert found is not None
    assert found.span("apart" if found["apart"] else "glued")[0] == begun


def test_what_is_put_in_knows_where_the_rest_was_typed() -> None:
    text = signs.changed(Typed.of(r"\mathcal{L} = x'^2", "/equations"), "letter_l", lambda _: "L")
    assert text.text == "L = x'^2"
    assert [column for _, column in text.places[:3]] == [1, 12, 13]


@pytest.mark.parametrize("text", ["", " ", "\\", "{{{", "¶", "\\boxed", "\u0308\u0308"])
def test_no_text_is_too_wrong_to_have_signs(text: str) -> None:
    for rule in ROWS:
        assert [*signs.find(rule, text)] == []
    assert signs.framed(Typed.of(text, ""), "\\boxed") is None


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a = b", ["a ", " b"]),
        (r"\sum_{i=1}^{2} x_i = 0", [r"\sum_{i=1}^{2} x_i ", " 0"]),
        ("V(x = 1) = k = 2", ["V(x = 1) ", " k ", " 2"]),
        (") = 1", [") ", " 1"]),
        ("=", ["", ""]),
        ("", [""]),
    ],
)
def test_sides_are_what_stands_between_the_equals_signs_outside_brackets(
    text: str, parts: list[str]
) -> None:
    typed = Typed.of(text, "/equations")
    assert [side.text for side in signs.sides(typed)] == parts
    left, right = signs.halves(typed)
    assert (left.text, right.text) == (parts[0], "=".join(parts[1:]))
    assert all(text[side.places[0][1] - 1 :].startswith(side.text) for side in signs.sides(typed))


@pytest.mark.parametrize(
    ("text", "after", "first", "begun"),
    [
        (r"{\dot x} = v", 0, "x}", "{"),
        (r"a = 1; {\dot x} = v", 6, "x}", "{"),
        ("a = 1; Eq(x', v)", 6, "x'", " Eq"),
        ("x' = (v)", 0, "x'", "x'"),
        ("} = {", 0, "=", "="),
    ],
)
def test_an_equation_begins_where_the_brackets_open_that_it_closes(
    text: str, after: int, first: str, begun: str
) -> None:
    place = signs.beginning(Typed.of(text, ""), after, text.index(first), len(text))
    assert text[place:].startswith(begun)
