"""Free velocities by those of functions of the coordinates."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from inverse_service.constrained import lagrangian
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.reading import names as nm, reader

MOTION: Any = SimpleNamespace(free=("x", "y"), coordinates=("x", "y", "z"))


@pytest.mark.parametrize(
    "rates",
    [
        ("x'", "y'"),
        ("2*x' - z*y'", "x' + y'"),
        ("x' + 3", "y' - x'*z"),  # a part without velocities, as of a belt
        ("x'*cos(z) + y'*sin(z) - y", "y'*cos(z) - x'*sin(z) + x"),
    ],
)
def test_what_is_solved_gives_the_velocities_of_the_functions(rates: tuple[str, str]) -> None:
    names = nm.Names(MOTION.coordinates, (), {})
    trees = [reader.read_formula(rate, names) for rate in rates]
    found = lagrangian._free_velocities(MOTION, trees, ["u", "w"], exact_field.Budget.short())
    assert found is not None
    free = {ex.Velocity("x"), ex.Velocity("y")}
    assert not any(free & {*ex.walk(tree)} for tree in found.values())
    rest = [
        ex.substitute(tree, found) - ex.Velocity(name)
        for tree, name in zip(trees, ("u", "w"), strict=True)
    ]
    variables = [*map(ex.Symbol, MOTION.coordinates), ex.Velocity("u"), ex.Velocity("w")]
    assert real_branch.vanish(rest, variables)


def test_dependent_rates_determine_nothing() -> None:
    names = nm.Names(MOTION.coordinates, (), {})
    trees = [reader.read_formula(rate, names) for rate in ("x' - y'", "2*y' - 2*x' + 1")]
    budget = exact_field.Budget.short()
    assert lagrangian._free_velocities(MOTION, trees, ["u", "w"], budget) is None
