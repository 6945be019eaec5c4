"""All atoms of expressions reduced to independent generators on the branch of one real point."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from inverse_service.algebra.branches import fix_branches
from inverse_service.algebra.kernels import is_even_root
from inverse_service.algebra.point import Variable
from inverse_service.algebra.real_point import RealTable, real_sign, turns
from inverse_service.algebra.relations import build_tower
from inverse_service.algebra.tower import Tower
from inverse_service.expressions.tree import Apply, Expression, distinct_nodes


def reduce_atoms(expressions: Sequence[Expression], variables: Sequence[Variable], table: RealTable | None) -> Tower:
    """The tower of expressions in kernels; raises IrreducibleAtoms where it cannot be settled.

    Relations may depend on branches: exp(sqrt((x - y)^2)) is exp(x - y) where x > y. So where a
    function has a root in its argument they are sought again when the branches are known.
    """
    signs = {} if table is None else {name: real_sign(name, table) for name in variables}
    tower = build_tower(expressions, variables, signs, partial(turns, table))
    fix_branches(tower, table)
    if tower.signs and _have_root_inside(expressions):
        tower = build_tower(expressions, variables, signs, partial(turns, table), known=tower)
        fix_branches(tower, table)
    return tower


def _have_root_inside(expressions: Sequence[Expression]) -> bool:
    """Whether a transcendental function has an even root in its argument."""
    arguments = (node.argument for node in distinct_nodes(expressions) if isinstance(node, Apply))
    return any(is_even_root(node) for node in distinct_nodes(arguments))
