"""p = dL/dv solved for the velocities: L cut into blocks, quadratic ones inverted, then each family
of others in turn.

The parts of L are free of velocities, linear, and independent blocks; a candidate for an inverse is
checked by the caller. Of a quadratic block L = v^T G v/2 it is v = G^-1 p, with H = p^T G^-1 p/2: G
is inverted exactly over a ring of opaque atoms.

One velocity: F(v) = dL/dv = p is solved from the outside to the inside where v occurs in F once;
else F may be a short polynomial in z, a power of v or exp(v). With z^d = y the equation is c_2 y^2
+ c_1 y + c_0 = 0, or a cubic; its depressed form y^3 + a y = b is solved by y = 2 sqrt(a/3)
sinh(asinh(3 sqrt(3/a) b/(2 a))/3) for a > 0 and, on the branch through y = 0, by y = 2 sqrt(-a/3)
sin(asin(3 sqrt(-3/a) b/(2 a))/3) for a < 0 (Viete; Holmes, Math. Gazette 86
(2002) 473).

Elimination: in a small block one velocity is isolated in one momentum and put into the others: for
L = Re(z log z) with z = x' + i y', p_y = -atan(y'/x') gives y', and then p_x = log|z| + 1 gives x'.

Linear forms: a block such as exp(x') + exp(x' + y') falls apart in other velocities y = M v. As p_v
= M^T p_y, a transform in y with p_y = M^-T p_v gives H and v = M^-1 y.

One quadratic form: L = F(S), relativistic, Finsler, radial quartic, with S = u^T G u/2 and u = v +
h a shifted velocity, has p = F'(S) G u. Let R = p^T G^-1 p. For F = k sqrt(b + s S), H_u^2 = b (k^2
- 2 R/s); else, with signs e, d and w = sqrt(2 e S), f(w) = F(e w^2/2) is a problem in one velocity
with momentum e d sqrt(e R), and u = d w G^-1 p/sqrt(e R). Last, H = H_u - p h.

Ratios: L = g(v_k) + v_k phi(u), w the other velocities (the rational family of the paper) and u =
w/v_k, has p_w = phi'(u) and p_k = g'(v_k) + phi - u phi'(u). If phi* and g* are the Legendre
transforms, then u = phi*'(p_w), v_k = g*'(p_k + phi*(p_w)) and H = g*(p_k + phi*(p_w)). For g = a
v_k^2/2 and phi = u^T S u/2: H = (p_k + p_w^T S^-1 p_w/2)^2 / (2 a).
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

from inverse_service import bounds
from inverse_service.expressions import (
    calculus,
    collecting,
    functions,
    polynomials,
    terms as tm,
    tree as ex,
)
from inverse_service.field import exact_field, matrices, real_branch
from inverse_service.mechanics import (
    euler_lagrange,
    second_order_system,
    square_forms,
    writing,
)

Matrix = tuple[tuple[ex.Expression, ...], ...]
_NAME = "the cubic's unknown"
_LARGEST_BLOCK = 3
Rule = Callable[[ex.Expression], ex.Expression]
Equation = tuple[ex.Symbol, ex.Expression]
Solved = tuple[dict[ex.Velocity, ex.Expression], tuple[ex.Expression, ...]]
Form = tuple[ex.Expression, ...]
# A space is in no name that a user can declare.
_S, _W, _PI_W = ex.Symbol("S of v"), ex.Velocity("w of v"), ex.Symbol("momentum of w")


@dataclass(frozen=True, slots=True)
class Block:
    """A function of the velocities of `names`, expanded, without linear terms; `momenta` names each
    p.
    """

    function: ex.Expression
    names: tuple[str, ...]
    momenta: Mapping[str, ex.Symbol]

    @property
    def velocities(self) -> tuple[ex.Velocity, ...]:
        return tuple(map(ex.Velocity, self.names))

    @property
    def symbols(self) -> tuple[ex.Symbol, ...]:
        """The momenta in the order of the names."""
        return tuple(self.momenta[name] for name in self.names)


@dataclass(frozen=True, slots=True)
class Parts:
    """function = free + sum of linear[name] v_name + sum of the blocks' functions; `written` is a
    part of free.
    """

    free: ex.Expression
    written: ex.Expression
    linear: Mapping[str, ex.Expression]
    blocks: tuple[Block, ...]


def parts_in_velocities(
    function: ex.Expression, names: Sequence[str], momenta: Mapping[str, ex.Symbol]
) -> Parts:
    """The parts of a function of the velocities of `names`; each name is in exactly one block.

    Terms of a sum that hold no velocity are left as they are written.
    """
    terms = [part for term in ex.summands(function) for part in _apart(term, names)]
    plain = [term for term in terms if not writing.velocities_in(term, names)]
    moving = collecting.expand(
        ex.add(*(term for term in terms if writing.velocities_in(term, names)))
    )
    free: list[collecting.Term] = []
    linear: dict[str, list[collecting.Term]] = {}
    coupled: list[tuple[set[str], collecting.Term]] = []
    for monomial, value in moving:
        found = writing.velocities_in(collecting.monomial_tree(monomial), names)
        only = next(iter(found)) if len(found) == 1 else ""
        if not found:
            free.append((monomial, value))
        elif degrees(monomial, [only]) == {only: Fraction(1)}:
            linear.setdefault(only, []).append((without_velocities(monomial, [only]), value))
        else:
            coupled.append((found, (monomial, value)))
    groups = second_order_system.connected(names, [found for found, _ in coupled])
    functions = [
        collecting.terms_tree(term for found, term in coupled if found <= set(g)) for g in groups
    ]
    blocks = tuple(Block(f, g, momenta) for f, g in zip(functions, groups, strict=True))
    slopes, written = {name: _short(found) for name, found in linear.items()}, ex.add(*plain)
    return Parts(ex.add(written, _short(free)), written, slopes, blocks)


def _apart(term: ex.Expression, names: Sequence[str]) -> list[ex.Expression]:
    """exp(c t) T and exp(c t) V of exp(c t) (T + V)."""
    sums = [factor for factor in ex.factors_of(term) if isinstance(factor, ex.Sum)]
    if len(sums) != 1 or not writing.velocities_in(term, names):
        return [term]
    outside = ex.multiply(*(factor for factor in ex.factors_of(term) if factor is not sums[0]))
    moving = [part for part in sums[0].terms if writing.velocities_in(part, names)]
    still = [part for part in sums[0].terms if part not in moving]
    return [outside * ex.add(*group) for group in (moving, still) if group]


def without_velocities(monomial: tm.Monomial, names: Collection[str]) -> tm.Monomial:
    """The monomial without its bare velocities of `names`."""
    return frozenset(
        (base, e)
        for base, e in monomial
        if not (isinstance(base, ex.Velocity) and base.coordinate in names)
    )


def degrees(monomial: tm.Monomial, names: Collection[str]) -> dict[str, Fraction] | None:
    """The exponents of the velocities, None where one occurs inside another atom."""
    if writing.velocities_in(collecting.monomial_tree(without_velocities(monomial, names)), names):
        return None
    bare = {base: exponent for base, exponent in monomial if isinstance(base, ex.Velocity)}
    return {
        base.coordinate: exponent for base, exponent in bare.items() if base.coordinate in names
    }


def _short(terms: list[collecting.Term]) -> ex.Expression:
    return writing.simplified(collecting.terms_tree(terms)) if terms else ex.ZERO


@dataclass(frozen=True, slots=True)
class InverseBranch:
    """v(t, q, p) and H(t, q, p) of a block, where every tree of `conditions` (in t, q, v, p) is
    positive.

    A velocity may contain the velocity of another name of the block whose own formula contains
    none; `resolved` puts that formula in.
    """

    velocities: tuple[ex.Expression, ...]
    hamiltonian: ex.Expression
    conditions: tuple[ex.Expression, ...] = ()

    def changed(self, change: functions.Rule) -> "InverseBranch":
        """The branch with every formula changed."""
        velocities, conditions = (
            tuple(map(change, trees)) for trees in (self.velocities, self.conditions)
        )
        return InverseBranch(velocities, change(self.hamiltonian), conditions)


Solver = Callable[[ex.Expression, Sequence[str], Mapping[str, ex.Symbol]], Iterator[InverseBranch]]


def resolved(
    velocities: Sequence[ex.Expression], names: Sequence[str]
) -> tuple[ex.Expression, ...]:
    """The velocities of a branch over (t, q, p) alone: no Velocity of `names` is left."""
    table = dict(zip(map(ex.Velocity, names), velocities, strict=True))
    return tuple(ex.substitute(tree, table) for tree in velocities)


@dataclass(frozen=True, slots=True)
class Inverse:
    """adjugate / determinant without a common factor, and the quotients entry by entry; all (n,
    n).
    """

    adjugate: Matrix
    determinant: ex.Expression
    entries: Matrix


def quadratic_branches(block: Block) -> Iterator[InverseBranch]:
    """The one inverse of a quadratic block; none where the block is not quadratic or G is
    singular.
    """
    matrix = form_matrix(collecting.expand(block.function), block.names)
    inverse = invert(matrix) if matrix else None
    if inverse:
        velocities = tuple(
            _row_times(inverse, row, block.symbols) for row in range(len(block.names))
        )
        yield InverseBranch(
            velocities, multiply_out(ex.HALF, quadratic_form(inverse, block.symbols))
        )


def form_matrix(terms: Sequence[collecting.Term], names: Sequence[str]) -> Matrix | None:
    """The symmetric G with terms v^T G v / 2; None where there are others."""
    table: dict[tuple[str, str], list[collecting.Term]] = {}
    for monomial, value in terms:
        found = degrees(monomial, names)
        if (
            found is None
            or sum(found.values()) != 2
            or any(e not in (1, 2) for e in found.values())
        ):
            return None
        pair = [name for name, exponent in found.items() for _ in range(int(exponent))]
        scale = 2 if pair[0] == pair[1] else 1
        for key in {(pair[0], pair[1]), (pair[1], pair[0])}:
            table.setdefault(key, []).append((without_velocities(monomial, names), value * scale))
    return tuple(tuple(collecting.terms_tree(table.get((i, j), ())) for j in names) for i in names)


def invert(matrix: Sequence[Sequence[ex.Expression]]) -> Inverse | None:
    """The exact inverse; None where the determinant is the zero polynomial or everything is too
    large.
    """
    plain = [[writing.separated(entry) for entry in row] for row in matrix]
    ring = exact_field.opaque_ring(
        [entry for row in plain for entry in row], exact_field.Budget(bounds.TERMS)
    )
    try:
        inverse = matrices.inverse([list(map(ring.value, row)) for row in plain], ring.constant(1))
        if inverse is None:
            return None
        entries = [entry for row in inverse for entry in row]
        *above, below = matrices.numerators(ring, [*entries, ring.constant(1)])
    except (exact_field.TooLarge, ZeroDivisionError):
        return None
    # As many numbers as possible are fractions: those are seen and taken out of brackets later.
    contents = [
        tm.content_of(map(polynomials.as_fraction, polynomial.coeffs())) for polynomial in above
    ]
    scale = tm.content_of(1 / content for content in contents if content)

    def tree(element: exact_field.Quotient) -> ex.Expression:
        return writing.trigonometric(
            collecting.merge_powers(exact_field.quotient_tree(ring, element))
        )

    def square(elements: Sequence[exact_field.Quotient]) -> Matrix:
        trees, size = list(map(tree, elements)), len(matrix)
        return tuple(tuple(trees[k : k + size]) for k in range(0, size * size, size))

    whole = [
        exact_field.Quotient(ring.field, polynomial, ()).scaled(scale)
        for polynomial in (*above, below)
    ]
    return Inverse(square(whole[:-1]), tree(whole[-1]), square(entries))


def quadratic_form(inverse: Inverse, momenta: Sequence[ex.Symbol]) -> ex.Expression:
    """p^T G^-1 p."""
    pairs = list(combinations_with_replacement(enumerate(momenta), 2))

    def form(matrix: Matrix) -> ex.Expression:
        return ex.add(*(matrix[i][j] * (p**2 if i == j else 2 * p * q) for (i, p), (j, q) in pairs))

    return _shorter(inverse, form)


def _row_times(inverse: Inverse, row: int, momenta: Sequence[ex.Symbol]) -> ex.Expression:
    """One row of G^-1 p."""
    return _shorter(inverse, lambda matrix: ex.dot(matrix[row], momenta))


def _shorter(inverse: Inverse, linear: Callable[[Matrix], ex.Expression]) -> ex.Expression:
    """What is linear in G^-1: a sum of quotients, or one quotient where that is shorter."""
    return writing.shortest(
        [linear(inverse.entries), over(linear(inverse.adjugate), inverse.determinant)]
    )


def over(numerator: ex.Expression, denominator: ex.Expression) -> ex.Expression:
    return numerator if denominator == ex.ONE else collecting.merge_powers(numerator / denominator)


def multiply_out(factor: ex.Expression, tree: ex.Expression) -> ex.Expression:
    """factor * tree, into each term of a sum."""
    if isinstance(tree, ex.Sum):
        return ex.add(*(factor * term for term in tree.terms))
    return factor * tree


@dataclass(frozen=True, slots=True)
class Root:
    """A solution v, right where every tree of `conditions` (in q, v, p) is positive."""

    value: ex.Expression
    conditions: tuple[ex.Expression, ...] = ()


def occurrences(tree: ex.Expression, leaf: ex.Velocity) -> int:
    return sum(1 for node in ex.walk(tree) if node == leaf)


def isolate(tree: ex.Expression, leaf: ex.Velocity, known: Root) -> Iterator[Root]:
    """All solutions of tree = known.value for the leaf; none where it does not occur exactly
    once.
    """
    if tree == leaf:
        yield known
    elif occurrences(tree, leaf) == 1:
        for inner, root in peeled(tree, leaf, known.value):
            yield from isolate(inner, leaf, Root(root.value, known.conditions + root.conditions))


def peeled(
    tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression
) -> Iterator[tuple[ex.Expression, Root]]:
    """The part that holds the leaf, with each value of it for which the tree is the target."""
    match tree:
        case ex.Sum(terms):
            holder = next(term for term in terms if occurrences(term, leaf))
            rest = ex.add(*(term for term in terms if term is not holder))
            yield holder, Root(target - rest)
        case ex.Product(factors):
            holder = next(factor for factor in factors if occurrences(factor, leaf))
            rest = ex.multiply(*(factor for factor in factors if factor is not holder))
            yield holder, Root(target / rest)
        case ex.Power(base, exponent) if occurrences(base, leaf):
            yield from ((base, root) for root in roots_of_power(base, exponent, target))
        case ex.Power(base, exponent):
            yield exponent, Root(ex.Apply("log", target) / ex.Apply("log", base))
        case ex.Apply(function, argument):
            yield from ((argument, root) for root in _roots_of_function(function, argument, target))


def roots_of_power(
    base: ex.Expression, exponent: ex.Expression, target: ex.Expression
) -> Iterator[Root]:
    """base with base^exponent = target; for odd exponents a form that is right for both signs."""
    if not isinstance(exponent, ex.Number) or exponent.value.denominator != 1:
        yield Root(target**exponent**-1)
        return
    whole = int(exponent.value)
    if whole in (1, -1):
        yield Root(target**whole)
    elif whole % 2:
        yield Root(target * (target**2) ** Fraction(1 - whole, 2 * whole))
    else:
        root = target ** Fraction(1, whole)
        yield Root(root, (base,))
        yield Root(-root, (-base,))


def _roots_of_function(
    function: str, argument: ex.Expression, target: ex.Expression
) -> Iterator[Root]:
    """argument with function(argument) = target, on the branches next to zero."""
    row = functions.FUNCTION.get(function)
    if row is None or not row.solved:
        return
    root, quarter_turn = ex.Apply(row.solved, target), ex.HALF * ex.PI
    if row.parity == 1:
        yield Root(root, (argument,))
        yield Root(-root, (-argument,))
    else:  # tan and sin are undone by atan and asin only for |argument| < pi/2
        yield Root(
            root,
            (quarter_turn - argument, quarter_turn + argument) if row.family == "circular" else (),
        )


@dataclass(frozen=True, slots=True)
class Laurent:
    """sum of coefficients[e] generator^e; the generator is the velocity, exp of a multiple of it,
    or such as log v with the velocity in it once.
    """

    generator: ex.Expression
    coefficients: Mapping[Fraction, ex.Expression]


def polynomial_roots(
    tree: ex.Expression, leaf: ex.Velocity, target: ex.Expression
) -> Iterator[Root]:
    """The solutions of tree = target for the leaf, where the tree is such a polynomial."""
    laurent = laurent_polynomial(tree, leaf)
    if laurent is None:
        return
    table = dict(laurent.coefficients)
    table[Fraction(0)] = table.get(Fraction(0), ex.ZERO) - target
    table = {exponent: value for exponent, value in table.items() if value != ex.ZERO}
    lowest = min(table)
    step = tm.content_of(exponent - lowest for exponent in table)
    if not step or max(table) - lowest > 3 * step:
        return
    unknown = laurent.generator**step
    c = [
        table.get(lowest + k * step, ex.ZERO) for k in range(int((max(table) - lowest) / step) + 1)
    ]
    if len(c) == 2:
        yield from isolate(unknown, leaf, Root(-c[0] / c[1]))
    elif len(c) in (3, 4):
        for root in _quadratic(c, unknown) if len(c) == 3 else _cubic(c, unknown):
            yield from isolate(unknown, leaf, root)


def laurent_polynomial(tree: ex.Expression, leaf: ex.Velocity) -> Laurent | None:
    """The tree in powers of one generator; None where the leaf occurs in another way."""
    generators: set[ex.Expression] = set()
    table: dict[Fraction, list[collecting.Term]] = {}
    for monomial, value in collecting.expand(tree):
        moving = [
            (base, e) for base, e in monomial if writing.velocities_in(base, [leaf.coordinate])
        ]
        rest = monomial - {*moving}
        if len(moving) > 1 or (moving and not _is_generator(moving[0][0], leaf)):
            return None
        generators.update(base for base, _ in moving)
        table.setdefault(moving[0][1] if moving else Fraction(0), []).append((rest, value))
    if len(generators) != 1:
        return None
    coefficients = {e: collecting.terms_tree(terms) for e, terms in table.items()}
    return Laurent(generators.pop(), coefficients)


def _is_generator(base: ex.Expression, leaf: ex.Velocity) -> bool:
    match base:
        case ex.Apply("exp", argument):
            terms = collecting.expand(argument)
            is_monomial = len(terms) == 1 and collecting.monomial_tree(terms[0][0]) == argument
            return is_monomial and degrees(terms[0][0], [leaf.coordinate]) == {
                leaf.coordinate: Fraction(1)
            }
        case ex.Apply("log" | "atan" | "asinh" | "atanh"):
            return occurrences(base, leaf) == 1
        case _:
            return base == leaf


def _quadratic(coefficients: Sequence[ex.Expression], y: ex.Expression) -> Iterator[Root]:
    """Both roots of a y^2 + b y + c; `y` as a tree in v says which one it is."""
    c, b, a = coefficients
    discriminant = writing.simplified(b**2 - 4 * a * c)
    slope = 2 * a * y + b
    for sign in (1, -1):
        over = -b + sign * ex.square_root(discriminant)
        yield Root(over / (2 * a), (sign * slope,))


def _cubic(c: list[ex.Expression], y: ex.Expression) -> Iterator[Root]:
    """The roots of c_3 y^3 + c_2 y^2 + c_1 y + c_0: with y = z - h those of z^3 + 3 k z = b."""
    h, slope, start = (writing.simplified(c[j] / (d * c[3])) for j, d in ((2, 3), (1, 1), (0, 1)))
    k = writing.simplified(Fraction(1, 3) * slope - h**2)
    b = writing.simplified(h * (slope - 2 * h**2) - start)
    z, unknown = y + h, ex.Velocity(_NAME)
    if k == ex.ZERO:
        for root in roots_of_power(unknown, ex.number(3), b):
            yield Root(root.value - h)
        return
    yield Root(_tripled(k, b, "asinh", "sinh") - h, (k,))
    size = writing.simplified(-k)
    outside = z**2 - size
    yield Root(_tripled(size, -b, "asin", "sin") - h, (size, -outside))
    ratio = b / (2 * size ** Fraction(3, 2))
    for inverse, function, side in (("acosh", "cosh", 1), ("acos", "cos", -1)):
        for sign in map(ex.number, (1, -1)):
            value = sign * _tripled(size, sign * b, inverse, function)
            alone = side * (sign * ratio - 1)
            yield Root(value - h, (size, outside, sign * z, alone))


def _tripled(k: ex.Expression, b: ex.Expression, inverse: str, function: str) -> ex.Expression:
    """2 sqrt(k) sinh(asinh(b/(2 k^(3/2)))/3), for other functions likewise: z^3 + 3 k z = b by the
    triple angle.
    """
    angle = ex.Apply(inverse, writing.simplified(b / (2 * k ** Fraction(3, 2))))
    third = ex.Apply(function, Fraction(1, 3) * angle)
    return 2 * ex.square_root(writing.simplified(k)) * third


def scalar_branches(block: Block, _: Solver) -> Iterator[InverseBranch]:
    """All branches found of a block of one velocity."""
    if len(block.names) != 1:
        return
    (rate,), (momentum,), function = block.velocities, block.symbols, block.function
    slope = calculus.differentiate(function, rate)
    energies = [writing.simplified(rate * slope - function), momentum * rate - function]
    by_momentum = list(_energies_by_momentum(block, rate, slope))
    for root in roots_for(slope, rate, momentum):
        velocity = writing.simplified(root.value)
        trees, others = (
            [ex.substitute(tree, {rate: velocity}) for tree in some]
            for some in (energies, by_momentum)
        )
        trees += [
            *others,
            *(factored_inside(tree) for tree in others[:1] if ex.node_count(tree) <= bounds.LARGE),
        ]
        forms = [writing.simplified(tree) for tree in trees if ex.node_count(tree) <= bounds.LARGE]
        forms += [writing.with_cosines(factored_inside(form)) for form in forms]
        yield InverseBranch((velocity,), writing.shortest(forms or trees), root.conditions)


def _energies_by_momentum(
    block: Block, rate: ex.Velocity, slope: ex.Expression
) -> Iterator[ex.Expression]:
    """p v - L with one term T of L written by p: T = (p - (L - T)') T/T', or with a logarithm of a
    quotient.
    """
    function, (momentum,) = block.function, block.symbols
    logs = _log_of_quotient(collecting.collect(slope), rate, momentum)
    if logs is not None:
        over, under, value = logs
        yield writing.simplified(momentum * rate - ex.substitute(function, {over: under + value}))
    terms = ex.summands(function)
    for place, term in enumerate(terms[: bounds.FEW]):
        others = ex.add(*terms[:place], *terms[place + 1 :])
        ratio = writing.opaque_quotient(term / calculus.differentiate(term, rate))
        rest = (momentum - calculus.differentiate(others, rate)) * ratio
        yield momentum * rate - (others + rest)


def roots_for(slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression) -> Iterator[Root]:
    """The solutions of slope = momentum for the velocity that are found in closed form."""
    collected = collecting.collect(slope)
    once = [
        form
        for form in (collected, slope, writing.opaque_quotient(collected))
        if occurrences(form, rate) == 1
    ]
    if once:
        yield from isolate(writing.shortest(once), rate, Root(momentum))
        return
    yield from polynomial_roots(collected, rate, momentum)
    yield from _of_two_logarithms(collected, rate, momentum)
    yield from _of_one_arctangent(collected, rate, momentum)
    yield from _with_a_root(writing.simplified(slope), rate, Root(momentum))


def _of_two_logarithms(
    slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression
) -> Iterator[Root]:
    """F = c (log A - log B) + r = p for A, B linear in v: A/B = exp((p - r)/c)."""
    found = _log_of_quotient(slope, rate, momentum)
    if found is not None:
        ratio = ex.Apply("exp", found[2])
        (a, b), (e, f) = (_linear_parts(node.argument, rate) for node in found[:2])
        yield Root((ratio * f - b) / (a - ratio * e))


class LogOfQuotient(NamedTuple):
    """log A, log B, and (p - r)/c."""

    over: ex.Apply
    under: ex.Apply
    momentum: ex.Expression


def _log_of_quotient(
    slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression
) -> LogOfQuotient | None:
    """log A, log B and (p - r)/c for p = c (log A - log B) + r with c and r free of v."""
    parts: dict[ex.Apply | None, list[ex.Expression]] = {}
    for term in slope.terms if isinstance(slope, ex.Sum) else ():
        logs = [
            node for node in ex.walk(term) if isinstance(node, ex.Apply) and node.function == "log"
        ]
        held = [node for node in logs if occurrences(node, rate) == occurrences(term, rate) > 0]
        parts.setdefault(held[0] if held else None, []).append(term)
    rest = ex.add(*parts.pop(None, ()))
    if len(parts) != 2:
        return None
    (over, c), (under, d) = (
        (node, writing.simplified(ex.add(*terms) / node)) for node, terms in parts.items() if node
    )
    if writing.simplified(c + d) != ex.ZERO:
        return None
    if real_branch.vanishes_at(rest, real_branch.sample_points([rest])):
        return LogOfQuotient(over, under, momentum / c)
    return LogOfQuotient(
        over, under, (momentum - writing.simplified(ex.substitute(rest, {rate: ex.ZERO}))) / c
    )


def _of_one_arctangent(
    slope: ex.Expression, rate: ex.Velocity, momentum: ex.Expression
) -> Iterator[Root]:
    """F = c atan A + r = p, where r is constant as one quotient of polynomials: A has roots of
    symbols.
    """
    terms = slope.terms if isinstance(slope, ex.Sum) else ()
    arcs = {
        node
        for node in ex.walk(slope)
        if isinstance(node, ex.Apply) and node.function == "atan" and occurrences(node, rate)
    }
    held = [term for term in terms if any(node in set(ex.walk(term)) for node in arcs)]
    if len(arcs) != 1 or len(held) == len(terms):
        return
    rest = writing.exact_quotient(ex.add(*(term for term in terms if term not in held)))
    if not occurrences(rest, rate):
        (arc,) = arcs
        factor, (a, b) = writing.simplified(ex.add(*held) / arc), _linear_parts(arc.argument, rate)
        if not occurrences(factor, rate) and not occurrences(a, rate):
            angle = (momentum - rest) / factor
            yield Root((ex.Apply("tan", angle) - b) / a)


def _linear_parts(tree: ex.Expression, rate: ex.Velocity) -> tuple[ex.Expression, ex.Expression]:
    return writing.simplified(calculus.differentiate(tree, rate)), writing.simplified(
        ex.substitute(tree, {rate: ex.ZERO})
    )


def _with_a_root(tree: ex.Expression, rate: ex.Velocity, known: Root) -> Iterator[Root]:
    """F(u) = p for u that holds v in one square root besides: A + B sqrt(S) = 0 for the numerator
    of u - p'.
    """
    if sum(1 for part in ex.children(tree) if occurrences(part, rate)) == 1:
        for inner, root in peeled(tree, rate, known.value):
            yield from _with_a_root(
                inner, rate, Root(root.value, known.conditions + root.conditions)
            )
        return
    squared = _without_root(ex.multiply(*_numerator(tree - known.value, rate)), rate)
    for factor in _numerator(squared, rate):
        for root in polynomial_roots(factor, rate, ex.ZERO):
            yield Root(root.value, known.conditions + root.conditions)


def _numerator(tree: ex.Expression, rate: ex.Velocity) -> list[ex.Expression]:
    """The bases of its factors that hold the velocity and something else, those under the line left
    out.
    """
    whole = writing.opaque_quotient(tree)
    bases = [base for base, e in ex.powers_of(whole) if e > 0]
    leaves = [
        {node for node in ex.walk(base) if isinstance(node, ex.Symbol | ex.Velocity)}
        for base in bases
    ]
    return [
        base for base, held in zip(bases, leaves, strict=True) if rate in held and held != {rate}
    ]


def _without_root(tree: ex.Expression, rate: ex.Velocity) -> ex.Expression:
    """A^2 - B^2 S for A + B sqrt(S), A, B and S polynomials in v; 0 where the tree is not of this
    kind.
    """
    plain: list[ex.Expression] = []
    rooted: dict[ex.Expression, list[ex.Expression]] = {}
    for term in collecting.expand(tree):
        factor = collecting.terms_tree([term])
        powers = (
            node
            for node in ex.walk(factor)
            if isinstance(node, ex.Power) and node.exponent == ex.HALF
        )
        roots = [node for node in powers if occurrences(node, rate)]
        (rooted.setdefault(roots[0], []) if roots else plain).append(
            factor / roots[0] if roots else factor
        )
    if len(rooted) != 1:
        return ex.ZERO
    ((root, terms),) = rooted.items()
    return ex.add(*plain) ** 2 - ex.add(*terms) ** 2 * root**2


def elimination_branches(block: Block) -> Iterator[InverseBranch]:
    """The branches of a block of two or three velocities; H is the energy p v - L at v(p)."""
    if not 1 < len(block.names) <= _LARGEST_BLOCK:
        return
    functions = [
        writing.simplified(calculus.differentiate(block.function, v)) for v in block.velocities
    ]
    energy = writing.simplified(ex.dot(block.velocities, functions) - block.function)
    for rates, conditions in _solutions(
        list(zip(block.symbols, functions, strict=True)), block.velocities
    ):
        velocities = tuple(writing.simplified(rates[v]) for v in block.velocities)
        yield InverseBranch(
            velocities, writing.simplified(ex.substitute(energy, rates)), conditions
        )


def _solutions(equations: Sequence[Equation], unknowns: Sequence[ex.Velocity]) -> Iterator[Solved]:
    """Every way to solve the equations one after the other, each by one of the unknowns."""
    if len(unknowns) == 1:
        ((momentum, function),), (v,) = equations, unknowns
        for root in roots_for(factored_inside(function), v, momentum):
            yield {v: root.value}, root.conditions
        return
    for v, root, reduced in _isolated(equations, unknowns):
        for rates, others in _solutions(reduced, [other for other in unknowns if other != v]):
            yield {**rates, v: ex.substitute(root.value, rates)}, root.conditions + others


def _isolated(
    equations: Sequence[Equation], unknowns: Sequence[ex.Velocity]
) -> Iterator[tuple[ex.Velocity, Root, list[Equation]]]:
    """One velocity isolated in one equation, and the other equations after substituting it; each
    holds another one.
    """
    for (momentum, function), v in product(equations, unknowns):
        left = [other for other in unknowns if other != v]
        for root in isolate(function, v, Root(momentum)):
            others = [(p, ex.substitute(f, {v: root.value})) for p, f in equations if p != momentum]
            reduced = [(p, writing.simplified(f)) for p, f in others]
            if all(ex.holds(f, *left) for _, f in reduced):
                yield v, root, reduced


@lru_cache(maxsize=512)
def factored_inside(tree: ex.Expression) -> ex.Expression:
    """The tree with every sum in it as one factored quotient, the outer ones first."""
    outer = writing.opaque_quotient(tree) if isinstance(tree, ex.Sum) else tree
    return ex.rebuild(outer, factored_inside)


def linear_branches(block: Block, solve: Solver) -> Iterator[InverseBranch]:
    """The branches after a change to the linear forms under functions and powers, completed by
    velocities.
    """
    found = _forms(block) if len(block.names) > 1 else ()
    units = tuple(tuple(ex.number(int(a == b)) for b in block.names) for a in block.names)
    if not found or set(found) <= set(units):
        return
    for chosen in combinations(units, len(block.names) - len(found)):
        inverse = invert((*found, *chosen))
        if inverse is not None:
            yield from _after_change(block, (*found, *chosen), inverse, solve)


def _after_change(
    block: Block, forms: Sequence[Form], inverse: Inverse, solve: Solver
) -> Iterator[InverseBranch]:
    """The branches with the forms in the place of velocities."""
    velocities, symbols = block.velocities, block.symbols
    old = {v: ex.dot(row, velocities) for v, row in zip(velocities, inverse.entries, strict=True)}
    new = {v: ex.dot(row, velocities) for v, row in zip(velocities, forms, strict=True)}
    columns = zip(*inverse.entries, strict=True)
    momenta = {
        p: writing.simplified(ex.dot(column, symbols))
        for p, column in zip(symbols, columns, strict=True)
    }
    for branch in solve(ex.substitute(block.function, old), block.names, block.momenta):
        found = branch.changed(lambda tree: ex.substitute(tree, {**new, **momenta}))
        yield replace(
            found,
            velocities=tuple(
                writing.simplified(ex.dot(row, found.velocities)) for row in inverse.entries
            ),
        )


def _forms(block: Block) -> tuple[Form, ...]:
    """The linear forms on which functions and powers depend, else that of one square; none where
    there are others.
    """
    found: dict[Form, None] = {}
    for monomial, _ in collecting.expand(block.function):
        forms = _forms_of(monomial, block.names)
        if forms is None:
            return ()
        found.update(dict.fromkeys(forms))
    if not found:  # that of a square, (z' - y x')^2/2, is its slope by z'
        slopes = (calculus.differentiate(block.function, v) for v in block.velocities)
        linear = (linear_coefficients(slope, block.names) for slope in slopes)
        found.update(
            (form, None)
            for one in linear
            if one and len(one) > 1 and (form := _monic(one, block.names))
        )
        return tuple(found)[:1]
    return tuple(found) if len(found) <= len(block.names) else ()


def _forms_of(monomial: tm.Monomial, names: Sequence[str]) -> list[Form] | None:
    """The linear forms in the atoms of a term, bare velocities not counted; None where one is not
    linear.
    """
    exponent: dict[str, ex.Expression] = {}
    forms: list[Form | None] = []
    for base, power in collecting.powers_in_order(monomial):
        if isinstance(base, ex.Velocity) or not writing.velocities_in(base, names):
            continue
        part = linear_coefficients(base.argument if isinstance(base, ex.Apply) else base, names)
        if ex.is_exponential(base) and part:
            for name, value in part.items():
                exponent[name] = exponent.get(name, ex.ZERO) + power * value
        else:
            forms.append(_monic(part, names))
    if exponent:
        forms.append(_monic(exponent, names))
    return None if None in forms else [form for form in forms if form]


def _monic(coefficients: Mapping[str, ex.Expression] | None, names: Sequence[str]) -> Form | None:
    if not coefficients:
        return None
    first = next(coefficients[name] for name in names if name in coefficients)
    return tuple(writing.simplified(coefficients.get(name, ex.ZERO) / first) for name in names)


def linear_coefficients(
    tree: ex.Expression, names: Sequence[str]
) -> Mapping[str, ex.Expression] | None:
    """The coefficients of the velocities in a tree that is linear in them (free terms allowed),
    else None.
    """
    parts = euler_lagrange.linear_parts(collecting.collect(tree), ex.Velocity)
    if not isinstance(parts, tuple):
        return None
    return {leaf.coordinate: slope for leaf, slope in parts[0].items() if leaf.coordinate in names}


@dataclass(frozen=True, slots=True)
class _Radial:
    """L = function(_S) with _S = u^T matrix u/2 and u_i = v_i + shift_i."""

    function: ex.Expression
    matrix: Matrix
    inverse: Inverse
    shift: tuple[ex.Expression, ...]


def radial_branches(block: Block, solve: Solver) -> Iterator[InverseBranch]:
    """The branches of a block that depends on one quadratic form of its velocities."""
    for form in _candidates(block):
        radial = _recognized(block, form)
        if radial is not None:
            root = _root_parts(radial.function)
            found = _of_root(block, radial, *root) if root else _of_length(block, radial, solve)
            yield from (_shifted(block, radial.shift, branch) for branch in found)
            return


def _candidates(block: Block) -> Iterator[ex.Expression]:
    """Trees quadratic in the velocities: the bases of powers, and the part of degree 2."""
    power = square_forms.power_of_form(block.function)
    if power is not None:
        yield power[0]
    terms = collecting.expand(block.function)
    second = []
    seen: set[ex.Expression] = set()
    for monomial, value in terms:
        found = degrees(monomial, block.names)
        if found is not None and sum(found.values()) == 2:
            second.append((monomial, value))
        for base, _ in collecting.powers_in_order(monomial):
            if (
                isinstance(base, ex.Sum)
                and base not in seen
                and writing.velocities_in(base, block.names)
            ):
                seen.add(base)
                yield base
    if second and len(second) < len(terms):
        yield collecting.terms_tree(second)


def _recognized(block: Block, form: ex.Expression) -> _Radial | None:
    """The block as a function of the quadratic form's quadratic part about its center."""
    parts = _quadratic_parts(form, block.names)
    inverse = invert(parts[0]) if parts else None
    if parts is None or inverse is None:
        return None
    matrix, slopes = parts
    shift = tuple(writing.simplified(ex.dot(row, slopes)) for row in inverse.entries)
    # The function of u, written with the velocities of v.
    centered = ex.substitute(
        block.function, {v: v - h for v, h in zip(block.velocities, shift, strict=True)}
    )
    along = _along_a_ray(centered, block.names, matrix)
    if along is None:
        return None
    whole = ex.HALF * _form_of_velocities(matrix, block.names)
    if collecting.expand(ex.substitute(along, {_S: whole})) != collecting.expand(centered):
        return None
    return _Radial(along, matrix, inverse, shift)


def _quadratic_parts(
    form: ex.Expression, names: Sequence[str]
) -> tuple[Matrix, list[ex.Expression]] | None:
    """(G, b) of c + b v + v^T G v/2."""
    quadratic: list[collecting.Term] = []
    linear: list[collecting.Term] = []
    for monomial, value in collecting.expand(form):
        found = degrees(monomial, names)
        if found is None or sum(found.values()) not in (0, 1, 2):
            return None
        if sum(found.values()):
            (linear if sum(found.values()) == 1 else quadratic).append((monomial, value))
    matrix = form_matrix(quadratic, names) if quadratic else None
    slopes = linear_coefficients(collecting.terms_tree(linear), names)
    if matrix is None or slopes is None:
        return None
    # Without a number in all entries, 2 S of x'^2 + y'^2 is the square of the speed.
    terms = (term for row in matrix for entry in row for term in ex.summands(entry))
    share = ex.number(1 / tm.content_of(map(ex.coefficient, terms)))
    return (
        tuple(tuple(share * entry for entry in row) for row in matrix),
        [share * slopes.get(name, ex.ZERO) for name in names],
    )


def _along_a_ray(
    function: ex.Expression, names: Sequence[str], matrix: Matrix
) -> ex.Expression | None:
    """The function of S on the ray through e_i, or e_i + e_j, on which S is not zero; None where v
    is left.
    """
    for i, j in product(range(len(names)), repeat=2):
        entry = matrix[i][i] if i == j else 2 * matrix[i][j] if i < j else ex.ZERO
        if entry == ex.ZERO or (i != j and matrix[i][i] != ex.ZERO):
            continue
        length = ex.square_root(2 * _S / entry)
        ray = {
            ex.Velocity(name): length if place in (i, j) else ex.ZERO
            for place, name in enumerate(names)
        }
        return writing.simplified(ex.substitute(function, ray))
    return None


def _form_of_velocities(matrix: Matrix, names: Sequence[str]) -> ex.Expression:
    pairs = product(enumerate(names), repeat=2)
    return ex.add(*(matrix[i][j] * ex.Velocity(a) * ex.Velocity(b) for (i, a), (j, b) in pairs))


class RootOfSum(NamedTuple):
    """k sqrt(b + s S)."""

    factor: ex.Expression
    start: ex.Expression
    slope: ex.Expression


def _root_parts(
    function: ex.Expression,
) -> RootOfSum | None:
    """(k, b, s) of k sqrt(b + s S), else None."""
    terms = collecting.expand(function)
    roots = {
        pair
        for monomial, _ in terms
        for pair in monomial
        if pair[1] == ex.HALF.value and _holds_s(pair[0])
    }
    if len(roots) != 1 or not all(roots <= monomial for monomial, _ in terms):
        return None
    ((root, _),) = roots
    factor = collecting.terms_tree([(monomial - roots, c) for monomial, c in terms])
    slope, start = calculus.differentiate(root, _S), ex.substitute(root, {_S: ex.ZERO})
    if _holds_s(factor) or _holds_s(slope) or start == ex.ZERO:
        return None
    return RootOfSum(factor, start, writing.simplified(slope))


def _holds_s(tree: ex.Expression) -> bool:
    return calculus.differentiate(tree, _S) != ex.ZERO


def _of_root(
    block: Block, radial: _Radial, k: ex.Expression, b: ex.Expression, s: ex.Expression
) -> Iterator[InverseBranch]:
    """F = k sqrt(b + s S): H_u^2 = b (k^2 - 2 R/s), sign(H_u) = -sign(k b), u = -2 b G^-1 p/(s
    H_u).
    """
    momenta = block.symbols
    form = quadratic_form(radial.inverse, momenta)
    apart = b * k**2 + collecting.collect(-2 * b * form / s)
    square = writing.shortest([writing.simplified(apart), apart])
    lead = writing.simplified(k * b)
    for sign in (1, -1):
        energy = sign * ex.square_root(square)
        scale = writing.simplified(-2 * b / s)
        rates = [scale * ex.dot(row, momenta) * energy**-1 for row in radial.inverse.entries]
        condition = -sign * lead
        if not (isinstance(condition, ex.Number) and condition.value < 0):
            yield InverseBranch(tuple(rates), energy, (condition,))


def _shifted(block: Block, shift: Sequence[ex.Expression], branch: InverseBranch) -> InverseBranch:
    """A branch in u = v + h as one in v: H = H_u - p h."""
    plain = branch.hamiltonian - ex.dot(block.symbols, shift)
    place = {v: v + h for v, h in zip(block.velocities, shift, strict=True)}
    return InverseBranch(
        tuple(writing.simplified(u - h) for u, h in zip(branch.velocities, shift, strict=True)),
        writing.shortest([plain, writing.simplified(plain)]),
        tuple(
            writing.simplified(ex.substitute(condition, place)) for condition in branch.conditions
        ),
    )


def _of_length(block: Block, radial: _Radial, solve: Solver) -> Iterator[InverseBranch]:
    """Any other F, through w = sqrt(2 e S), for both signs e of S and d of F'."""
    if len(block.names) == 1:
        return
    momenta = block.symbols
    form = quadratic_form(radial.inverse, momenta)
    whole = _form_of_velocities(radial.matrix, block.names)
    for e, d in product((1, -1), repeat=2):
        length = ex.square_root(writing.simplified(e * form))
        function = _of_square(ex.substitute(radial.function, {_S: Fraction(e, 2) * _W**2}))
        for inner in solve(function, [_W.coordinate], {_W.coordinate: _PI_W}):
            known = {_PI_W: e * d * length}
            w, energy = (
                ex.substitute(tree, known) for tree in (inner.velocities[0], inner.hamiltonian)
            )
            rates = [d * w * length**-1 * ex.dot(row, momenta) for row in radial.inverse.entries]
            size = ex.square_root(e * whole)
            slope = ex.substitute(
                calculus.differentiate(radial.function, _S), {_S: ex.HALF * whole}
            )
            conditions = [
                *(ex.substitute(c, {_W: size, **known}) for c in inner.conditions),
                d * slope,
            ]
            yield InverseBranch(tuple(rates), energy, (*conditions, e * whole))


def _of_square(tree: ex.Expression) -> ex.Expression:
    """The function of w > 0 with its powers and logarithms of c w^2, c a positive number, as those
    of w.
    """
    tree = ex.rebuild(tree, _of_square)
    inner = tree.base if isinstance(tree, ex.Power) else getattr(tree, "argument", tree)
    powers = dict(ex.powers_of(inner))
    exponent = powers.pop(_W, Fraction(0))
    number = ex.coefficient(inner)
    if not exponent or number <= 0 or any(not isinstance(p, ex.Number) for p in powers):
        return tree
    match tree:
        case ex.Power(_, ex.Number(e)):
            return ex.number(number) ** e * _W ** (exponent * e)
        case ex.Apply("log"):
            return ex.Apply("log", ex.number(number)) + exponent * ex.Apply("log", _W)
    return tree


def ratio_branches(block: Block, solve: Solver) -> Iterator[InverseBranch]:
    """The branches for each velocity that can play the part of v_k."""
    for pivot in block.names if len(block.names) > 1 else ():
        parts = _ratio_parts(block, pivot)
        if parts is None:
            continue
        alone, homogeneous = parts
        others = [name for name in block.names if name != pivot]
        for inner in solve(homogeneous, others, block.momenta):
            for outer in solve(alone, [pivot], block.momenta):
                yield _with_ratios(block, pivot, inner, outer)


def _ratio_parts(block: Block, pivot: str) -> tuple[ex.Expression, ex.Expression] | None:
    """(g, phi(u)), u_j being written as the velocity of w_j; None where the block is not of the
    form.
    """
    rate = ex.Velocity(pivot)
    others = [name for name in block.names if name != pivot]
    alone: list[collecting.Term] = []
    homogeneous: list[collecting.Term] = []
    whole = ex.substitute(block.function, {v: rate * v for v in block.velocities if v != rate})
    for monomial, value in collecting.expand(whole):
        rest = without_velocities(monomial, [pivot])
        if not writing.velocities_in(collecting.monomial_tree(monomial), others):
            alone.append((monomial, value))
        elif (rate, Fraction(1)) in monomial and not writing.velocities_in(
            collecting.monomial_tree(rest), [pivot]
        ):
            homogeneous.append((rest, value))
        else:
            return None
    if not alone or not homogeneous:
        return None
    return collecting.terms_tree(alone), collecting.terms_tree(homogeneous)


def _with_ratios(
    block: Block, pivot: str, inner: InverseBranch, outer: InverseBranch
) -> InverseBranch:
    """The branch of v_k(p_k + phi*(p_w)) and w = v_k u(p_w), in which v_k is left as the velocity
    of the pivot.
    """
    momentum, rate = block.momenta[pivot], ex.Velocity(pivot)
    whole = outer.changed(
        lambda tree: ex.substitute(tree, {momentum: momentum + inner.hamiltonian})
    )
    others = [v for v in block.velocities if v != rate]
    velocities = {v: u * rate for v, u in zip(others, inner.velocities, strict=True)} | {
        rate: whole.velocities[0]
    }
    ratios = {v: v / rate for v in others}
    conditions = (
        *(ex.substitute(condition, ratios) for condition in inner.conditions),
        *whole.conditions,
    )
    return InverseBranch(
        tuple(velocities[v] for v in block.velocities), whole.hamiltonian, conditions
    )
