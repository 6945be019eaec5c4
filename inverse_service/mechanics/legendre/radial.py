"""Blocks L = F(S), S a quadratic form: relativistic, Finsler, radial quartic; and L = g(v_k) + v_k phi(w / v_k).

For F(S), S = u^T G u/2 with u = v + h a shifted velocity, p = F'(S) G u. Let R = p^T G^-1 p. For F = k sqrt(b + s S),
H_u^2 = b (k^2 - 2 R/s); else, with signs e, d and w = sqrt(2 e S), f(w) = F(e w^2/2) is a problem in one velocity with
momentum e d sqrt(e R), and u = d w G^-1 p/sqrt(e R). Last, H = H_u - p h.

For ratios, w the other velocities (the rational family of the paper), with u = w/v_k: p_w = phi'(u) and
p_k = g'(v_k) + phi - u phi'(u). If phi* and g* are the Legendre transforms, then u = phi*'(p_w),
v_k = g*'(p_k + phi*(p_w)) and H = g*(p_k + phi*(p_w)). For g = a v_k^2/2 and phi = u^T S u/2:
H = (p_k + p_w^T S^-1 p_w/2)^2 / (2 a).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Term, monomial_tree, terms_tree
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Expression,
    Number,
    Power,
    Sum,
    Symbol,
    Velocity,
    add,
    dot,
    number,
    square_root,
    substitute,
)
from inverse_service.mechanics.legendre.blocks import Block, Branch, Solver, degrees, without
from inverse_service.mechanics.legendre.linear import linear_coefficients
from inverse_service.mechanics.legendre.quadratic import (
    Inverse,
    Matrix,
    form_matrix,
    invert,
    quadratic_form,
)
from inverse_service.mechanics.legendre.short_forms import shortest, simplified, velocities_in
from inverse_service.mechanics.quadratic_forms import power_of_form

# A space is in no name that a user can declare.
_S, _W, _PI_W = Symbol("S of v"), Velocity("w of v"), Symbol("momentum of w")


@dataclass(frozen=True, slots=True)
class _Radial:
    """L = function(_S) with _S = u^T matrix u/2 and u_i = v_i + shift_i."""

    function: Expression
    matrix: Matrix
    inverse: Inverse
    shift: tuple[Expression, ...]


def radial_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches of a block that depends on one quadratic form of its velocities."""
    for form in _candidates(block):
        radial = _recognized(block, form)
        if radial is not None:
            root = _root_parts(radial.function)
            yield from _of_root(block, radial, *root) if root else _of_length(block, radial, solve)
            return


def _candidates(block: Block) -> Iterator[Expression]:
    """Trees quadratic in the velocities: what stands under powers, and the part of degree 2."""
    power = power_of_form(block.function)
    if power is not None:
        yield power[0]
    terms = expand(block.function)
    second = []
    seen: set[Expression] = set()
    for monomial, value in terms:
        found = degrees(monomial, block.names)
        if found is not None and sum(found.values()) == 2:
            second.append((monomial, value))
        for base, _ in monomial:
            if isinstance(base, Sum) and base not in seen and velocities_in(base, block.names):
                seen.add(base)
                yield base
    if second and len(second) < len(terms):
        yield terms_tree(second)


def _recognized(block: Block, form: Expression) -> _Radial | None:
    """The block as a function of the quadratic form's quadratic part about its center."""
    parts = _quadratic_parts(form, block.names)
    inverse = invert(parts[0]) if parts else None
    if parts is None or inverse is None:
        return None
    matrix, slopes = parts
    shift = tuple(simplified(dot(row, slopes)) for row in inverse.entries)
    centered = _centered(block, shift)
    along = _along_a_ray(centered, block.names, matrix)
    if along is None:
        return None
    whole = HALF * _form_of_velocities(matrix, block.names)
    if expand(substitute(along, {_S: whole})) != expand(centered):
        return None
    return _Radial(along, matrix, inverse, shift)


def _quadratic_parts(form: Expression, names: Sequence[str]) -> tuple[Matrix, list[Expression]] | None:
    """(G, b) of c + b v + v^T G v/2."""
    quadratic: list[Term] = []
    linear: list[Term] = []
    for monomial, value in expand(form):
        found = degrees(monomial, names)
        if found is None or sum(found.values()) not in (0, 1, 2):
            return None
        if sum(found.values()):
            (linear if sum(found.values()) == 1 else quadratic).append((monomial, value))
    matrix = form_matrix(quadratic, names) if quadratic else None
    slopes = linear_coefficients(linear, names)
    if matrix is None or slopes is None:
        return None
    return matrix, [slopes.get(name, ZERO) for name in names]


def _centered(block: Block, shift: Sequence[Expression]) -> Expression:
    """The function of u, written with the velocities of v."""
    pairs = zip(block.names, shift, strict=True)
    table: dict[Expression, Expression] = {Velocity(n): Velocity(n) - h for n, h in pairs}
    return substitute(block.function, table)


def _along_a_ray(function: Expression, names: Sequence[str], matrix: Matrix) -> Expression | None:
    """The function of S on the ray through e_i, or e_i + e_j, on which S is not zero; None where v is left."""
    for i, j in product(range(len(names)), repeat=2):
        entry = matrix[i][i] if i == j else 2 * matrix[i][j] if i < j else ZERO
        if entry == ZERO or (i != j and matrix[i][i] != ZERO):
            continue
        length = square_root(2 * _S / entry)
        table: dict[Expression, Expression] = {
            Velocity(name): length if place in (i, j) else ZERO for place, name in enumerate(names)
        }
        return simplified(substitute(function, table))
    return None


def _form_of_velocities(matrix: Matrix, names: Sequence[str]) -> Expression:
    pairs = product(enumerate(names), repeat=2)
    return add(*(matrix[i][j] * Velocity(a) * Velocity(b) for (i, a), (j, b) in pairs))


def _root_parts(function: Expression) -> tuple[Expression, Expression, Expression] | None:
    """(k, b, s) of k sqrt(b + s S), else None."""
    terms = expand(function)
    if len(terms) != 1:
        return None
    monomial, value = terms[0]
    roots = [base for base, exponent in monomial if exponent == HALF.value and _holds_s(base)]
    rest = tuple(pair for pair in monomial if pair[0] not in roots)
    if len(roots) != 1 or _holds_s(monomial_tree(rest)):
        return None
    slope = differentiate(roots[0], _S)
    start = substitute(roots[0], {_S: ZERO})
    if _holds_s(slope) or start == ZERO:
        return None
    return value * monomial_tree(rest), start, simplified(slope)


def _holds_s(tree: Expression) -> bool:
    return differentiate(tree, _S) != ZERO


def _of_root(block: Block, radial: _Radial, k: Expression, b: Expression, s: Expression) -> Iterator[Branch]:
    """F = k sqrt(b + s S): H_u^2 = b (k^2 - 2 R/s), sign(H_u) = -sign(k b), u = -2 b G^-1 p/(s H_u)."""
    momenta = [block.momenta[name] for name in block.names]
    form = quadratic_form(radial.inverse, momenta)
    square = simplified(b * (k**2 - 2 * form / s))
    lead = simplified(k * b)
    for sign in (1, -1):
        energy = sign * square_root(square)
        scale = simplified(-2 * b / s)
        rates = [scale * dot(row, momenta) * energy**-1 for row in radial.inverse.entries]
        condition = -sign * lead
        if not (isinstance(condition, Number) and condition.value < 0):
            yield _shifted(radial, rates, energy, momenta, (condition,))


def _shifted(
    radial: _Radial,
    rates: Sequence[Expression],
    energy: Expression,
    momenta: Sequence[Symbol],
    conditions: tuple[Expression, ...],
) -> Branch:
    velocities = tuple(simplified(u - h) for u, h in zip(rates, radial.shift, strict=True))
    drift = dot(momenta, radial.shift)
    plain = energy - drift
    return Branch(velocities, shortest([plain, simplified(plain)]), conditions)


def _of_length(block: Block, radial: _Radial, solve: Solver) -> Iterator[Branch]:
    """Any other F, through w = sqrt(2 e S), for both signs e of S and d of F'."""
    if len(block.names) == 1:
        return
    momenta = [block.momenta[name] for name in block.names]
    form = quadratic_form(radial.inverse, momenta)
    center = dict(zip(block.names, radial.shift, strict=True))
    whole = _form_of_velocities(radial.matrix, block.names)
    place: dict[Expression, Expression] = {Velocity(n): Velocity(n) + h for n, h in center.items()}
    for e, d in product((1, -1), repeat=2):
        length = square_root(simplified(e * form))
        squared = Fraction(e, 2) * Power(_W, number(2))
        for inner in solve(substitute(radial.function, {_S: squared}), [_W.coordinate], {_W.coordinate: _PI_W}):
            known: dict[Expression, Expression] = {_PI_W: e * d * length}
            w, energy = (substitute(tree, known) for tree in (inner.velocities[0], inner.hamiltonian))
            rates = [d * w * length**-1 * dot(row, momenta) for row in radial.inverse.entries]
            size = square_root(e * whole)
            slope = substitute(differentiate(radial.function, _S), {_S: HALF * whole})
            conditions = [*(substitute(c, {_W: size, **known}) for c in inner.conditions), d * slope]
            conditions.append(e * whole)
            placed = tuple(simplified(substitute(condition, place)) for condition in conditions)
            yield _shifted(radial, rates, energy, momenta, placed)


def ratio_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches for each velocity that can play the part of v_k."""
    for pivot in block.names if len(block.names) > 1 else ():
        parts = _parts(block, pivot)
        if parts is None:
            continue
        alone, homogeneous = parts
        others = [name for name in block.names if name != pivot]
        for inner in solve(homogeneous, others, block.momenta):
            for outer in solve(alone, [pivot], block.momenta):
                yield _joined(block, pivot, inner, outer)


def _parts(block: Block, pivot: str) -> tuple[Expression, Expression] | None:
    """(g, phi(u)), u_j being written as the velocity of w_j; None where the block is not of the form."""
    rate = Velocity(pivot)
    others = [name for name in block.names if name != pivot]
    table: dict[Expression, Expression] = {Velocity(name): rate * Velocity(name) for name in others}
    alone: list[Term] = []
    homogeneous: list[Term] = []
    for monomial, value in expand(substitute(block.function, table)):
        rest = without(monomial, [pivot])
        if not velocities_in(monomial_tree(monomial), others):
            alone.append((monomial, value))
        elif (rate, Fraction(1)) in monomial and not velocities_in(monomial_tree(rest), [pivot]):
            homogeneous.append((rest, value))
        else:
            return None
    if not alone or not homogeneous:
        return None
    return terms_tree(alone), terms_tree(homogeneous)


def _joined(block: Block, pivot: str, inner: Branch, outer: Branch) -> Branch:
    others = [name for name in block.names if name != pivot]
    momentum = block.momenta[pivot]
    shifted: dict[Expression, Expression] = {momentum: momentum + inner.hamiltonian}
    velocities = {name: rate * Velocity(pivot) for name, rate in zip(others, inner.velocities, strict=True)}
    velocities[pivot] = substitute(outer.velocities[0], shifted)
    ratios: dict[Expression, Expression] = {Velocity(n): Velocity(n) / Velocity(pivot) for n in others}
    conditions = [substitute(condition, ratios) for condition in inner.conditions]
    conditions += [substitute(condition, shifted) for condition in outer.conditions]
    rates = tuple(velocities[name] for name in block.names)
    return Branch(rates, substitute(outer.hamiltonian, shifted), tuple(conditions))
