"""What was read otherwise than it may be meant comes with a button for the other meaning."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.web.pages import forms


@pytest.mark.parametrize(
    ("typed", "words", "then"),
    [
        ("x'' = -x\ny'' = -k/m y", "k/m y is k/(m*y)", "x'' = -x\ny'' = -k/(m*y)"),
        ("x'' = -kx", "kx is one name", "x'' = -kx"),
        ("x'' = -sin x^2", "sin x^2 is sin(x)^2", "x'' = -sin(x)^2"),
        ("x'' = -sin^-1 x", "sin^-1 is 1/sin", "x'' = -1/sin x"),
        ("x'' = -k(x - l)", "k is a function", "x'' = -k(x - l)"),
        ("x'' = -k/m (x - l)", "k/m (x - l) is k/(m*(x - l))", "x'' = -k/(m*(x - l))"),
        ("x'' = -k/m x^3", "k/m x^3 is k/(m*x^3)", "x'' = -k/(m*x^3)"),
        ("x'' = e^-x t", "e^-x t is e^(-x*t)", "x'' = e^(-x*t)"),
        ("x'' = -gamma(x)", "gamma is gammafunction", "x'' = -gammafunction(x)"),
        (
            "L = x'^2 - k/4(x^2+1)^2",
            "k/4(x^2+1)^2 is k/(4*(x^2+1)^2)",
            "L = x'^2 - k/(4*(x^2+1)^2)",
        ),
    ],
)
def test_a_button_puts_the_other_meaning_in_its_place(typed: str, words: str, then: str) -> None:
    fields = forms.fields_from({"equations": typed})
    understood = forms.echo_task(fields)["understood"]
    ((_, meant, label, sends),) = understood.readings
    assert label == words
    assert " not " not in meant
    sent = {name: (value,) for name, value in fields.items()} | {"instead": (sends,)}
    chosen = forms.fields_of(forms.Form(sent))
    assert chosen["equations"] == then
    after = forms.echo_task(chosen)["understood"]
    assert label not in [one[2] for one in after.readings]


@pytest.mark.parametrize(
    ("typed", "question"),
    [
        ("relative", True),
        ("0.02", {"errors": "0.02"}),
        ("a = 0.02, x'': x*y = 0.1", {"errors": {"a": "0.02", "x'': x*y": "0.1"}}),
    ],
)
def test_the_form_asks_for_the_nearest_systems(typed: str, question: Any) -> None:
    fields = forms.fields_from({"equations": {"x": "-a*x"}, "nearest": question})
    assert fields["nearest"] == typed
    assert forms.document_of_fields(fields)["nearest"] == question


def test_a_button_is_offered_for_a_lagrangian_in_its_own_field() -> None:
    fields = forms.fields_from({"lagrangian": "x'^2/2 - k/4 x^2", "parameters": ["k"]})
    ((_, _, label, sends),) = forms.echo_task(fields)["understood"].readings
    assert label == "k/4 x^2 is k/(4*x^2)"
    sent = {name: (value,) for name, value in fields.items()} | {"instead": (sends,)}
    assert forms.fields_of(forms.Form(sent))["lagrangian"] == "x'^2/2 - k/(4*x^2)"


@pytest.mark.parametrize(
    ("typed", "line", "before"),
    [
        ("x' - 3*@", 1, "x' - 3*"),
        ("\n\nx' - 3*@", 3, "x' - 3*"),
        ("y' = x'\n\n  x' - 3*@\n", 3, "  x' - 3*"),
        ("\n y' = x';; x' - 3*@; x' = 0", 2, " y' = x';; x' - 3*"),
    ],
)
def test_what_is_wrong_in_a_constraint_is_marked_where_it_was_typed(
    typed: str, line: int, before: str
) -> None:
    fields = forms.fields_from({"lagrangian": "(x'^2 + y'^2)/2"}) | {"constraints": typed}
    (place,) = forms.echo_task(fields)["problem"]
    assert (place.line, place.before, place.marked) == (line, before, "@")
    assert place.column == len(before) + 1


@pytest.mark.parametrize(
    ("name", "typed"),
    [
        ("constraints", "\n\ny' = x'; z' - 3*sinn(x)*x'\n"),
        ("lagrangian", "\n\n L = x'^2/2 - sinn(x)"),
        ("equations", "\n\nx'' = y\n  y'' = 2*sinn(x)"),
    ],
)
def test_what_was_meant_is_put_where_it_was_typed(name: str, typed: str) -> None:
    beside = {} if name == "equations" else {"lagrangian": "(x'^2 + y'^2 + z'^2)/2"}
    fields = forms.fields_from(beside) | {name: typed}
    (place,) = forms.echo_task(fields)["problem"]
    assert place.line == typed[: typed.index("sinn")].count("\n") + 1
    ((_, sends),) = place.choices
    sent = {one: (value,) for one, value in fields.items()} | {"instead": (sends,)}
    chosen = forms.fields_of(forms.Form(sent))
    assert chosen[name] == typed.rstrip().replace("sinn", "sin")
    assert "understood" in forms.echo_task(chosen)
