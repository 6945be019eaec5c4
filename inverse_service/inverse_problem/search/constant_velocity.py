"""Systems w'' = 0, x'' = w' A(w) x' with A = W'(w) A_0, A_0 constant, or blocks of this kind.

    L = w'^2/2 + x'^T S(W(w)) x'/(2 w'),    dS/dW = -S A_0,    S A_0 symmetric
so S = e^(WT) S(0) with T(S) = -S A_0 on the symmetric S for which S A_0 is symmetric; any A_0 has a
regular one among them (Frobenius). The closed form of e^(WT) is that of linear systems, W for t.
Groups with an abelian ideal of codimension 1 are of this kind with W = w.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import HALF, ONE, TIME, ZERO, Expression, Symbol, Velocity, add, substitute, walk
from inverse_service.inverse_problem.search.linear_systems import linear_terms as matrices
from inverse_service.inverse_problem.search.linear_systems.linear_terms import EIGENVALUE, LinearSystem, Matrix
from inverse_service.inverse_problem.search.linear_systems.modes import Branch, Multipliers, all_branches, asymmetry
from inverse_service.inverse_problem.search.linear_systems.time_dependent import choose
from inverse_service.inverse_problem.search.material import Material, antiderivatives
from inverse_service.inverse_problem.search.motion_terms import MotionTerms
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    derivative,
    monomial,
    monomial_tree,
    multiply_terms,
    times,
    tree_of,
)
from inverse_service.mechanics.second_order_system import connected

Rows = dict[Velocity, dict[Velocity, Terms]]


@dataclass(frozen=True, slots=True)
class Block:
    """Velocities x' with x'' = w' W'(w) A_0 x': A_0 as terms, and W, a function of the carrier's coordinate."""

    velocities: tuple[Velocity, ...]
    matrix: tuple[tuple[Terms, ...], ...]
    rate: Expression


@dataclass(frozen=True, slots=True)
class Carried:
    """w' and the blocks."""

    carrier: Velocity
    blocks: tuple[Block, ...]


def carried(motion: MotionTerms) -> Carried | None:
    """The parts of f where some A is not zero, or None where f is of another kind."""
    for carrier, f in zip(motion.velocities, motion.forces, strict=True):
        if not f:
            found = _carried_by(carrier, motion)
            if found is not None:
                return found
    return None


def _carried_by(carrier: Velocity, motion: MotionTerms) -> Carried | None:
    rows = _rows(carrier, motion)
    if rows is None or not any(entry for row in rows.values() for entry in row.values()):
        return None
    w = Symbol(carrier.coordinate)
    links = ({v, *(other for other, entry in row.items() if entry)} for v, row in rows.items())
    blocks = [_block(rows, group, w) for group in connected(list(rows), links)]
    found = tuple(block for block in blocks if block is not None)
    return Carried(carrier, found) if len(found) == len(blocks) else None


def _rows(carrier: Velocity, motion: MotionTerms) -> Rows | None:
    """The entries of A(w); None where f holds other terms."""
    others = [v for v in motion.velocities if v != carrier]
    w = Symbol(carrier.coordinate)
    moving = {*motion.coordinates, *motion.velocities, TIME} - {w}
    rows: Rows = {v: {other: {} for other in others} for v in motion.velocities}
    for v, f in zip(motion.velocities, motion.forces, strict=True):
        for key, value in f.items():
            letters = dict(key)
            own = [other for other in others if letters.get(other) == 1]
            rest = key - monomial(carrier, *own)
            if letters.get(carrier) != 1 or len(own) != 1 or any(node in moving for p, _ in rest for node in walk(p)):
                return None
            rows[v][own[0]][rest] = value
    return {v: row for v, row in rows.items() if v != carrier}


def _block(rows: Rows, group: Sequence[Velocity], w: Symbol) -> Block | None:
    """None where the entries are no common function of w with an antiderivative that is a monomial."""
    parts: dict[Monomial, dict[tuple[Velocity, Velocity], Terms]] = {}
    for v in group:
        for other in group:
            for key, value in rows[v][other].items():
                function: Monomial = frozenset(item for item in key if w in set(walk(item[0])))
                parts.setdefault(function, {}).setdefault((v, other), {})[key - function] = value
    if not parts:
        return Block(tuple(group), tuple(tuple({} for _ in group) for _ in group), w)
    reference = next(iter(parts.values()))
    rates = [_rate(function, entries, reference, w) for function, entries in parts.items()]
    if any(rate is None for rate in rates):
        return None
    matrix = tuple(tuple(reference.get((v, other), {}) for other in group) for v in group)
    return Block(tuple(group), matrix, add(*(rate for rate in rates if rate is not None)))


def _rate(
    function: Monomial,
    entries: Mapping[tuple[Velocity, Velocity], Terms],
    reference: Mapping[tuple[Velocity, Velocity], Terms],
    w: Symbol,
) -> Expression | None:
    """factor * int function dw, where the entries are a factor times those of the reference."""
    place, first = next(iter(reference.items()))
    (key, value), *_ = first.items()
    factors: Iterable[Terms] = ({times(k, key, -1): a / value} for k, a in entries.get(place, {}).items())
    primitive = _primitive(function, w)
    for factor in factors if primitive is not None else ():
        if {at: multiply_terms(factor, terms) for at, terms in reference.items()} == dict(entries):
            return tree_of(factor) * primitive if primitive is not None else None
    return None


def _primitive(function: Monomial, w: Symbol) -> Expression | None:
    """A monomial whose derivative by w is a number times the function, divided by that number."""
    if function == EMPTY:
        return w
    for candidate in antiderivatives(function, w):
        try:
            slope = derivative(candidate, w)
        except TooManyTerms:
            continue
        if list(slope) == [function]:
            return monomial_tree(candidate) / slope[function]
    return None


def applies(material: Material) -> bool:
    """Whether f has this form with A constant, or some A that couples velocities; other rungs have the rest."""
    parts = carried(material.motion)
    if parts is None:
        return False
    constant = all(block.rate == Symbol(parts.carrier.coordinate) for block in parts.blocks)
    return constant or any(len(block.velocities) > 1 for block in parts.blocks)


def propose(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians, those with a definite S first; none where the exponents are no square roots."""
    parts, table = carried(material.motion), material.analysis.real_point
    if parts is None or table is None:
        return ()
    try:
        chosen = [_choices(block, parts.carrier, table) for block in parts.blocks]
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()
    if not all(chosen):
        return ()
    kinetic = HALF * parts.carrier**2
    sums = [[options[min(k, len(options) - 1)] for options in chosen] for k in range(max(map(len, chosen)))]
    return tuple(dict.fromkeys(add(kinetic, *terms) for terms in sums))


def _choices(block: Block, carrier: Velocity, table: RealTable) -> list[Expression]:
    """x'^T S x'/(2 w') for one block."""
    space = _multipliers(_linear_system(block))
    found = choose(space.system, all_branches(space, table), table)
    return [_kinetic(space.system, block, carrier, branch) for branch in found]


def _linear_system(block: Block) -> LinearSystem:
    """q'' = A_0 q' in W instead of t."""
    trees = [[tree_of(entry) for entry in row] for row in block.matrix]
    budget = Budget.long()
    ring = exact_ring([tree for row in trees for tree in row], (), 0, budget, further=(EIGENVALUE,))
    damping = tuple(tuple(ring.value(tree).scaled(-1) for tree in row) for row in trees)
    none = matrices.plus(damping, damping, -1)
    return LinearSystem(ring, damping, ((ONE, none),), (ZERO,) * len(damping))


def _multipliers(system: LinearSystem) -> Multipliers:
    """The symmetric S with S A symmetric, and T(S) = -S A on them."""
    n, owner = system.size, system.ring.field
    basis, free = matrices.kernel(list(asymmetry(system.damping)), n * (n + 1) // 2, owner)
    images = [matrices.entries(matrices.product(matrices.symmetric(one, n), system.damping)) for one in basis]
    columns = [tuple(image[k] for k in free) for image in images]
    return Multipliers(system, tuple(basis), matrices.transpose(tuple(columns)) if columns else ())


def _kinetic(system: LinearSystem, block: Block, carrier: Velocity, branch: Branch) -> Expression:
    return add(*(
        collect(substitute(phi, {TIME: block.rate})) * term
        for phi, matrix in branch.parts
        for term in _quadratic_form(system, matrix, block, carrier)
    ))  # fmt: skip


def _quadratic_form(system: LinearSystem, matrix: Matrix, block: Block, carrier: Velocity) -> Iterator[Expression]:
    """The terms of x'^T G x'/(2 w')."""
    for i, j in matrices.places(system.size):
        if not matrix[i][j].is_zero:
            weight = Fraction(1, 1 + (i == j)) * quotient_tree(system.ring, matrix[i][j])
            yield weight * block.velocities[i] * block.velocities[j] / carrier
