"""Pieces of parameter space: their union is the zero set, and none leaves the domain."""

from __future__ import annotations

import itertools

import pytest
from flint import fmpq_mpoly

from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.special_cases.splitting import split
from inverse_service.inverse_problem.special_cases.strata import ParameterSpace

SPACE = ParameterSpace(("a", "b", "c"))
A, B, C = SPACE.context.gens()
SYSTEMS: list[list[fmpq_mpoly]] = [
    [(A - C) ** 3 * (A * A - C * C) * B],
    [A * C - B],
    [A * B, A * C],
    [A * C - B, A * B - B],
    [A * A + B * B],
    [A * A + B * B - 1],
    [A * A - 2 * B * B, A * C - B],
    [A * B - 1, C * C - A],
    [A * 0],
    [A * 0 + 3],
    [A * A + A * C, A * B * C - C * C],
]


@pytest.mark.parametrize("equations", SYSTEMS)
def test_the_pieces_hold_exactly_the_common_zeros(equations: list[fmpq_mpoly]) -> None:
    pieces = split(SPACE, equations)
    for values in itertools.product(range(-2, 3), repeat=3):
        zero = all(equation(*values) == 0 for equation in equations)
        inside = any(all(e(*values) == 0 for e in piece.equations) for piece in pieces)
        assert zero == inside, values


@pytest.mark.parametrize("equations", SYSTEMS)
def test_the_equations_vanish_on_each_piece(equations: list[fmpq_mpoly]) -> None:
    for piece in split(SPACE, equations):
        assert not piece.unsolved
        assert all(piece.vanishes(equation) for equation in equations)
        assert not any(piece.vanishes(factor) for factor in piece.excluded)


def test_no_equation_is_everything_and_a_number_is_nothing() -> None:
    assert [piece.dimension for piece in split(SPACE, [])] == [3]
    assert split(SPACE, [A * 0 + 1]) == []


def test_a_piece_outside_the_domain_is_dropped() -> None:
    assert [to_text(SPACE.tree(p.equations[0])) for p in split(SPACE, [A * B], domain=[A])] == ["b"]


def test_a_cubic_without_a_rational_parametrization_says_that_it_is_unsolved() -> None:
    equation = A**3 - B**3 + C**3 + 5
    (piece,) = split(SPACE, [equation])
    assert piece.unsolved
    assert piece.dimension == 2


def test_contained_pieces_are_recognized() -> None:
    (plane,), (line,) = split(SPACE, [A - C]), split(SPACE, [A - C, B])
    assert plane.contains(line)
    assert not line.contains(plane)
    assert plane.contains(plane)
