"""Newton, linear solves and iterations in kernels, with their failures."""

from __future__ import annotations

import numpy as np
import pytest
import symengine

from inverse_service.codegen.compiled import card_of, kernel_text, load, object_code
from inverse_service.codegen.planning import plan
from inverse_service.codegen.program import (
    NO_CONVERGENCE,
    NOT_FINITE,
    SINGULAR,
    WATCHED,
    Iterate,
    Program,
    Statement,
    Watch,
)
from inverse_service.codegen.symengine_trees import Formula, symbol
from tests.codegen.run_program import call, memory_for

x, y, z, s, a = (symbol(name) for name in ("x", "y", "z", "s", "a"))


def outcome(
    statements: tuple[Statement, ...], update: Formula, values: list[dict[str, float]], steps: int = 1,
    watches: tuple[Watch, ...] = (),
) -> tuple[np.ndarray, np.ndarray, int]:  # fmt: skip
    """(state s, status, steps done) with s += update."""
    program = Program(("s",), ("h", "a"), statements, (update,), watches)
    card = card_of(program, len(values))
    memory = memory_for(card, values)
    done = call(load(object_code(kernel_text(program, len(values)))).call, card, memory, steps)
    return memory[card.layout.place("s")], memory[card.layout.place("status")], done


@pytest.mark.parametrize("lanes", [1, 4])
def test_newton_finds_the_root(lanes: int) -> None:
    statements = plan([x * symengine.exp(x) - a], ["x"], {})
    values = [{"a": 0.3 + k, "x_rate": 1.0} for k in range(lanes)]
    found, status, _ = outcome(statements, x, values)
    assert not status.any()
    for value, given in zip(found, values, strict=True):
        assert value * np.exp(value) == pytest.approx(given["a"], rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("size", [2, 3, 4, 7])
def test_linear_systems_of_any_size(size: int) -> None:
    """Coefficients that need pivoting, first row and diagonal with zeros."""
    generator = np.random.default_rng(size)
    matrix = generator.normal(size=(size, size))
    matrix[0, 0] = 0.0
    expected = generator.normal(size=size)
    names = [f"u{k}" for k in range(size)]
    right = matrix @ expected
    rows = [
        sum((symbol(n) * a * symengine.RealDouble(c) for n, c in zip(names, row, strict=True)), symengine.Integer(0))
        - symengine.RealDouble(value)
        for row, value in zip(matrix, right, strict=True)
    ]
    for place in range(size):
        found, status, _ = outcome(plan(rows, names, {}), symbol(names[place]), [{"a": 1.0}])
        assert not status.any()
        assert found[0] == pytest.approx(expected[place], rel=1e-10)


def test_lanes_end_by_themselves() -> None:
    """x^2 = a has no real root for a < 0: that lane says so, the others go on."""
    statements = plan([x * x - a], ["x"], {})
    values = [{"a": a, "x_rate": rate} for a, rate in ((4.0, 1.0), (-1.0, 1.0), (9.0, 2.0), (1.0, 3.0))]
    found, status, done = outcome(statements, x, values, steps=3)
    assert done == 3
    assert found[[0, 2, 3]] == pytest.approx([6.0, 9.0, 3.0], rel=1e-15)
    assert status[1] in (NO_CONVERGENCE, SINGULAR)
    assert found[1] == 0.0


def test_a_determinant_that_changes_sign_stops() -> None:
    """a (s - 1) x = 1 step by step: s passes 1."""
    statements = plan([(s - 1) * x * a - 1], ["x"], {})
    _, status, done = outcome(statements, symengine.RealDouble(0.4), [{"a": 1.0}], steps=10)
    assert status[0] == SINGULAR
    assert done == 3


def test_values_that_are_not_finite_stop() -> None:
    _, status, done = outcome((), symengine.exp(s * 400), [{"s": 1.0}], steps=10)
    assert status[0] == NOT_FINITE
    assert done <= 2


def test_watches_stop_before_the_step() -> None:
    watch = Watch("sign", s - 2, "s - 2", "")
    found, status, done = outcome((), symengine.Integer(1), [{"s": 0.5}], steps=10, watches=(watch,))
    assert (status[0], done, found[0]) == (WATCHED, 2, 2.5)
    watch = Watch("bound", s, "s", "", limit=3.0)
    found, status, done = outcome((), symengine.Integer(1), [{"s": 0.5}], steps=10, watches=(watch,))
    assert (status[0], done, found[0]) == (WATCHED, 3, 3.5)


def test_iteration_contracts_or_says_so() -> None:
    good = Iterate(("x",), (symengine.cos(x) * a,), ("",))
    found, status, _ = outcome((good,), x, [{"a": 1.0}])
    assert not status.any()
    assert found[0] == pytest.approx(0.7390851332151607, rel=1e-15)
    bad = Iterate(("x",), (2 * x + a,), ("",))
    _, status, _ = outcome((bad,), x, [{"a": 3.0}])
    assert status[0] >= NO_CONVERGENCE
