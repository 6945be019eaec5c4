"""A function of velocities cut into blocks, and the inverse of the momentum map of a quadratic one.

The parts are free of velocities, linear, and independent blocks; a candidate for an inverse is checked by the caller.
Of a quadratic block L = v^T G v/2 it is v = G^-1 p, with H = p^T G^-1 p/2: G is inverted exactly by fraction-free
elimination (Bareiss 1968) over polynomials in opaque atoms.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement

from inverse_service import bounds, errors
from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics import implicit_equations, second_order_system
from inverse_service.mechanics.legendre import short_forms

Matrix = tuple[tuple[ex.Expression, ...], ...]


@dataclass(frozen=True, slots=True)
class Block:
    """A function of the velocities of `names`, expanded, without linear terms; `momenta` names each p."""

    function: ex.Expression
    names: tuple[str, ...]
    momenta: Mapping[str, ex.Symbol]


@dataclass(frozen=True, slots=True)
class Parts:
    """function = free + sum of linear[name] v_name + sum of the blocks' functions; `written` is a part of free."""

    free: ex.Expression
    written: ex.Expression
    linear: Mapping[str, ex.Expression]
    blocks: tuple[Block, ...]


def split(function: ex.Expression, names: Sequence[str], momenta: Mapping[str, ex.Symbol]) -> Parts:
    """The parts of a function of the velocities of `names`; each name is in exactly one block.

    Terms of a sum that hold no velocity are left as they are written.
    """
    terms = [part for term in ex.summands(function) for part in _apart(term, names)]
    plain = [term for term in terms if not short_forms.velocities_in(term, names)]
    moving = collecting.expand(ex.add(*(term for term in terms if short_forms.velocities_in(term, names))))
    free: list[collecting.Term] = []
    linear: dict[str, list[collecting.Term]] = {}
    coupled: list[tuple[set[str], collecting.Term]] = []
    for monomial, value in moving:
        found = short_forms.velocities_in(collecting.monomial_tree(monomial), names)
        only = next(iter(found)) if len(found) == 1 else ""
        if not found:
            free.append((monomial, value))
        elif (ex.Velocity(only), Fraction(1)) in monomial and degrees(monomial, [only]) is not None:
            linear.setdefault(only, []).append((without(monomial, [only]), value))
        else:
            coupled.append((found, (monomial, value)))
    groups = second_order_system.connected(names, [found for found, _ in coupled])
    functions = [collecting.terms_tree(term for found, term in coupled if found <= set(g)) for g in groups]
    blocks = tuple(Block(f, g, momenta) for f, g in zip(functions, groups, strict=True))
    slopes, written = {name: _short(found) for name, found in linear.items()}, ex.add(*plain)
    return Parts(ex.add(written, _short(free)), written, slopes, blocks)


def _apart(term: ex.Expression, names: Sequence[str]) -> list[ex.Expression]:
    """exp(c t) T and exp(c t) V of exp(c t) (T + V)."""
    sums = [factor for factor in ex.factors_of(term) if isinstance(factor, ex.Sum)]
    if len(sums) != 1 or not short_forms.velocities_in(term, names):
        return [term]
    outside = ex.multiply(*(factor for factor in ex.factors_of(term) if factor is not sums[0]))
    moving = [part for part in sums[0].terms if short_forms.velocities_in(part, names)]
    still = [part for part in sums[0].terms if part not in moving]
    return [outside * ex.add(*group) for group in (moving, still) if group]


def without(monomial: collecting.Monomial, names: Collection[str]) -> collecting.Monomial:
    """The monomial without its bare velocities of `names`."""
    return tuple((base, e) for base, e in monomial if not (isinstance(base, ex.Velocity) and base.coordinate in names))


def degrees(monomial: collecting.Monomial, names: Collection[str]) -> dict[str, Fraction] | None:
    """The exponents of the velocities, None where one occurs inside another atom."""
    if short_forms.velocities_in(collecting.monomial_tree(without(monomial, names)), names):
        return None
    bare = {base: exponent for base, exponent in monomial if isinstance(base, ex.Velocity)}
    return {base.coordinate: exponent for base, exponent in bare.items() if base.coordinate in names}


def _short(terms: list[collecting.Term]) -> ex.Expression:
    return short_forms.simplified(collecting.terms_tree(terms)) if terms else ex.ZERO


@dataclass(frozen=True, slots=True)
class Branch:
    """v(t, q, p) and H(t, q, p) of a block, where every tree of `conditions` (in t, q, v, p) is positive.

    A velocity may contain the velocity of another name of the block whose own formula contains none;
    `resolved` puts that formula in.
    """

    velocities: tuple[ex.Expression, ...]
    hamiltonian: ex.Expression
    conditions: tuple[ex.Expression, ...] = ()


Family = Callable[[Block], Iterator[Branch]]
Solver = Callable[[ex.Expression, Sequence[str], Mapping[str, ex.Symbol]], Iterator[Branch]]


def resolved(velocities: Sequence[ex.Expression], names: Sequence[str]) -> tuple[ex.Expression, ...]:
    """The velocities of a branch over (t, q, p) alone: no Velocity of `names` is left."""
    table: dict[ex.Expression, ex.Expression] = dict(zip(map(ex.Velocity, names), velocities, strict=True))
    return tuple(ex.substitute(tree, table) for tree in velocities)


@dataclass(frozen=True, slots=True)
class Inverse:
    """adjugate / determinant without a common factor, and the quotients entry by entry; all (n, n)."""

    adjugate: Matrix
    determinant: ex.Expression
    entries: Matrix


def quadratic_branches(block: Block) -> Iterator[Branch]:
    """The one inverse of a quadratic block; none where the block is not quadratic or G is singular."""
    matrix = form_matrix(collecting.expand(block.function), block.names)
    inverse = invert(matrix) if matrix else None
    if inverse:
        momenta = [block.momenta[name] for name in block.names]
        velocities = tuple(_shorter_row(inverse, row, momenta) for row in range(len(momenta)))
        yield Branch(velocities, multiply_out(ex.HALF, quadratic_form(inverse, momenta)))


def form_matrix(terms: Sequence[collecting.Term], names: Sequence[str]) -> Matrix | None:
    """The symmetric G with terms v^T G v / 2; None where there are others."""
    table: dict[tuple[str, str], list[collecting.Term]] = {}
    for monomial, value in terms:
        found = degrees(monomial, names)
        if found is None or sum(found.values()) != 2 or any(e not in (1, 2) for e in found.values()):
            return None
        pair = [name for name, exponent in found.items() for _ in range(int(exponent))]
        scale = 2 if pair[0] == pair[1] else 1
        for key in {(pair[0], pair[1]), (pair[1], pair[0])}:
            table.setdefault(key, []).append((without(monomial, names), value * scale))
    return tuple(tuple(collecting.terms_tree(table.get((i, j), ())) for j in names) for i in names)


def invert(matrix: Sequence[Sequence[ex.Expression]]) -> Inverse | None:
    """The exact inverse; None where the determinant is the zero polynomial or everything is too large."""
    plain = [[short_forms.separated(entry) for entry in row] for row in matrix]
    ring = implicit_equations.OpaqueRing([entry for row in plain for entry in row])
    try:
        fractions = [[ring.fraction(entry) for entry in row] for row in plain]
        scales = [implicit_equations.common_denominator(ring, row, bounds.TERMS) for row in fractions]
        pairs = zip(fractions, scales, strict=True)
        rows = [implicit_equations.cleared(row, scale, bounds.TERMS) for row, scale in pairs]
        solved = implicit_equations.solved_rows(ring, rows, scales, bounds.TERMS)
        return None if solved is None else _reduced(ring, *solved)
    except (errors.LimitError, ZeroDivisionError):
        return None


def _reduced(
    ring: implicit_equations.OpaqueRing,
    adjugate: implicit_equations.Rows,
    determinant: implicit_equations.Polynomial,
) -> Inverse:
    """adjugate / determinant, reduced as a whole and entry by entry."""
    common = determinant
    for row in adjugate:
        for entry in row:
            common = common.gcd(entry)
    short = [[divmod(entry, common)[0] for entry in row] for row in adjugate]
    bottom = divmod(determinant, common)[0]
    first = ex.factors_of(_tree(ring, bottom, ring.constant(1)))[0]
    if isinstance(first, ex.Number) and first.value < 0:
        short, bottom = [[-entry for entry in row] for row in short], -bottom
    return Inverse(
        tuple(tuple(_tree(ring, entry, ring.constant(1)) for entry in row) for row in short),
        _tree(ring, bottom, ring.constant(1)),
        tuple(tuple(_tree(ring, entry, bottom) for entry in row) for row in short),
    )


def _tree(
    ring: implicit_equations.OpaqueRing,
    numerator: implicit_equations.Polynomial,
    denominator: implicit_equations.Polynomial,
) -> ex.Expression:
    return short_forms.trigonometric(collecting.merge_powers(ring.tree(ring.reduced(numerator, denominator))))


def quadratic_form(inverse: Inverse, momenta: Sequence[ex.Symbol]) -> ex.Expression:
    """p^T G^-1 p: one quotient, or a sum of such where that is shorter."""
    pairs = list(combinations_with_replacement(enumerate(momenta), 2))
    forms = [
        ex.add(*(matrix[i][j] * (p**2 if i == j else 2 * p * q) for (i, p), (j, q) in pairs))
        for matrix in (inverse.adjugate, inverse.entries)
    ]
    return short_forms.shortest([forms[1], over(forms[0], inverse.determinant)])


def _shorter_row(inverse: Inverse, row: int, momenta: Sequence[ex.Symbol]) -> ex.Expression:
    """One row of G^-1 p."""
    sums = [
        ex.add(*(entry * p for entry, p in zip(matrix[row], momenta, strict=True) if entry != ex.ZERO))
        for matrix in (inverse.adjugate, inverse.entries)
    ]
    return short_forms.shortest([sums[1], over(sums[0], inverse.determinant)])


def over(numerator: ex.Expression, denominator: ex.Expression) -> ex.Expression:
    return numerator if denominator == ex.ONE else collecting.merge_powers(numerator / denominator)


def multiply_out(factor: ex.Expression, tree: ex.Expression) -> ex.Expression:
    """factor * tree, into each term of a sum."""
    if isinstance(tree, ex.Sum):
        return ex.add(*(factor * term for term in tree.terms))
    return factor * tree
