"""Cartan's test: characters of textbook systems, and the linear algebra that it needs."""

from __future__ import annotations

import math

import pytest

from inverse_service.decision.deciding import Decision, decide, statement
from inverse_service.field.matrices import kernel_of, matrix_of_rows
from inverse_service.field.modular import safe_prime
from inverse_service.linear_pde.involution import Symbol
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import narrowest
from tests.values import slow

P = safe_prime(7)
NAMES = tuple("abcdefgh")


def decided(equations: dict[str, str], time_dependent: bool = False) -> Decision:
    found = decide(read_system(list(equations), equations), narrowest(time_dependent))
    assert found.verdict == "variational"
    assert found.symbol is not None
    return found


def free_characters(n: int, with_time: bool) -> tuple[int, ...]:
    """alpha_k = n(n + 1)/2 - k(k - 1)/2 for k = 1 … n; one more character n(n + 1)/2 first with
    time.
    """
    values = [math.comb(n + 1, 2) - math.comb(k, 2) for k in range(1, n + 1)]
    return (math.comb(n + 1, 2), *values, *[0] * n) if with_time else (*values, *[0] * n)


SIZES = [*((n, False) for n in range(1, 8)), *((n, True) for n in range(1, 6))]
LARGE = [slow(8, False), slow(8, True)]


@pytest.mark.slow
@pytest.mark.parametrize(("n", "with_time"), SIZES + LARGE)
def test_free_motion_has_the_characters_of_the_closed_form(n: int, with_time: bool) -> None:
    found = decided(dict.fromkeys(NAMES[:n], "0"), with_time)
    characters = free_characters(n, with_time)
    first, second = sum(characters), sum(k * a for k, a in enumerate(characters, start=1))
    constant = math.comb(n + 1, 2)
    assert found.symbol == Symbol(first, second, characters)
    assert found.history[-1][:3] == (constant, constant + first, constant + first + second)


@pytest.mark.parametrize("force", ["0", "-x^3+x*x'", "sin(x)*x'^2", "-x'", "exp(x'*x)"])
def test_one_dimension_leaves_one_function_of_as_many_variables_as_there_are_invariants(
    force: str,
) -> None:
    found = decided({"x": force})
    assert found.history[-1] == (1, 2, 3)
    assert found.symbol == Symbol(1, 1, (1, 0))
    assert found.space is not None
    assert found.space.statement == "the multiplier depends on 1 function of 1 variable"
    assert decided({"x": force}, True).history[-1] == (1, 3, 6)


@pytest.mark.parametrize(
    ("equations", "characters"),
    [
        ({"x": "-x", "y": "-y"}, (3, 2, 0, 0)),  # Douglas, case I: as free motion
        ({"x": "-x", "y": "-2*y"}, (2, 0, 0, 0)),  # two of one dimension
        ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, (0, 0, 0, 0)),  # unique multiplier
    ],
)
def test_known_pairs_have_their_characters(
    equations: dict[str, str], characters: tuple[int, ...]
) -> None:
    found = decided(equations)
    assert found.symbol is not None
    assert found.symbol.characters == characters
    assert found.symbol.involutive


def test_uncoupled_systems_have_the_dimensions_of_their_parts_together() -> None:
    parts = [decided({"x": "-x^3"}), decided({"x": "-sin(x)"})]
    together = decided({"x": "-x^3", "y": "-sin(y)"}).history[-1]
    assert together[:3] == tuple(
        a + b for a, b in zip(*(part.history[-1] for part in parts), strict=True)
    )


def test_a_symbol_is_involutive_only_where_cartans_equality_holds() -> None:
    assert Symbol(5, 7, (3, 2, 0, 0)).involutive
    assert not Symbol(5, 6, (3, 2, 0, 0)).involutive
    assert Symbol(0, 0, (0, 0)).involutive


@pytest.mark.parametrize(
    ("dimension", "characters", "sentence"),
    [
        (1, (0, 0), "1 constant"),
        (3, (0, 0), "3 constants"),
        (3, (2, 0), "2 functions of 1 variable"),
        (3, (2, 1, 0), "1 function of 2 variables"),
    ],
)
def test_the_sentence_names_the_last_character(
    dimension: int, characters: tuple[int, ...], sentence: str
) -> None:
    assert statement(dimension, characters) == f"the multiplier depends on {sentence}"


@pytest.mark.parametrize("width", [1, 4])
def test_the_kernel_of_no_rows_is_everything_and_of_a_full_set_nothing(width: int) -> None:
    assert kernel_of(matrix_of_rows([], width, P)).nrows() == width
    assert kernel_of(matrix_of_rows([{k: 1} for k in range(width)], width, P)).nrows() == 0


def test_the_kernel_is_annihilated_and_of_the_right_dimension() -> None:
    rows = [{0: 1, 2: 5}, {1: P - 3, 4: 2}, {0: 2, 2: 10}]
    basis = kernel_of(matrix_of_rows(rows, 5, P))
    assert (basis.nrows(), basis.ncols()) == (3, 5)
    for row in rows:
        assert all(sum(int(basis[i, c]) * x for c, x in row.items()) % P == 0 for i in range(3))
    assert basis.rank() == 3
