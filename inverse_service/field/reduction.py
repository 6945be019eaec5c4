"""Branches of even roots: which residues must be "positive" for a point to stand for the real domain.

Every irreducible factor of a radicand gets the sign it has at the real point. A factor that itself
contains roots may be a square in disguise (5 + 2 sqrt(6)); it shows by having a constant residue
symbol. Then sqrt(A + B r), r^2 = c, is sqrt((A + e)/2) +- sqrt((A - e)/2) with e^2 = A^2 - B^2 c
where e exists (Landau, SIAM J. Comput. 21 (1992), section 2), and the sign of that sum is fixed too.

All atoms of expressions reduced to independent generators on the branch of one real point.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial

from flint import fmpq_mpoly

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Symbol,
    Velocity,
    distinct_nodes,
    multiply,
    number,
    square_root,
)
from inverse_service.field.elementary import is_even_root, is_root
from inverse_service.field.generators import (
    Generators,
    Quotient,
    factors,
    positive_factors,
    reduce_roots,
    split_square,
    to_quotient,
    used_generators,
)
from inverse_service.field.modular import is_positive
from inverse_service.field.point import Variable, evaluate
from inverse_service.field.real_point import RealTable, real_sign, turns
from inverse_service.field.relations import build_tower
from inverse_service.field.tower import Tower, draw_point

_SAMPLES = 24
_DEEPEST = 6


def fix_branches(tower: Tower, table: RealTable | None) -> None:
    """Add to the tower the signs of all factors of its radicands; IrreducibleAtoms if that fails."""
    radicands, tower.radicands = tower.radicands, []
    if radicands and table is None:
        raise IrreducibleAtoms("f contains roots and no real point was found at which all of them are defined")
    ring = Generators(tower)
    for radicand in radicands:
        assert table is not None
        _fix(ring, radicand, table, _DEEPEST)
        tower.radicands.append(radicand)


def _fix(ring: Generators, radicand: Expression, table: RealTable, depth: int) -> None:
    if depth == 0:
        raise IrreducibleAtoms("roots are nested too deeply to be reduced")
    if real_sign(radicand, table) < 0:
        raise IrreducibleAtoms("an even root of a negative quantity is not real")
    for factor, _ in positive_factors(ring, to_quotient(ring, radicand)):
        _fix_factor(ring, factor, table, depth)


def _fix_factor(ring: Generators, factor: Expression, table: RealTable, depth: int) -> None:
    known = ring.tower.signs
    # Variables have their sign already, and a root is positive by construction.
    if isinstance(factor, Number | Symbol | Velocity) or is_root(factor) or any(p == factor for p, _ in known):
        return
    sign = real_sign(factor, table)
    polynomial = to_quotient(ring, factor).numerator
    if ring.has_roots(polynomial) and _has_constant_symbol(ring.tower, factor):
        positive = factor if sign > 0 else -factor
        root = _denested(ring, positive, table, depth)
        known.append((root, real_sign(root, table)))
    known.append((factor, sign))


def _has_constant_symbol(tower: Tower, factor: Expression) -> bool:
    """Whether the residue symbol is the same at random points that agree with the tower."""
    found = set()
    for k in range(_SAMPLES):
        point = draw_point(tower, 5000 + k)
        found.add(is_positive(evaluate(factor, point), point.prime))
        if len(found) > 1:
            return False
    return True


def _denested(ring: Generators, factor: Expression, table: RealTable, depth: int) -> Expression:
    """A tree whose square is the factor, in roots of simpler quantities."""
    polynomial = to_quotient(ring, factor).numerator
    for k in reversed(used_generators(polynomial)):
        square = ring.squares.get(ring.trees[k])
        if square is None or square == ring.trees[k]:
            continue
        root = _split_root(ring, polynomial, k, square)
        if root is None:
            continue
        for radicand in root[:2]:
            if real_sign(radicand, table) < 0:
                break
            _fix(ring, radicand, table, depth - 1)
            ring.tower.radicands.append(radicand)
        else:
            first, second = square_root(root[0]), square_root(root[1])
            sign = real_sign(root[2], table)
            return first + second if sign > 0 else first - second
    raise IrreducibleAtoms("a nested root depends on other roots in a way that was not found; denest it by hand")


def _split_root(
    ring: Generators, polynomial: fmpq_mpoly, k: int, square: Expression
) -> tuple[Expression, Expression, Expression] | None:
    """((A + e)/2, (A - e)/2, B) for A + B r with e^2 = A^2 - B^2 r^2 a square up to a rational factor."""
    generator = ring.context.gen(k)
    slope = polynomial.derivative(k)
    if k in used_generators(slope):
        return None
    rest = polynomial - slope * generator
    radicand: Quotient = to_quotient(ring, square)
    discriminant = rest * rest * radicand.denominator - slope * slope * radicand.numerator
    root = _square_root(ring, reduce_roots(ring, discriminant))
    if root is None or split_square(ring, polynomial, k)[1]:
        return None
    middle, half = ring.tree_of(rest), number(Fraction(1, 2))
    e = root / square_root(ring.tree_of(radicand.denominator))
    return half * (middle + e), half * (middle - e), ring.tree_of(slope)


def _square_root(ring: Generators, polynomial: fmpq_mpoly) -> Expression | None:
    """sqrt(content) prod p^(k/2) where all multiplicities are even and the content is positive."""
    content, found = factors(polynomial)
    if content <= 0 or any(k % 2 for _, k in found):
        return None
    parts = [multiply(*[ring.tree_of(factor)] * (k // 2)) for factor, k in found]
    return multiply(square_root(number(content)), *parts)


def reduce_atoms(expressions: Sequence[Expression], variables: Sequence[Variable], table: RealTable | None) -> Tower:
    """The tower of expressions in kernels; raises IrreducibleAtoms where it cannot be settled.

    Relations may depend on branches: exp(sqrt((x - y)^2)) is exp(x - y) where x > y. So where a
    function has a root in its argument they are searched for again when the branches are known.
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
