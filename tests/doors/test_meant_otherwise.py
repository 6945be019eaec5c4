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
