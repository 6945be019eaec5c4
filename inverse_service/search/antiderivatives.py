"""Antiderivatives in one variable, formulas over one denominator with their roots, and functions
with a given gradient.

There are four levels. `primitive_of_monomials` integrates one sum in one variable. `antiderivative` also tries
substitutions, after which it calls `primitive_of_monomials`. `Integrator.integral` integrates a slope in one
variable: first each term by the power rule, then the remaining terms together by `primitive_of_monomials`, then
one by one by `antiderivative`. `Integrator.function_of` integrates a gradient.

A sum is integrated by linear algebra over candidates whose derivatives may contain its terms
(`primitive_of_monomials`). For a power of a generator p that is quadratic in the variable v, with p' = dp/dv,
p'', and D = 2 p p'' - p'^2, which is free of v,

    d/dv (p' p^e) = (1 + 2 e) p'' p^e - e D p^(e-1)
steps through the powers, down from p^(3/2) and up from p^(-5/2) or 1/p^2, until only these remain:
    d/dv atan(p'/sqrt D) = sqrt(D)/(2 p),    d/dv log(p' + sqrt(2 p'' p)) = sqrt(p''/(2 p)).
If D < 0, atanh(p'/sqrt(-D)), as logarithms, replaces the first; if p'' < 0, asin replaces the
second. So 1/(x^2 + y^2) leads to atan(x/y)/y, 1/sqrt(x^2 + y^2) to log(x + sqrt(x^2 + y^2)), and
the inverse cube of the distance to z/((x^2 + y^2) sqrt(x^2 + y^2 + z^2)).

A gradient is integrated one variable at a time: the derivatives of an integral over one variable
are subtracted from the other slopes, and the differences no longer depend on that variable
(Poincare's lemma). Terms are grouped by their factors that are not powers of the variable: the
integral of c u^e du/dx is c u^(e+1)/(e+1), never expanded, so that a potential is finite wherever
the force is. A constant field becomes W (x y' - y x')/2 if the forces are invariant under rotations
or couple its coordinates. Any other field is integrated along a coordinate on which it depends, so
that cyclic coordinates stay cyclic.

The potentials of A_i(t, q) v_i - V(t, q) with given Euler-Lagrange expressions follow in the same
way:

    E_i = (d_j A_i - d_i A_j) v_j + d_t A_i + d_i V
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, combinations_with_replacement
from typing import Any, NamedTuple

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import (
    calculus,
    collecting,
    functions as elementary,
    terms as tm,
    tree as ex,
)
from inverse_service.field import exact_field, matrices, modular, real_branch
from inverse_service.mechanics import writing
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import material as mt

_HALF = Fraction(1, 2)
# The highest power that is divided.
_HIGHEST = 12
_MOST_NESTED = 4  # functions in one another; the candidates for more have too many generators
_NAMES = ("F", "G", "K", "P", "Q", "S", "U", "W", "Z")
# Of the variable of a function of one, and the powers of it that its derivative is divided by.
_LETTERS = ("u", "w", "s", "z")
_DIVIDED = (0, 1, -1, 2, -2)
ONE_TERM: tm.Terms = {tm.EMPTY: Fraction(1)}


def factored_tree(
    tree: ex.Expression, variables: Sequence[ex.Symbol | ex.Velocity]
) -> ex.Expression:
    """The tree over its common denominator as a product of factors; TooManyTerms if that is
    large.
    """
    try:
        return exact_field.factored([tree], [ex.TIME, *variables], exact_field.Budget.long())[0]
    except (exact_field.TooLarge, ZeroDivisionError, KeyError) as problem:
        raise tm.TooManyTerms from problem


def reading_weight(tree: ex.Expression) -> int:
    """How hard a formula is to read: the number of nodes, where functions and roots count more."""
    return sum(_node_weight(node) for node in ex.walk(tree))


def _node_weight(node: ex.Expression) -> int:
    if (
        isinstance(node, ex.Power)
        and isinstance(node.exponent, ex.Number)
        and node.exponent.value.denominator > 1
    ):
        return 30
    return 8 if isinstance(node, ex.Apply) else 1


def lightest_form(
    tree: ex.Expression, variables: Sequence[ex.Symbol | ex.Velocity]
) -> ex.Expression:
    """The tree, its expansion, or its factored form, whichever has the least weight."""
    return writing.shorten(tree, exact_field.Budget.long(), [ex.TIME, *variables], reading_weight)


def even_root(radicand: ex.Expression) -> tuple[ex.Expression, ex.Expression]:
    """(a, b) with radicand = a^2 b; a sqrt(b) is a square root up to its sign.

    5 d^2/4 gives (d/2, 5) for either sign of d.
    """
    outside: list[ex.Expression] = []
    inside: list[ex.Expression] = []
    for base, e in ex.powers_of(radicand):
        if isinstance(base, ex.Number) and e == 1:
            whole, rest = tm.root_of_number(abs(base.value), 2)
            outside.append(ex.number(whole))
            inside.append(ex.number(rest if base.value > 0 else -rest))
        elif ex.is_exponential(base):
            outside.append(ex.Apply("exp", e / 2 * base.argument))
        else:
            half = e // 2 if e.denominator == 1 else Fraction(0)
            outside.append(base**half)
            inside.append(base ** (e - 2 * half))
    return ex.multiply(*outside), ex.multiply(*inside)


def extracted_root(tree: ex.Expression) -> ex.Expression:
    """A square root of a product with the squares among its factors taken out; its sign is
    arbitrary.
    """
    outside, inside = even_root(tree)
    terms = tm.terms_of(inside)
    number, rest = (
        even_root(ex.number(tm.split_content(terms)[0])) if len(terms) > 1 else (ex.ONE, ex.ZERO)
    )
    if rest != ex.ONE:
        return outside * ex.square_root(tm.tree_of(terms))
    return (
        outside
        * number
        * ex.square_root(tm.tree_of(tm.multiply_terms(terms, tm.terms_of(number**-2))))
    )


def rational_solution(
    columns: Sequence[Mapping[Any, Fraction]], right: Mapping[Any, Fraction]
) -> list[Fraction] | None:
    """x with sum_k x_k columns[k] = right, preferring earlier columns; None if there is none."""
    if any(not any(key in column for column in columns) for key in right):
        return None
    sides = [*columns, right]
    rows, zero = list(dict.fromkeys(key for side in sides for key in side)), Fraction(0)
    table = matrices.echelon_of(
        [[side.get(key, zero) for side in sides] for key in rows], len(sides)
    )
    found = [zero] * len(columns)
    for pivot, row in table:
        if pivot == len(columns):
            return None
        found[pivot] = row[-1]
    return found


def in_one_square(terms: tm.Terms) -> tm.Terms:
    """The terms with 1/cos(u)^k - 1/cos(u)^(k - 2) for sin(u)^2/cos(u)^k and so on, so that equal
    terms look equal.
    """
    return tm.weighted_sum((_of_one_square(key), value) for key, value in terms.items())


def _of_one_square(key: tm.Monomial) -> tm.Terms:
    powers = dict(key)
    for letter, e in key:
        if e >= 2 and isinstance(letter, ex.Apply) and letter.function in elementary.SQUARES:
            name, a, b = elementary.SQUARES[letter.function]
            partner = ex.Apply(name, letter.argument)
            if powers.get(partner, 0) < 0:
                less = tm.times(key, tm.monomial(letter), -2)
                parts = {less: Fraction(a), tm.times(less, tm.monomial(partner), 2): Fraction(b)}
                return in_one_square(parts)
    return {key: Fraction(1)}


def _proper(terms: tm.Terms, x: modular.Variable) -> tm.Terms:
    """The terms `in_one_square`, with x - a x/(x^2 + a) for x^3/(x^2 + a), so that no such power
    multiplies its sum.

    Of a sum and its constant multiples, only one remains a generator.
    """
    left, result = (
        in_one_square(tm.sum_of(_with_one_sum(key, value) for key, value in terms.items())),
        tm.Terms(),
    )
    while left:
        deadline.check()
        key = max(left, key=lambda one: tm.exponent_of(one, x))
        value, parts = left.pop(key), _divided(key, x)
        if parts is None:
            result[key] = value
        else:
            left = tm.add_terms(left, parts, value)
    return result


def _with_one_sum(key: tm.Monomial, value: Fraction) -> tm.Terms:
    """1/(x - 1) for -1/(1 - x), a/sqrt(a^2 - x^2) for 1/sqrt(1 - x^2/a^2)."""
    for letter, e in key:
        if isinstance(letter, ex.Sum):
            sign, outside, other = _primitive_sum(letter)
            if other != letter and (sign > 0 or e.denominator == 1):
                key = tm.times(tm.times(key, frozenset([(letter, e)]), -1), frozenset([(other, e)]))
                key, value = tm.times(key, outside, e), -value if sign < 0 and e % 2 else value
    return {key: value}


class PrimitiveSum(NamedTuple):
    """A sum as a sign times a monomial times the rest."""

    sign: int
    outside: tm.Monomial
    rest: ex.Expression


@lru_cache(maxsize=1024)
def _primitive_sum(tree: ex.Sum) -> PrimitiveSum:
    """(1 or -1, a monomial, a sum) with product the tree; the sum divides by no symbol and begins
    with a plus.
    """
    terms = tm.terms_of(tree)
    tables = list(map(dict, terms))
    lowest = {
        letter: min(table.get(letter, Fraction(0)) for table in tables)
        for table in tables
        for letter in table
    }
    outside = frozenset((p, e) for p, e in lowest.items() if e < 0 and isinstance(p, ex.Symbol))
    terms = tm.multiply_by(terms, outside, -1)
    sign = -1 if terms[min(terms, key=tm.rank)] < 0 else 1
    return PrimitiveSum(sign, outside, tm.tree_of(tm.scaled(terms, sign)))


def _divided(key: tm.Monomial, x: modular.Variable) -> tm.Terms | None:
    """The monomial with x^d = (D - r)/c for a generator D = c x^d + r with constant c; None if
    there is no such D.
    """
    power = tm.exponent_of(key, x)
    for letter in dict(key):
        if not 2 <= power <= _HIGHEST or not isinstance(letter, ex.Sum) or not ex.holds(letter, x):
            continue
        rest = tm.terms_of(letter)
        degree = max(tm.exponent_of(part, x) for part in rest)
        leads = [part for part in rest if (x, degree) in part]
        plain = all(p == x or not ex.holds(p, x) for part in rest for p, _ in part)
        if plain and len(leads) == 1 and 2 <= degree <= power:
            value, less = rest.pop(leads[0]), tm.times(key, leads[0], -1)
            found = {tm.times(less, tm.monomial(letter), 1): 1 / value}
            return tm.add_terms(found, tm.multiply_by(rest, less, factor=-1 / value))
    return None


def quadratic_candidates(
    key: tm.Monomial, variable: modular.Variable, table: real_branch.RealTable | None = None
) -> Iterator[tm.Monomial]:
    """Candidates for the antiderivative of the monomial without constant factors, real at the point
    of a table.
    """
    for letter, e in key:
        whole = e.denominator == 1 and e < 0
        if isinstance(letter, ex.Sum) and abs(e) <= bounds.POWER and (whole or e.denominator == 2):
            with suppress(tm.TooManyTerms, calculus.NoRealValue, errors.IrreducibleAtoms):
                yield from _of_letter(key, letter, e, variable, table)


def _of_letter(
    key: tm.Monomial,
    letter: ex.Sum,
    e: Fraction,
    x: modular.Variable,
    table: real_branch.RealTable | None,
) -> Iterator[tm.Monomial]:
    slope = tm.letter_derivative(letter, x)
    second = tm.derivative_of_terms(slope, x)
    if not second or ex.holds(tm.tree_of(second), x) or (D := _discriminant(letter, x)) == ex.ZERO:
        return
    rest = tm.times(key, frozenset([(letter, e)]), -1)
    for exponent, power_of_d in _steps(e):
        outer = tm.times(
            tm.times(rest, frozenset([(letter, exponent)])), monomial_of(D**power_of_d)
        )
        yield from (tm.times(outer, part) for part in slope)
    if e == Fraction(-3, 2):
        return  # 1 + 2 e is zero on the way up, so nothing remains
    p, bend = tm.tree_of(slope), tm.tree_of(second)
    falling = _is_negative(D if e.denominator == 1 else bend, table)
    if e.denominator == 1:
        root = tm.tree_of(tm.terms_of(extracted_root(ex.negated(D) if falling else D)))
        inner = ex.Apply("atanh" if falling else "atan", lightest_form(p / root, ()))
        function = tm.times(monomial_of(1 / root), tm.monomial(inner))
    elif falling:
        function = tm.monomial(
            ex.Apply("asin", lightest_form(p / extracted_root(ex.negated(D)), ()))
        )
    else:
        function = tm.monomial(
            ex.Apply("log", _primitive_part(p + extracted_root(2 * bend) * ex.square_root(letter)))
        )
    last = tm.times(rest, monomial_of(D ** math.floor(e + 1)))
    for k in range(
        3 if e in (-1, -_HALF) else 1
    ):  # the variable itself may occur in the monomial: v/p, v^2/p
        yield tm.times(tm.times(last, tm.monomial(x), -k), function)


@lru_cache(maxsize=256)
def _discriminant(letter: ex.Sum, x: modular.Variable) -> ex.Expression:
    """D in factored form."""
    slope = tm.letter_derivative(letter, x)
    second = tm.derivative_of_terms(slope, x)
    twice = {key: 2 * a for key, a in tm.multiply_terms(tm.terms_of(letter), second).items()}
    held = [variable for variable in modular.variables_in(letter) if variable != ex.TIME]
    return factored_tree(tm.tree_of(tm.add_terms(twice, tm.multiply_terms(slope, slope), -1)), held)


def _steps(e: Fraction) -> list[tuple[Fraction, int]]:
    """(power of p, power of D) of the terms p' p^… D^…, up to the last negative power or down to
    the last positive.
    """
    if e < 0:
        return [(e + k, -k) for k in range(1, bounds.POWER + 1) if e + k < 0]
    return [(e - k, k) for k in range(bounds.POWER + 1) if e - k > 0]


def _is_negative(tree: ex.Expression, table: real_branch.RealTable | None) -> bool:
    """Whether the tree is negative at the real point or, without a point, all its terms have a
    minus sign.
    """
    if table is not None:
        return real_branch.real_sign(tree, table) < 0
    return all(value < 0 for value in tm.terms_of(tree).values())


def monomial_of(tree: ex.Expression) -> tm.Monomial:
    """A product as one monomial without its number; sums are kept whole."""
    found = tm.EMPTY
    for base, e in ex.powers_of(tree):
        ((key, _),) = tm.terms_of(base ** -abs(e)).items()
        found = tm.times(found, key, 1 if e < 0 else -1)
    return found


def _primitive_part(tree: ex.Expression) -> ex.Expression:
    """The tree without its numeric factor."""
    _, common, rest = tm.split_content(tm.terms_of(tree))
    return tm.monomial_tree(common) * rest


def primitive_of_monomials(
    x: modular.Variable, wanted: tm.Terms, table: real_branch.RealTable | None = None
) -> ex.Expression | None:
    """A sum of monomials with the derivative `wanted` by x, by linear algebra over candidate
    monomials.

    The coefficients are rational if possible; otherwise they contain generators without x. The
    result is real at the point of a table; None if none is found. Fractions come first, with one
    denominator as partial fractions, with many terms as logarithms; then candidates in a few
    rounds, each for the terms that the candidates of the last one add. Cached, because smaller
    systems of a search ask for the same ones again.
    """
    near = None if table is None else tuple(table.items())
    return _primitive_of(x, tuple(wanted.items()), near)


@lru_cache(maxsize=256)
def _primitive_of(
    x: modular.Variable,
    items: tuple[tuple[tm.Monomial, Fraction], ...],
    near: tuple[tuple[ex.Expression, Any], ...] | None,
) -> ex.Expression | None:
    wanted, table = dict(items), None if near is None else dict(near)
    if _has_function_without_slope((letter for key in wanted for letter, _ in key), x):
        return None
    if (listed := _listed(x, wanted)) is not None:
        return listed
    if is_deep(letter for key in wanted for letter, _ in key):
        return None
    columns: dict[tm.Monomial, tm.Terms] = {}
    wanted = _proper(wanted, x)
    poles = {
        p for key in wanted for p, e in key if e < 0 and isinstance(p, ex.Sum) and ex.holds(p, x)
    }
    if len(poles) == 1 and (found := _by_partial_fractions(x, wanted)) is not None:
        return found  # the steps below divide by the discriminant of the sum, which is slow if it contains symbols
    if (
        len(wanted) > bounds.FEW
        and (found := _by_logarithms(x, wanted, sorted(poles, key=ex.node_count))) is not None
    ):
        return found
    fresh, most = list(wanted), 2 * bounds.COLUMNS + 4 * len(wanted)
    for _ in range(bounds.FEW):
        raised = dict.fromkeys(m for key in fresh for m in mt.antiderivative_candidates(key, x))
        raised |= dict.fromkeys(m for key in fresh for m in quadratic_candidates(key, x, table))
        raised = {m: None for m in raised if m not in columns}
        added = sorted(raised, key=tm.rank)[: most - len(columns)]
        if columns and not added:
            break
        deadline.check(len(added))
        columns |= {m: _slope(m, x) for m in added}
        fresh = [key for m in added for key in columns[m]]
        rational = rational_solution(list(columns.values()), wanted)
        if rational is not None:
            terms = {m: a for m, a in zip(columns, rational, strict=True) if a}
            return _in_logarithms(_disentangled(terms, wanted, x))
        found = _with_constants(x, columns, wanted)
        if found is not None:
            return _in_logarithms(found)
    return _by_partial_fractions(x, wanted)


def _disentangled(terms: tm.Terms, wanted: tm.Terms, x: modular.Variable) -> ex.Expression:
    """The sum of terms with constants before x and logarithms, where the slope has neither of them.

    The slopes of the candidates hold sines and cosines of one angle as if they were independent.
    Where they are not, log(sin(x)) may have the factor 1/cos(x)^2 - tan(x)^2, and x one that is 0:
    by Liouville's theorem such factors are constants.
    """

    def is_outer(letter: ex.Expression) -> bool:
        return letter == x or (isinstance(letter, ex.Apply) and letter.function == "log")

    groups = {key: tm.tree_of(part) for key, part in tm.grouped(terms, is_outer).items()}
    is_tangled = any(key and ex.holds(part, x) for key, part in groups.items())
    if not is_tangled or any(is_outer(letter) for key in wanted for letter, _ in key):
        return tm.tree_of(terms)
    for key, part in groups.items():
        with suppress(exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError):
            ring = exact_field.exact_ring([part], [], None, exact_field.Budget.short())
            whole = exact_field.quotient_tree(ring, ring.value(part))
            groups[key] = min(part, whole, key=reading_weight)
    return ex.add(*(part * tm.monomial_tree(key) for key, part in groups.items()))


@lru_cache(maxsize=4096)  # a candidate is asked for in each round, with and without constants
def _slope(monomial: tm.Monomial, x: modular.Variable) -> tm.Terms:
    return _proper(tm.derivative_of_terms({monomial: Fraction(1)}, x), x)


def _listed(x: modular.Variable, wanted: tm.Terms) -> ex.Expression | None:
    """c F(u)/u' for c f(u), where the table of functions has a primitive F of f and c and u' are
    free of x.
    """
    if len(wanted) != 1:
        return None
    ((key, value),) = wanted.items()
    moving = [(letter, e) for letter, e in key if ex.holds(letter, x)]
    if len(moving) != 1 or moving[0][1] != 1 or not isinstance(letter := moving[0][0], ex.Apply):
        return None
    row = elementary.FUNCTION.get(letter.function)
    rate = collecting.collect(calculus.differentiate(letter.argument, x))
    if row is None or row.primitive is None or ex.holds(rate, x):
        return None
    rest = tm.tree_of({tm.times(key, tm.monomial(letter), -1): value})
    return ex.multiply(rest, rate**-1, row.primitive(letter.argument))


def is_deep(trees: Iterable[ex.Expression]) -> bool:
    """Whether functions lie in one another too often for the candidates of an ansatz."""
    return ex.nesting(trees, lambda node: isinstance(node, ex.Apply)) > _MOST_NESTED


def _has_function_without_slope(trees: Iterable[ex.Expression], x: modular.Variable) -> bool:
    """Whether an arbitrary function of x occurs, but no derivative of it.

    Such a formula has no elementary antiderivative: with f in it, its slope contains f'.
    """
    found = [
        node
        for node in ex.distinct_nodes(trees)
        if isinstance(node, ex.Arbitrary) and ex.holds(node, x)
    ]
    derived = {node.name for node in found if any(node.orders)}
    return not any(isinstance(node, ex.Integral) for node in found) and any(
        node.name not in derived for node in found
    )


def _in_logarithms(tree: ex.Expression) -> ex.Expression:
    """atanh(a/b) as (log(a + b) - log(a - b))/2, up to a constant."""
    table: dict[ex.Expression, ex.Expression] = {}
    for node in ex.distinct_nodes((tree,)):
        if isinstance(node, ex.Apply) and node.function == "atanh":
            below = ex.multiply(*(base**-e for base, e in ex.powers_of(node.argument) if e < 0))
            high, low = (_primitive_part(node.argument * below + sign * below) for sign in (1, -1))
            table[node] = _HALF * (ex.Apply("log", high) - ex.Apply("log", low))
    return ex.substitute(tree, table) if table else tree


def _by_logarithms(
    x: modular.Variable, wanted: tm.Terms, poles: Sequence[ex.Expression]
) -> ex.Expression | None:
    """sum c_p log p over denominators p, by the relations of a ring: one fraction of sines of one
    angle is short in one variable only.
    """
    trees = [tm.tree_of(wanted), *(calculus.differentiate(p, x) / p for p in poles)]
    with suppress(exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError, KeyError):
        ring = exact_field.exact_ring(trees, [x], 1, exact_field.Budget.short())
        right, *columns = ([ring.value(tree)] for tree in trees)
        if (found := matrices.solution(ring, columns, right)) is not None:
            return ex.dot(
                (exact_field.quotient_tree(ring, c) for c in found),
                (ex.Apply("log", p) for p in poles),
            )
    return None


def _with_constants(
    x: modular.Variable, columns: Iterable[tm.Monomial], wanted: tm.Terms
) -> ex.Expression | None:
    """The sum with coefficients from the field of the generators without x."""
    varying = dict.fromkeys(frozenset(item for item in m if ex.holds(item[0], x)) for m in columns)
    plain = {m: _slope(m, x) for m in varying if m}
    if not plain or len(varying) > bounds.COLUMNS:
        return None
    found = _combination(
        [
            tm.grouped(terms, lambda letter: ex.holds(letter, x))
            for terms in (*plain.values(), wanted)
        ]
    )
    return (
        None if found is None else ex.add(*(c * tm.monomial_tree(list(plain)[k]) for k, c in found))
    )


def _combination(
    sides: Sequence[Mapping[tm.Monomial, tm.Terms]],
) -> list[tuple[int, ex.Expression]] | None:
    """(k, c_k) with sum_k c_k sides[k] = sides[-1], c_k in the field of the generators of the
    coefficients.
    """
    trees = [
        [tm.tree_of(side.get(key, {})) for side in sides]
        for key in dict.fromkeys(k for side in sides for k in side)
    ]
    try:
        budget = exact_field.Budget.short()
        ring = exact_field.exact_ring([tree for row in trees for tree in row], [], None, budget)
        found = matrices.reduced_rows(
            [[ring.value(tree) for tree in row] for row in trees], range(len(sides))
        )
    except (exact_field.TooLarge, ZeroDivisionError):
        return None
    if len(sides) - 1 in found.pivots:
        return None
    return [
        (k, exact_field.quotient_tree(ring, row[-1]))
        for k, row in zip(found.pivots, found.rows, strict=True)
    ]


def _by_partial_fractions(x: modular.Variable, wanted: tm.Terms) -> ex.Expression | None:
    """sum c_p log p + c_q atan(q') + (c_j + d_j x) p^-j + c_k x^k over the irreducible factors p, q
    of denominators.

    Everything free of x is constant. All integrals of rational functions whose denominators have
    factors of degree 1 and 2 in x have this form.
    """
    wanted = tm.sum_of(_with_factors(key, value, x) for key, value in wanted.items())
    poles = dict[ex.Expression, int]()
    for letter, e in (item for key in wanted for item in key if ex.holds(item[0], x)):
        if e.denominator > 1:
            return None
        if e < 0:
            poles[letter] = max(poles.get(letter, 0), int(-e))
    if not 2 <= sum(poles.values()) <= _HIGHEST:
        return None
    whole: tm.Monomial = frozenset((letter, Fraction(e)) for letter, e in poles.items())

    def by_generators(terms: tm.Terms) -> dict[tm.Monomial, tm.Terms]:
        """The terms over the common denominator, grouped by their x-dependent factors."""
        terms = tm.sum_of(_with_one_sum(key, value) for key, value in terms.items())
        numerator = ex.add(
            *(value * tm.monomial_tree(tm.times(key, whole)) for key, value in terms.items())
        )
        return tm.grouped(tm.terms_of(numerator), lambda letter: ex.holds(letter, x))

    right = by_generators(wanted)
    highest = max(int(tm.exponent_of(own, x)) for own in right) - sum(poles.values())
    primitives: list[tm.Monomial] = [frozenset([(x, Fraction(k + 1))]) for k in range(highest + 1)]
    for letter, most in poles.items():
        primitives.append(tm.monomial(ex.Apply("log", letter)))
        primitives += [frozenset([(letter, Fraction(-j))]) for j in range(1, most)]
        degrees = [tm.exponent_of(key, x) for key in tm.terms_of(letter)]
        if max(degrees) == 2 and min(degrees) >= 0:
            primitives += [
                frozenset([(x, Fraction(1)), (letter, Fraction(-j))]) for j in range(1, most)
            ]
            primitives += [*quadratic_candidates(frozenset([(letter, Fraction(-1))]), x)][:1]
    found = _combination(
        [*(by_generators(tm.derivative_of_terms({m: Fraction(1)}, x)) for m in primitives), right]
    )
    return (
        None if found is None else ex.add(*(c * tm.monomial_tree(primitives[k]) for k, c in found))
    )


def _with_factors(key: tm.Monomial, value: Fraction, x: modular.Variable) -> tm.Terms:
    """The monomial with its denominators that depend on x factored into irreducible sums."""
    found: tm.Terms = {key: value}
    for letter, e in key:
        if isinstance(letter, ex.Sum) and e < 0 and e.denominator == 1 and ex.holds(letter, x):
            rest = tm.sum_of(
                {tm.times(k, frozenset([(letter, e)]), -1): a} for k, a in found.items()
            )
            found = tm.multiply_terms(rest, tm.power_of_factors(tm.terms_of(letter), e))
    return tm.sum_of(_with_one_sum(k, a) for k, a in found.items())


def antiderivative(
    system: SecondOrderSystem,
    slope: ex.Expression,
    variable: modular.Variable,
    table: real_branch.RealTable | None,
) -> ex.Expression | None:
    """An elementary antiderivative of a formula in one variable; None if none is found."""
    if is_deep([slope]):
        return None
    names = fresh_names(system, slope)
    letter, inner, deeper = (ex.Symbol(next(names)) for _ in range(3))
    plain = writing.joined(
        ex.substitute(slope if table is None else real_form(slope, table), {variable: letter})
    )
    forms = [
        (plain, letter, letter),
        *((form, inner, w) for form, w in _substitutions(plain, letter, inner)),
    ]
    forms += [
        (form, deeper, ex.substitute(w, {x: of}))
        for g, x, of in forms
        for form, w in _by_roots(g, x, deeper)
    ]
    for form, name, meant in forms:
        with suppress(tm.TooManyTerms, exact_field.TooLarge, ZeroDivisionError):
            found = primitive_of_monomials(name, tm.terms_of(form))
            if found is not None:
                return ex.substitute(ex.substitute(found, {name: meant}), {letter: variable})
    return None


def _by_roots(
    slope: ex.Expression, x: ex.Symbol, w: ex.Symbol
) -> Iterator[tuple[ex.Expression, ex.Expression]]:
    """(g, w) with slope = g(w) w' and w = (a x + b)^(1/q), if the slope contains a root of a x +
    b.
    """
    powers = [
        node
        for node in ex.distinct_nodes((slope,))
        if isinstance(node, ex.Power) and ex.holds(node, x)
    ]
    roots = [(node, node.exponent.value) for node in powers if isinstance(node.exponent, ex.Number)]
    for base in dict.fromkeys(node.base for node, e in roots if e.denominator > 1):
        rate = calculus.differentiate(base, x)
        if rate != ex.ZERO and not ex.holds(rate, x):
            q = math.lcm(*(e.denominator for node, e in roots if node.base == base))
            values = {node: w ** (q * e) for node, e in roots if node.base == base}
            place = {x: (w**q - ex.substitute(base, {x: ex.ZERO})) / rate}
            yield (
                q * w ** (q - 1) / rate * ex.substitute(ex.substitute(slope, values), place),
                base ** Fraction(1, q),
            )


def _substitutions(
    slope: ex.Expression, x: ex.Symbol, inner: ex.Symbol
) -> Iterator[tuple[ex.Expression, ex.Expression]]:
    """(g, w) with slope = g(w(x)) w'(x), g in the symbol `inner`.

    w is x^2, a function of x that occurs, sin^2, sin, cos, tan (Bioche's rules) or tan(u/2)
    (Weierstrass) of an angle u, or exp(u) for hyperbolic functions.
    """
    functions = dict.fromkeys(
        node for node in ex.walk(slope) if isinstance(node, ex.Apply) and x in ex.walk(node)
    )
    for w in (x**2, *functions):
        outer = collecting.merge_powers(slope / calculus.differentiate(w, x))
        table: dict[ex.Expression, ex.Expression] = {w: inner}
        if isinstance(w, ex.Power):
            exponents = {
                node: node.exponent.value / 2
                for node in ex.walk(outer)
                if isinstance(node, ex.Power)
                and node.base == x
                and isinstance(node.exponent, ex.Number)
            }
            table = {node: inner**half for node, half in exponents.items() if half.denominator == 1}
        form = ex.substitute(outer, table)
        if x not in ex.walk(form):
            yield form, w
    for angle in dict.fromkeys(
        node.argument for node in functions if node.function in elementary.CIRCULAR
    ):
        yield from _circular(slope, x, angle, inner)
    exponential = [node for node in functions if node.function in ("exp", "sinh", "cosh", "tanh")]
    for u in dict.fromkeys(node.argument for node in exponential):
        values = dict[ex.Expression, ex.Expression]()
        for node in exponential:
            multiple = collecting.collect(node.argument / u)
            if isinstance(multiple, ex.Number) and multiple.value.denominator == 1:
                w = inner**multiple
                rising, falling = ex.HALF * (w + 1 / w), ex.HALF * (w - 1 / w)
                values[node] = {
                    "exp": w,
                    "cosh": rising,
                    "sinh": falling,
                    "tanh": (w**2 - 1) / (w**2 + 1),
                }[node.function]
        form = ex.substitute(slope / (inner * calculus.differentiate(u, x)), values)
        if x not in ex.walk(form):
            yield form, ex.Apply("exp", u)


def _circular(
    slope: ex.Expression, x: ex.Symbol, angle: ex.Expression, w: ex.Symbol
) -> Iterator[tuple[ex.Expression, ex.Expression]]:
    """The substitutions for functions of one angle, whose sine and cosine have squares rational in
    each other.
    """
    sine, cosine, tangent = (ex.Apply(name, angle) for name in ("sin", "cos", "tan"))
    others = {"tan": sine / cosine, "cot": cosine / sine, "sec": 1 / cosine, "csc": 1 / sine}
    plain = ex.substitute(slope, {ex.Apply(name, angle): value for name, value in others.items()})
    choices: list[tuple[ex.Expression, ex.Expression, ex.Expression, ex.Expression]] = [
        (sine**2, 2 * sine * cosine, w, 1 - w),
        (sine, cosine, w**2, 1 - w**2),
        (cosine, -sine, 1 - w**2, w**2),
        (tangent, cosine**-2, w**2 / (1 + w**2), 1 / (1 + w**2)),
    ]
    for meant, rate, sines, cosines in choices:
        outer = collecting.merge_powers(plain / (rate * calculus.differentiate(angle, x)))
        form = ex.substitute(_with_squares(outer, {sine: sines, cosine: cosines}), {meant: w})
        if x not in ex.walk(form):
            yield form, meant
    below = 1 + w**2
    halves = {sine: 2 * w / below, cosine: (1 - w**2) / below}
    form = ex.substitute(2 * plain / (below * calculus.differentiate(angle, x)), halves)
    if x not in ex.walk(form):
        yield form, ex.Apply("tan", ex.HALF * angle)


def _with_squares(
    tree: ex.Expression, squares: Mapping[ex.Expression, ex.Expression]
) -> ex.Expression:
    """The tree with these replacements for the squares of functions, in all even powers."""
    match tree:
        case ex.Power(base, ex.Number(e)) if base in squares and e.denominator == 1 and e % 2 == 0:
            return squares[base] ** (e / 2)
    return ex.rebuild(tree, lambda part: _with_squares(part, squares))


def real_form(tree: ex.Expression, table: real_branch.RealTable) -> ex.Expression:
    """The tree in a form that is real at the point: log(-u) for log(u) if u < 0, sqrt(-u)*sqrt(-w)
    for sqrt(u)*sqrt(w).

    The first changes it by a constant. In the second, sqrt(u)*sqrt(w) represents sqrt(u*w) next to
    integer powers of u. Odd roots of u < 0 are those of -u with their sign.
    """
    with suppress(calculus.NoRealValue, errors.IrreducibleAtoms):
        return tree if real_branch.is_defined([tree], table) else _turned(tree, table)
    return tree


def _turned(tree: ex.Expression, table: real_branch.RealTable) -> ex.Expression:
    tree = ex.rebuild(tree, lambda part: _turned(part, table))
    if isinstance(tree, ex.Integral):
        return replace(tree, slopes=tuple(slope and _turned(slope, table) for slope in tree.slopes))
    if (
        isinstance(tree, ex.Apply)
        and tree.function == "log"
        and real_branch.real_sign(tree.argument, table) < 0
    ):
        return ex.Apply("log", ex.negated(tree.argument))
    match tree:
        case ex.Power(base, ex.Number(e)) if (
            e.denominator % 2 and e.denominator > 1 and real_branch.real_sign(base, table) < 0
        ):
            return ex.number((-1) ** (e.numerator % 2)) * ex.negated(base) ** e
    factors = tree.factors if isinstance(tree, ex.Product) else ()
    halves: dict[ex.Expression, ex.Expression] = {
        factor: ex.negated(factor.base) ** factor.exponent
        * (-1) ** (math.floor(factor.exponent.value) % 2)
        for factor in factors
        if isinstance(factor, ex.Power)
        and isinstance(factor.exponent, ex.Number)
        and factor.exponent.value.denominator == 2
        and real_branch.real_sign(factor.base, table) < 0
    }
    is_real = halves and len(halves) % 2 == 0
    return ex.multiply(*(halves.get(factor, factor) for factor in factors)) if is_real else tree


def fresh_names(system: SecondOrderSystem, *trees: ex.Expression) -> Iterator[str]:
    """Unused names for functions."""
    used = {*system.names.declared()}
    used |= {
        node.name for tree in trees for node in ex.walk(tree) if isinstance(node, ex.Arbitrary)
    }
    yield from (
        name for name in (*_NAMES, *(f"F_{k}" for k in range(1, 1_000))) if name not in used
    )


@dataclass(slots=True)
class Integrator:
    """Integrate over the coordinates of one system.

    With `integral_signs`, nonelementary integrals are left unevaluated instead of ending the
    attempt. `table` is a real point at which the results must be real.
    """

    system: SecondOrderSystem
    table: real_branch.RealTable | None = None
    integral_signs: bool = False
    names: Iterator[str] = field(init=False)

    def __post_init__(self) -> None:
        self.names = fresh_names(self.system)

    def function_of(
        self, variables: Sequence[modular.Variable], slopes: Sequence[tm.Terms]
    ) -> tm.Terms | None:
        """phi with d phi/d variables[i] = slopes[i]; None if there is none, or none is found."""
        if not _is_closed(variables, slopes):
            return None
        rest, total = [dict(slope) for slope in slopes], tm.Terms()
        for k, variable in enumerate(variables):
            if not rest[k]:
                continue
            part, left = self.integral(rest[k], variable)
            if left and not self.integral_signs:
                return None
            total = tm.add_terms(total, part)
            for j, q in enumerate(variables):
                if j != k and (slope := tm.derivative_of_terms(part, q)):
                    rest[j] = tm.add_terms(rest[j], slope, -1)
                    if any(tm.depends_on(rest[j], earlier) for earlier in variables[: k + 1]):
                        rest[j] = self.in_normal_form(rest[j])
            rest[k] = left
            if left:
                return tm.add_terms(total, self._sum_of_named_integrals(variables, rest, k))
        return None if any(rest) and not all(is_zero(terms) for terms in rest) else total

    def with_hessian(self, entries: Sequence[tm.Terms]) -> tm.Terms | None:
        """An elementary function with these second derivatives by the velocities, in the order 11,
        12, … 1n, 22, ….
        """
        plain, velocities = (
            Integrator(self.system, self.table),
            list(map(ex.Velocity, self.system.coordinates)),
        )
        places = range(len(velocities))
        entry = dict(zip(combinations_with_replacement(places, 2), entries, strict=True))
        momenta = list[tm.Terms]()
        for i in places:
            momentum = plain.function_of(velocities, [entry[min(i, j), max(i, j)] for j in places])
            if momentum is None:
                return None
            momenta.append(momentum)
        return plain.function_of(velocities, momenta)

    def _sum_of_named_integrals(
        self, variables: Sequence[modular.Variable], slopes: Sequence[tm.Terms], k: int
    ) -> tm.Terms:
        """The function with these closed slopes as named integrals, with constant factors outside
        the integral sign.
        """
        rest = [self.in_normal_form(terms) for terms in slopes]
        moving = {q: terms for q, terms in zip(variables, rest, strict=True) if terms}
        if len(moving) > 1:  # one function of all of them, such as G(x - y) with the force F(x - y)
            parameters = set(map(ex.Symbol, self.system.parameters))
            common = frozenset.intersection(*(key for terms in moving.values() for key in terms))
            constants: tm.Monomial = frozenset(item for item in common if item[0] in parameters)
            inside = {
                q: tm.tree_of(tm.multiply_by(terms, constants, -1)) for q, terms in moving.items()
            }
            return tm.multiply_terms({constants: Fraction(1)}, self.named_integral(inside))
        return tm.sum_of(
            tm.multiply_terms(beside, self.named_integral({variables[k]: tm.tree_of(inner)}))
            for beside, inner in _outside(rest[k], variables[k])
        )

    def in_normal_form(self, terms: tm.Terms) -> tm.Terms:
        """The sum over one denominator, simplified by relations among its generators; 0 if it
        vanishes.
        """
        if is_zero(terms):
            return {}
        with suppress(tm.TooManyTerms):
            return tm.terms_of(
                writing.quotient(
                    tm.tree_of(terms), exact_field.Budget.short(), self.system.variables
                )
            )
        return terms

    def integral(
        self, slope: tm.Terms, variable: modular.Variable, is_cancelled: bool = False
    ) -> tuple[tm.Terms, tm.Terms]:
        """(an integral of a part of the slope over one variable, the remaining slope)."""
        groups = tm.grouped(slope, lambda letter: letter != variable and ex.holds(letter, variable))
        total, other = tm.Terms(), tm.Terms()
        for own, beside in groups.items():
            part = power_rule(own, beside, variable)
            if part is None:
                other = tm.add_terms(other, tm.multiply_by(beside, own))
            else:
                total = tm.add_terms(total, part)
        if not other:
            return total, other
        # Many terms may become few over their own denominators; few are first integrated unchanged.
        for cancels in (True, False) if len(other) > bounds.CANDIDATES else (False, True):
            if not cancels:
                known = primitive_of_monomials(variable, other, self.table)
                if known is not None:
                    return tm.add_terms(total, tm.terms_of(known)), {}
            elif not is_cancelled and (cancelled := self._cancelled(other)) != other:
                part, left = self.integral(cancelled, variable, is_cancelled=True)
                return tm.add_terms(total, part), left
        left = tm.Terms()
        for beside, inner in _outside(other, variable):
            for part in self._integrable(inner, variable):
                found = antiderivative(self.system, tm.tree_of(part), variable, self.table)
                if found is None:
                    left = tm.add_terms(left, tm.multiply_terms(beside, part))
                else:
                    total = tm.add_terms(total, tm.multiply_terms(beside, tm.terms_of(found)))
        return total, left

    def _integrable(self, slope: tm.Terms, variable: modular.Variable) -> list[tm.Terms]:
        """The slope, or its terms by their functions: sin(x) and a quotient of polynomials are each
        integrable, where their sum is not seen to be.
        """
        if antiderivative(self.system, tm.tree_of(slope), variable, self.table) is not None:
            return [slope]
        groups = tm.grouped(
            slope, lambda letter: isinstance(letter, ex.Apply) and ex.holds(letter, variable)
        )
        return [tm.multiply_by(terms, functions) for functions, terms in groups.items()]

    def _cancelled(self, terms: tm.Terms) -> tm.Terms:
        """The terms with the coefficient of each product of constants and functions over its own
        denominator.

        a x (x - 1)/(x^2 (x - 1)) is a/x. If there are roots, the products are those of roots.
        """
        groups: dict[tm.Monomial, tm.Terms] = {}
        for key, value in terms.items():
            roots = frozenset(
                (p, e % 1) for p, e in key if isinstance(p, ex.Sum) and e.denominator > 1
            )
            groups.setdefault(roots, {})[tm.times(key, roots, -1)] = value
        if not any(groups):
            parameters = set(map(ex.Symbol, self.system.parameters))
            groups = tm.grouped(
                terms, lambda letter: letter in parameters or isinstance(letter, ex.Apply)
            )
        parts = [
            tm.multiply_terms({key: Fraction(1)}, self.in_normal_form(inner))
            for key, inner in groups.items()
        ]
        return tm.sum_of(parts)

    def named_integral(self, known: Mapping[modular.Variable, ex.Expression]) -> tm.Terms:
        """One function F of all variables in these slopes, its derivatives; the other derivatives
        are unspecified.
        """
        of_one = self._function_of_one(known)
        if of_one is not None:
            return of_one
        names = (ex.TIME, *map(ex.Symbol, self.system.coordinates))
        others = [name for name in names if any(ex.holds(slope, name) for slope in known.values())]
        arguments = tuple(dict.fromkeys([*others, *known]))
        slopes = tuple(map(known.get, arguments))
        return tm.terms_of(ex.Integral(next(self.names), arguments, (0,) * len(arguments), slopes))

    def _function_of_one(self, known: Mapping[modular.Variable, ex.Expression]) -> tm.Terms | None:
        """c G(w) with these derivatives, where all unknown functions in them have one argument w,
        a formula of several variables, and they are c g(w) times the gradient of w: G' = g.
        """
        moving: list[ex.Symbol | ex.Velocity] = [ex.TIME]
        moving += (
            kind(name) for name in self.system.coordinates for kind in (ex.Symbol, ex.Velocity)
        )
        functions = dict[ex.Expression, ex.Expression]()  # and their values at the letter
        letter = ex.Symbol(next(self._letters()))
        arguments = set[tuple[ex.Expression, ...]]()
        for node in ex.distinct_nodes(known.values()):
            if type(node) is ex.Arbitrary and ex.holds(node, *moving):
                functions[node] = ex.Arbitrary(node.name, (letter,), node.orders)
                arguments.add(node.arguments)
        whole = next(iter(arguments)) if len(arguments) == 1 else ()
        if len(whole) != 1 or sum(ex.holds(whole[0], name) for name in moving) < 2:
            return None
        (w,) = whole
        rates = {q: calculus.differentiate(w, q) for q in known}
        place = next((q for q in known if rates[q] != ex.ZERO), None)
        if place is None:
            return None
        with suppress(tm.TooManyTerms):
            for power in _DIVIDED:
                rate = self.in_normal_form(tm.terms_of(known[place] / rates[place] * w**-power))
                if not rate:
                    return None
                content, common, primitive = tm.split_content(rate)
                own = frozenset(item for item in common if ex.holds(item[0], *functions))
                outer = content * tm.monomial_tree(common - own)
                inner = primitive * tm.monomial_tree(own)
                slope = ex.substitute(inner, functions) * letter**power
                if ex.holds(outer, *known) or ex.holds(slope, *moving):
                    continue
                left = (known[q] - outer * inner * w**power * rates[q] for q in known)
                if all(is_zero(tm.terms_of(tree)) for tree in left):
                    name = next(self.names)
                    found = ex.Integral(name, (w,), (0,), (slope,), letter.name)
                    return tm.terms_of(outer * found)
        return None

    def _letters(self) -> Iterator[str]:
        """Unused names for the variable of a function."""
        used = {*self.system.names.declared(), *self.system.functions}
        every = (*_LETTERS, *(f"u_{k}" for k in range(1, 1_000)))
        yield from (name for name in every if name not in used)

    def exponential(self, logarithm: tm.Terms) -> tm.Terms:
        """exp of a sum: c log(u) with constant c gives u^c, or (-u)^c if u is negative at the real
        point.
        """
        product: tm.Terms = dict(ONE_TERM)
        varying = [ex.TIME, *map(ex.Symbol, self.system.coordinates)]
        coefficients: dict[ex.Apply, tm.Terms] = {}
        rest = tm.Terms()
        for key, value in logarithm.items():
            log = next(
                (p for p, e in key if isinstance(p, ex.Apply) and p.function == "log" and e == 1),
                None,
            )
            if log is None:
                rest[key] = value
            else:
                coefficients.setdefault(log, {})[key - {(log, Fraction(1))}] = value
        exponents: dict[ex.Expression, tm.Terms] = {}
        for log, coefficient in coefficients.items():
            if any(
                tm.depends_on(coefficient, name) for name in varying
            ):  # x^2/(x^2 + 1) + 1/(x^2 + 1) is 1
                coefficient = self.in_normal_form(coefficient)
            if any(tm.depends_on(coefficient, name) for name in varying):
                rest = tm.add_terms(rest, tm.multiply_by(coefficient, tm.monomial(log)))
            else:
                exponents[log.argument] = coefficient
        groups: dict[ex.Expression, list[ex.Expression]] = {}
        for base, exponent in exponents.items():
            groups.setdefault(tm.tree_of(exponent), []).append(mt.positive_form(base, self.table))
        for power, bases in groups.items():
            together = tm.collected(
                ex.multiply(*bases)
            )  # sqrt(1 - x^2) for sqrt(1 - x) sqrt(1 + x)
            is_root = isinstance(power, ex.Number) and power.value.denominator > 1
            shorter = is_root and ex.node_count(together) < ex.node_count(ex.multiply(*bases))
            for base in [together] if shorter else bases:
                product = tm.multiply_terms(product, tm.terms_of(base**power))
        return (
            tm.multiply_terms(product, tm.terms_of(ex.Apply("exp", tm.tree_of(rest))))
            if rest
            else product
        )

    def linear_terms(self, wanted: Sequence[tm.Terms]) -> tm.Terms | None:
        """A_i v_i - V with these Euler-Lagrange expressions, one for each coordinate; None if none
        is found.
        """
        names = self.system.coordinates
        symbols = [ex.Symbol(name) for name in names]
        # An expression may be affine in the velocities only after simplification by relations among
        # generators.
        velocities = list(map(ex.Velocity, names))
        rest = [
            self.in_normal_form(w) if tm.affine_parts(w, velocities) is None else w for w in wanted
        ]
        total = tm.Terms()
        for i, j in combinations(range(len(names)), 2):
            magnetic = _round_potential(names, rest, i, j)
            if magnetic is not None:
                total = tm.add_terms(total, tm.terms_of(magnetic))
                own = expressions_without_acceleration(names, tm.terms_of(magnetic))
                rest = [
                    self.in_normal_form(tm.add_terms(w, part, -1))
                    for w, part in zip(rest, own, strict=True)
                ]
        fields: dict[tuple[int, int], tm.Terms] = {}
        slopes = list[tm.Terms]()
        for i, terms in enumerate(rest):
            parts = tm.affine_parts(terms, velocities)
            if parts is None:
                return None
            slopes.append(parts[0])
            fields |= {(i, j): part for j, part in enumerate(parts[1]) if part}
        if not all(
            is_zero(tm.add_terms(field, fields.get((j, i), {}))) for (i, j), field in fields.items()
        ):
            return None
        # What is 0 although its terms do not say so would become a total derivative, and where it
        # occurs, the rest is as long.
        slopes = [
            self.in_normal_form(one) if (i, i) in fields else one for i, one in enumerate(slopes)
        ]
        fields = {(i, j): field for (i, j), field in fields.items() if i != j}
        # Keep one of two forms of the same field, such as (2 + sqrt(5))^(1/3) and (1 + sqrt(5))/2.
        fields = {
            (i, j): tm.scaled(fields[j, i], -1) if (j, i) in fields and i > j else f
            for (i, j), f in fields.items()
        }
        potential = self._vector_potential(fields, slopes)
        if potential is None:
            return None
        for i, a in potential.items():
            total = tm.add_terms(total, tm.multiply_by(a, tm.monomial(ex.Velocity(names[i]))))
            if tm.depends_on(a, ex.TIME):
                slopes[i] = tm.add_terms(slopes[i], tm.derivative_of_terms(a, ex.TIME), -1)
        scalar = self.function_of(symbols, slopes)
        return None if scalar is None else tm.add_terms(total, scalar, -1)

    def _vector_potential(
        self, fields: dict[tuple[int, int], tm.Terms], slopes: Sequence[tm.Terms]
    ) -> dict[int, tm.Terms] | None:
        """A_i with d_j A_i - d_i A_j = fields[i, j] and the symmetries of `slopes`, the other
        terms.

        A constant field is integrated along rays if the forces are invariant or coupled. Else one
        coordinate q_k at a time is finished: fields[i, k] is integrated over q_k for each i, which
        gives a part of A_i, and the slopes of this part are subtracted from the other fields. The
        coordinate on which most fields depend comes first, so that cyclic ones stay cyclic.
        """
        symbols = [ex.Symbol(name) for name in self.system.coordinates]
        ordered = sorted(pair for pair in fields if pair[0] < pair[1])
        coupled = bool(ordered) and all(tm.depends_on(slopes[i], symbols[j]) for i, j in ordered)
        turned = all(_is_turned(symbols, slopes, [pair]) for pair in ordered)
        if coupled or turned or _is_turned(symbols, slopes, ordered):
            radial = _along_rays(fields, symbols)
            if radial is not None:
                return radial
        found, done = dict[int, tm.Terms](), set[int]()
        rest = {pair: dict(terms) for pair, terms in fields.items()}
        while rest := {pair: terms for pair, terms in rest.items() if terms and not is_zero(terms)}:
            held = {
                k: sum(tm.depends_on(terms, q) for terms in rest.values())
                for k, q in enumerate(symbols)
            }
            order = sorted({j for pair in rest for j in pair}, key=lambda k: (-held[k], k))
            for k in (
                *order,
                order[0],
            ):  # the first one under an integral sign if all leave something
                parts = {i: self.integral(rest[i, k], symbols[k]) for i, j in rest if j == k}
                if not any(left for _, left in parts.values()):
                    break
            if not self.integral_signs and any(left for _, left in parts.values()):
                return None
            for i, (part, left) in parts.items():
                if left:
                    part = tm.add_terms(part, self.named_integral({symbols[k]: tm.tree_of(left)}))
                found[i] = tm.add_terms(found.get(i, {}), part)
                for m in range(len(symbols)):
                    if m == k:
                        rest[i, k], rest[k, i] = {}, {}
                    elif m != i and (slope := tm.derivative_of_terms(part, symbols[m])):
                        rest[i, m] = tm.add_terms(rest.get((i, m), {}), slope, -1)
                        rest[m, i] = tm.add_terms(rest.get((m, i), {}), slope)
            done.add(k)
            # A field with sources (d_i F_jk + d_j F_ki + d_k F_ij != 0) depends on finished
            # coordinates.
            if any(done & {*pair} and not is_zero(terms) for pair, terms in rest.items()):
                return None
            rest = {pair: terms for pair, terms in rest.items() if not done & {*pair}}
        return found


def expressions_without_acceleration(names: Sequence[str], terms: tm.Terms) -> list[tm.Terms]:
    """v_j L_(v_i q_j) + L_(v_i t) - L_(q_i) for each i."""
    found = []
    for name in names:
        deadline.check()
        momentum = tm.derivative_of_terms(terms, ex.Velocity(name))
        rate = mt.rate_at_constant_velocity(momentum, map(ex.Symbol, names))
        total = tm.add_terms(rate, tm.derivative_of_terms(terms, ex.Symbol(name)), -1)
        found.append(in_one_square(total))
    return found


def _round_potential(
    names: Sequence[str], wanted: Sequence[tm.Terms], i: int, j: int
) -> ex.Expression | None:
    """A(s) (x y' - y x') for the terms B y' of E_x, -B x' of E_y if B depends on x and y only
    through s = x^2 + y^2.

    It is regular where B is: B = -2 (s A)', and s A is the integral of -x B over x at y = 0, from
    the axis if possible.
    """
    x, y, v, w = (
        ex.Symbol(names[i]),
        ex.Symbol(names[j]),
        ex.Velocity(names[i]),
        ex.Velocity(names[j]),
    )
    field = tm.coefficient(wanted[i], tm.monomial(w))
    if (
        not field
        or not _is_round(field, x, y)
        or tm.add_terms(field, tm.coefficient(wanted[j], tm.monomial(v)))
    ):
        return None
    square, s = x**2 + y**2, ex.Symbol("a square")
    turn, beside = y * v - x * w, ex.substitute(tm.tree_of(field), {y: ex.ZERO})
    even = ex.substitute(beside, {x**2: s})
    is_even = not ex.holds(even, x)
    letter, slope = (s, ex.HALF * even) if is_even else (x, x * beside)
    flux = primitive_of_monomials(letter, tm.terms_of(slope))
    if flux is None:
        return None
    if is_even:
        from_axis = writing.quotient(
            (flux - ex.substitute(flux, {s: ex.ZERO})) / s, exact_field.Budget.short()
        )
        if ex.ZERO not in ex.walk(ex.substitute(from_axis, {s: ex.ZERO})):
            return ex.substitute(from_axis, {s: square}) * turn
    table = {
        x**2: square,
        ex.Apply("log", x): ex.HALF * ex.Apply("log", square),
        x: ex.square_root(square),
        s: square,
    }
    return ex.substitute(flux, table) * square**-1 * turn


def _is_round(field: tm.Terms, x: ex.Symbol, y: ex.Symbol) -> bool:
    """Whether the field depends on x^2 + y^2, and on x and y only through it: x B_y = y B_x."""
    slopes = [tm.derivative_of_terms(field, variable) for variable in (x, y)]
    turned = [
        tm.multiply_by(slope, tm.monomial(q)) for slope, q in zip(slopes, (y, x), strict=True)
    ]
    return bool(slopes[0]) and turned[0] == turned[1]


def _outside(slope: tm.Terms, variable: modular.Variable) -> list[tuple[tm.Terms, tm.Terms]]:
    """(c, g) with slope = sum of c g; c is free of the variable, g has no other factors, no two c
    are multiples.
    """
    pairs: list[tuple[tm.Terms, tm.Terms]] = []
    for key, beside in tm.grouped(slope, lambda letter: ex.holds(letter, variable)).items():
        for known, inner in pairs:
            ratios = (
                {beside[one] / known[one] for one in known}
                if known.keys() == beside.keys()
                else set()
            )
            if len(ratios) == 1:
                inner[key] = ratios.pop()
                break
        else:
            pairs.append((beside, {key: Fraction(1)}))
    return pairs


def _is_closed(variables: Sequence[modular.Variable], slopes: Sequence[tm.Terms]) -> bool:
    """Whether the mixed derivatives agree."""
    for (p, one), (q, other) in combinations(zip(variables, slopes, strict=True), 2):
        turning = tm.add_terms(tm.derivative_of_terms(one, q), tm.derivative_of_terms(other, p), -1)
        if not is_zero(turning):
            return False
    return True


def is_zero(terms: tm.Terms) -> bool:
    """Whether the sum vanishes, possibly by relations among its generators: tested at random
    points.
    """
    if len(terms) < 2:
        return not terms
    try:
        return real_branch.vanishes(tm.tree_of(terms))
    except errors.InputError:
        return False


def power_rule(own: tm.Monomial, beside: tm.Terms, x: modular.Variable) -> tm.Terms | None:
    """The integral of own * beside over x if the integrand is a power of x, or c u^e du/dx with u^e
    = own.
    """
    if not own:
        total, logarithm = tm.Terms(), tm.monomial(ex.Apply("log", x))
        for key, value in beside.items():
            e, raised = tm.exponent_of(key, x), tm.times(key, tm.monomial(x))
            total[tm.times(raised, logarithm) if e == -1 else raised] = (
                value if e == -1 else value / (e + 1)
            )
        return total
    if len(own) != 1:
        return None
    ((u, e),) = own
    if isinstance(u, ex.Sum) and (whole := tm.monomial_factor(beside, tm.terms_of(u))) is not None:
        beside, e = whole, e + 1  # x/(x - y)^3 - y/(x - y)^3
    factor = tm.monomial_factor(beside, tm.letter_derivative(u, x))
    if factor is None or tm.depends_on(factor, x) or ex.is_exponential(u):
        return None
    raised = tm.monomial(ex.Apply("log", u)) if e == -1 else frozenset([(u, e + 1)])
    return tm.multiply_terms(factor, {raised: Fraction(1) if e == -1 else 1 / (e + 1)})


def _is_turned(
    symbols: Sequence[ex.Symbol], slopes: Sequence[tm.Terms], pairs: Sequence[tuple[int, int]]
) -> bool:
    """Whether the potential is invariant when these pairs of coordinates are rotated, or scaled one
    up, one down.
    """

    def moment(slope: int, arm: int) -> tm.Terms:
        return tm.multiply_by(slopes[slope], tm.monomial(symbols[arm]))

    turning = tm.weighted_sum(
        part for i, j in pairs for part in ((moment(j, i), 1), (moment(i, j), -1))
    )
    scaling = tm.weighted_sum(
        part for i, j in pairs for part in ((moment(i, i), 1), (moment(j, j), -1))
    )
    return is_zero(turning) or is_zero(scaling)


def _along_rays(
    fields: dict[tuple[int, int], tm.Terms], symbols: Sequence[ex.Symbol]
) -> dict[int, tm.Terms] | None:
    """A_i = q_j int_0^1 s F_ij(s q) ds of constant fields (Poincare's homotopy); None for other
    fields.
    """
    if any(tm.depends_on(terms, symbol) for terms in fields.values() for symbol in symbols):
        return None
    found: dict[int, tm.Terms] = {}
    for (i, j), terms in fields.items():
        part = tm.multiply_by(terms, tm.monomial(symbols[j]), factor=_HALF)
        found[i] = tm.add_terms(found.get(i, {}), part)
    return found
