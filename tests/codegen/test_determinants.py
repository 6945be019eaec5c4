"""The quantity of a watch may be the determinant of a matrix of formulas."""

import numpy as np
import pytest

from inverse_service.kernels.codegen import program as programs
from inverse_service.kernels.codegen.compiled import card_of, kernel_text, load, object_code
from inverse_service.kernels.codegen.symengine_trees import number, symbol
from tests.codegen.run_program import call, memory_for


@pytest.mark.parametrize(("size", "sign"), [(2, 1), (3, 1), (4, 1), (4, -1), (4, 0)])
def test_a_run_ends_where_a_determinant_is_not_positive(size: int, sign: int) -> None:
    """At the third step, when s has come to it; at once where a column has no pivot."""
    drawn = np.random.default_rng(size).uniform(-1, 1, (size, size)).round(3)
    drawn[0] *= np.sign(np.linalg.det(drawn))
    minor = np.linalg.det(drawn[1:, 1:])
    whole = np.linalg.det(drawn)  # linear in the first entry: 0 where that has fallen by this
    way = whole / minor / 2.5
    rows = [[number(float(one)) for one in row] for row in drawn]
    rows[0][0] = rows[0][0] - symbol("s")
    rows = [[*row[:-1], sign * row[-1]] for row in rows]
    watch = programs.Watch("positive", tuple(map(tuple, rows)), "det", "stop")
    program = programs.Program(("s",), ("h",), (), (number(way),), (watch,))
    card = card_of(program)
    memory = memory_for(card, [{"s": 0.0}])
    call(load(object_code(kernel_text(program))), card, memory, 9)
    at = memory[card.layout.names.index(programs.STOPPED_AT), 0]
    place = memory[card.layout.names.index("s"), 0]
    assert memory[card.layout.names.index(programs.STATUS), 0] == programs.WATCHED
    assert round(place / way) == (3 if sign == 1 else 0), at


def test_an_unknown_that_is_zero_is_left_out_of_the_others() -> None:
    """x + y = c, y = 0: x = c."""
    c, zero, one = symbol("c"), number(0), number(1)
    found = [*programs.linear_blocks([[one, one], [zero, one]], [c, zero], ["x", "y"], False)]
    assigned = {part.name: part.formula for part in found if isinstance(part, programs.Assign)}
    assert assigned == {"x": c, "y": zero}


@pytest.mark.parametrize("tested", [True, False])
def test_what_nothing_drives_is_not_solved_for(tested: bool) -> None:
    """The first unknown of diag(a, b) x = (0, c) with a row of numbers, x_2 = x_0 - x_1; where the
    determinant is tested, all are solved for.
    """
    a, b, c = map(symbol, "abc")
    zero, one = number(0), number(1)
    rows = [[a, zero, zero], [zero, b, zero], [-one, one, one]]
    found = [*programs.linear_blocks(rows, [zero, c, zero], ["x", "y", "z"], tested)]
    solved = [name for part in found if isinstance(part, programs.Solve) for name in part.unknowns]
    assert solved == (["x", "y"] if tested else ["y"])
    (last,) = [one for one in found if isinstance(one, programs.Assign) and one.name == "z"]
    assert last.formula.expand() == (symbol("x") - symbol("y") if tested else -symbol("y"))
