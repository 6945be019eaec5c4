"""What is printed does not depend on the hash seed of the process."""

from __future__ import annotations

from inverse_service.reading.names import Names
from inverse_service.service.documents import family_tables, sheets


def test_solved_functions_of_a_leaf_are_printed_in_the_order_in_which_they_were_solved() -> None:
    names = [f"{letter}(x)" for letter in "HBFDAGCE"]
    solved = [
        {"text": f"{name} = {k}", "new_constants": [], "new_functions": []}
        for k, name in enumerate(names)
    ]
    leaf = {"equations": [{"text": "B'(x) = 0"}], "solved": solved, "nonzero": []}
    shown = family_tables.where_of(leaf, Names(("x",), ()))
    assert [piece.text for piece in shown if isinstance(piece, sheets.Formula)][1:] == [
        one["text"] for one in solved
    ]
