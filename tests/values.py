"""Shared test functions for values."""

from __future__ import annotations

from typing import Any, TypeVar

import pytest

T = TypeVar("T")


def present(value: T | None) -> T:
    """The value, which must not be None."""
    assert value is not None
    return value


def slow(*values: Any) -> Any:
    """The values of one case of a parametrized test, which is not in the default suite."""
    return pytest.param(*values, marks=pytest.mark.slow)
