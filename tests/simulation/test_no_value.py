"""A formula with a function that was given no value is bad input, not a fault of the program."""

from __future__ import annotations

import pytest

from inverse_service.errors import InputError
from inverse_service.expressions.tree import Arbitrary, Symbol
from inverse_service.simulation.array_values import array_value


def test_a_function_without_a_value_is_refused_as_input() -> None:
    with pytest.raises(InputError, match="A is not given"):
        array_value(Arbitrary("A", (Symbol("x"),), (0,)), {})
