"""Which lists in a list are joined: those of equations."""

from __future__ import annotations

import pytest

from inverse_service.reading import notations, tokens as tk


@pytest.mark.parametrize(
    ("text", "joined"),
    [
        ("((u = v), (w = z))", "(u=v,w=z)"),
        ("((u = v, w = 1), (z = 2))", "(u=v,w=1,z=2)"),
        ("((a, b), (c, d))", "((a,b),(c,d))"),  # a matrix
        ("((u = v), (c, d))", "((u=v),(c,d))"),
        ("((u = v), w = z)", "((u=v),w=z)"),
        ("((u = v))", "((u=v))"),
    ],
)
def test_lists_of_equations_are_one_list(text: str, joined: str) -> None:
    (whole,) = tk.nested(tk.tokenize(text))
    assert tk.spelled([notations._flattened(whole)]) == joined
