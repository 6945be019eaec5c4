"""Formulas as people write them: every function returns an equal tree, a shorter one where it finds
one.

Of elements of a ring and of products (`readable` and what follows): a term for each product of
velocities, tan for sin/cos, joined sums.

Of whole trees (`simplified`): collected or as one factored quotient, whichever is smaller.
`square_forms` writes sums of squares.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, permutations, product
from math import isqrt

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import (
    collecting,
    functions,
    printing,
    terms as tm,
    tree as ex,
)
from inverse_service.field import exact_field, real_branch

Power = tuple[ex.Expression, Fraction]
_MOST_PRODUCTS = 64
# Terms of a quotient that is still made shorter, which takes 1 ms a term; a longer one is not read
# by people.
_MOST_TERMS = 200
# Terms met on the way (`Budget`) in one quotient, and in exact work on one tree among many.
_WORK, _WORK_ON_ONE = 150_000, 20_000
# Different sums as divisors of a tree that is still written as one quotient.
_MOST_DIVISORS = 8
# A divisor up to this stays before a bracket where decimal numbers were typed: (x'^2 + y'^2)/2.
_PLAIN_DIVISOR = 4


def readable(ring: exact_field.ExactRing, element: exact_field.Quotient) -> ex.Expression:
    """The element as one quotient, or as a sum over the products of velocities, whichever is
    shorter.
    """
    if len(element.numerator) > _MOST_TERMS:
        return exact_field.quotient_tree(ring, element)
    whole = _in_order(joined(exact_field.quotient_tree(ring, element)))
    parts = velocity_parts(ring, element)
    if len(parts) < 2:
        return whole
    apart = ex.add(*(_in_order(joined(exact_field.quotient_tree(ring, part))) for part in parts))
    return min([apart, whole], key=ex.node_count)


def velocity_parts(
    ring: exact_field.ExactRing, element: exact_field.Quotient
) -> list[exact_field.Quotient]:
    """The parts with the same powers of all velocities in the numerator, the highest powers
    first.
    """
    places = [index for index, tree in ring.trees.items() if isinstance(tree, ex.Velocity)]
    parts = element.parts(places)
    return [parts[powers] for powers in sorted(parts, key=lambda powers: (-sum(powers), powers))]


def joined(tree: ex.Expression) -> ex.Expression:
    """The tree with sin(u)^k cos(u)^-k as tan(u)^k, and u^k w^k as (u w)^k where the product of the
    sums is shorter.

    Roots are put together where both radicands are positive on the whole line, powers with letters
    in the exponent where u and w are nowhere both negative: the domain stays what it is.
    """
    inner = ex.rebuild(tree, joined)
    if not isinstance(inner, ex.Product):
        return inner
    inner = _with_one_exponent(inner)
    if not isinstance(inner, ex.Product):
        return inner
    table: dict[ex.Expression, Fraction] = {}
    for base, exponent in map(_power_of, inner.factors):
        table[base] = table.get(base, Fraction(0)) + exponent
    while found := next(_replacements(table), None):
        left, right, both = found
        table = {
            both if base == left else base: value for base, value in table.items() if base != right
        }
    return ex.multiply(*(base**exponent for base, exponent in table.items()))


def _with_one_exponent(tree: ex.Product) -> ex.Expression:
    """The product with (1 - t^2)^a for (1 - t)^a (1 + t)^a, and (1 - t)^(a - 1) for
    -(1 - t)^a/(t - 1), a with letters.
    """
    powers = [
        factor
        for factor in tree.factors
        if isinstance(factor, ex.Power) and not isinstance(factor.exponent, ex.Number)
    ]
    for one, whole in product(powers, tree.factors):
        match whole:
            case ex.Power(ex.Sum() as base, ex.Number(k)) if k.denominator == 1:
                sign = 1 if base == one.base else -1
                if sign == 1 or collecting.collect(base + one.base) == ex.ZERO:
                    rest = (factor for factor in tree.factors if factor not in (one, whole))
                    power = one.base ** collecting.collect(one.exponent + whole.exponent)
                    found = ex.multiply(ex.number(Fraction(sign) ** k.numerator), *rest, power)
                    return _with_one_exponent(found) if isinstance(found, ex.Product) else found
    for one, other in combinations(powers, 2):
        if one.exponent == other.exponent and _are_complementary(one.base, other.base):
            product_of_both = ex.multiply(one.base, other.base)
            whole = min(product_of_both, collecting.collect(product_of_both), key=ex.node_count)
            rest = (factor for factor in tree.factors if factor not in (one, other))
            found = ex.multiply(*rest, whole**one.exponent)
            if ex.node_count(found) < ex.node_count(tree):
                return _with_one_exponent(found) if isinstance(found, ex.Product) else found
    return tree


def _are_complementary(one: ex.Expression, other: ex.Expression) -> bool:
    """Whether a one + b other is a positive number for positive numbers a and b, both affine in
    one symbol, so that nowhere both are negative.
    """
    terms = [tm.terms_of(base) for base in (one, other)]
    slopes = [[key for key in part if key] for part in terms]
    if [len(keys) for keys in slopes] != [1, 1] or slopes[0] != slopes[1]:
        return False
    first = slopes[0][0]
    ((letter, exponent), *rest) = first
    if rest or exponent != 1 or not isinstance(letter, ex.Symbol):
        return False
    (a, b), (c, d) = ((part.get(tm.EMPTY, Fraction(0)), part[first]) for part in terms)
    return b * d < 0 and a * abs(d) + c * abs(b) > 0


def _replacements(
    table: Mapping[ex.Expression, Fraction],
) -> Iterator[tuple[ex.Expression, ex.Expression, ex.Expression]]:
    bases = [base for base in table if isinstance(base, ex.Apply | ex.Sum)]
    for (k, one), (j, other) in permutations(enumerate(bases), 2):
        # The product of two sums is the same in both orders.
        both = _both(table, one, other) if k < j or not isinstance(one, ex.Sum) else None
        if both is not None:
            yield one, other, both


def _both(
    table: Mapping[ex.Expression, Fraction], one: ex.Expression, other: ex.Expression
) -> ex.Expression | None:
    """A replacement of both bases, with the exponent of the first; None where no replacement is
    shorter.
    """
    match one, other:
        case [ex.Apply(above, argument), ex.Apply(below, same)] if (
            argument == same and (above, below) in functions.QUOTIENTS
        ):
            fits = table[one] == -table[other] and table[one] > 0
            found: ex.Expression = ex.Apply(functions.QUOTIENTS[above, below], argument)
        case [ex.Sum(left), ex.Sum(right)] if (
            table[one] == table[other] and len(left) * len(right) <= _MOST_PRODUCTS
        ):
            found = collecting.terms_tree(
                sorted(
                    collecting.expand(one * other),
                    key=lambda term: -sum(exponent for _, exponent in term[0]),
                )
            )
            is_shorter = isinstance(found, ex.Sum) and len(found.terms) < len(left) + len(right) - 1
            fits = is_shorter and (
                table[one].denominator == 1 or all(map(real_branch.is_positive, (one, other)))
            )
        case _:
            return None
    return found if fits and found not in table else None


def _in_order(tree: ex.Expression) -> ex.Expression:
    """Numbers and symbols of each product first, then functions, then velocities."""
    inner = ex.rebuild(tree, _in_order)
    return (
        ex.multiply(*sorted(inner.factors, key=_place)) if isinstance(inner, ex.Product) else inner
    )


def with_products_in_order(
    tree: ex.Expression,
    constants: Sequence[ex.Symbol],
    momenta: Collection[ex.Symbol] = (),
    kept: Container[ex.Expression] = (),
) -> ex.Expression:
    """Products as people write them: exp(c t), constants as given, coordinates, functions,
    brackets, velocities.

    Functions and brackets that hold velocities, or momenta, come last. Parts that are `kept` stay
    as they are.
    """
    places = {symbol: place for place, symbol in enumerate(constants)}

    def place(factor: ex.Expression) -> tuple[int, int]:
        base, _ = _power_of(factor)
        held = [
            node
            for node in ex.walk(base)
            if isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary)
        ]
        moving = any(isinstance(node, ex.Velocity) or node in momenta for node in held)
        if not held:
            return 0, 0
        match base:
            case ex.Apply("exp") if ex.TIME in held:
                return 1, 0
            case ex.Symbol() | ex.Sum() | ex.Power() if all(node in places for node in held):
                return 2, min(places[node] for node in held if isinstance(node, ex.Symbol))
            case ex.Symbol() | ex.Velocity():
                return 6 if moving else 3, 0
        return 7 if moving else 5 if isinstance(base, ex.Sum) else 4, 0

    def ordered(part: ex.Expression) -> ex.Expression:
        inner = part if part in kept else ex.rebuild(part, ordered)
        return (
            ex.multiply(*sorted(inner.factors, key=place))
            if isinstance(inner, ex.Product)
            else inner
        )

    return ordered(tree)


def _key_of(node: ex.Sum) -> frozenset[tuple[ex.Expression, int]]:
    return frozenset(Counter(node.terms).items())  # u + u is not u


@lru_cache(maxsize=32)
def _sums_of(
    models: tuple[ex.Expression, ...],
) -> dict[frozenset[tuple[ex.Expression, int]], ex.Sum]:
    """The sums of the models by their terms; kept, since a document orders hundreds of formulas."""
    return {_key_of(node): node for node in ex.distinct_nodes(models) if isinstance(node, ex.Sum)}


def with_sums_as_in(tree: ex.Expression, models: Sequence[ex.Expression]) -> ex.Expression:
    """The tree with each sum that a model has as the model has it: (u - 1)^2 for (-u + 1)^2 beside
    u - 1 too.
    """

    sums = _sums_of(tuple(models))

    def ordered(part: ex.Expression) -> ex.Expression:
        part = ex.rebuild(part, ordered)
        match part:
            case ex.Sum():
                return sums.get(_key_of(part), part)
            case ex.Power(ex.Sum(terms) as base, ex.Number(value)) if value % 2 == 0:
                turned = ex.add(*map(ex.negated, terms))
                return ex.Power(
                    sums.get(_key_of(turned), base) if isinstance(turned, ex.Sum) else base,
                    part.exponent,
                )
            case ex.Product() | ex.Power():
                return other_side(part, ex.factors_of(part))
            case _:
                return part

    def other_side(part: ex.Expression, factors: Sequence[ex.Expression]) -> ex.Expression:
        """c/(a - b) for -c/(b - a) where a - b is in a model; also -c/(a - b) for c/(b - a) where
        the tree has both.
        """
        for place, factor in enumerate(factors):
            base, exponent = _power_of(factor)
            if (
                isinstance(base, ex.Sum)
                and exponent.numerator % 2
                and exponent.denominator == 1
                and (exponent < 0 or is_negative(part))
            ):
                other = ex.add(*map(ex.negated, base.terms))
                key = _key_of(other) if isinstance(other, ex.Sum) else frozenset()
                known = sums.get(key) if is_negative(part) or key in _sums_of((tree,)) else None
                if known and _key_of(base) not in sums:
                    rest = ex.multiply(*factors[:place], known**exponent, *factors[place + 1 :])
                    return ex.negate(rest)
        return part

    return ordered(tree) if sums else tree


def with_one_coefficient(tree: ex.Expression, letters: Collection[ex.Expression]) -> ex.Expression:
    """(p^2 + q^2)/(2 m) for p^2/(2 m) + q^2/(2 m): squares with letters in one bracket.

    Beside a sum, other factors of a square go into the bracket too: (A + C) (p^2 + sin(u)^2 q^2).
    """
    groups = dict[ex.Expression, list[ex.Expression]]()
    for term in ex.summands(tree):
        factors = ex.factors_of(term)
        squares = [
            f
            for f in factors
            if isinstance(f, ex.Power) and f.exponent == ex.TWO and ex.holds(f, *letters)
        ]
        sums = [f for f in factors if isinstance(f, ex.Sum)]
        outside = [
            f
            for f in factors
            if f in sums or isinstance(f, ex.Number) or not (sums or f in squares)
        ]
        coefficient = ex.multiply(*outside)
        plain = (
            len(squares) != 1
            or isinstance(coefficient, ex.Number)
            or ex.holds(coefficient, *letters)
        )
        inside = term if plain else ex.multiply(*(f for f in factors if f not in outside))
        groups.setdefault(ex.ONE if plain else coefficient, []).append(inside)
    return ex.add(*(coefficient * ex.add(*parts) for coefficient, parts in groups.items()))


def _power_of(factor: ex.Expression) -> tuple[ex.Expression, Fraction]:
    match factor:
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 or isinstance(base, ex.Sum):
            return base, value
        case _:
            return factor, Fraction(1)


def _place(factor: ex.Expression) -> int:
    base, _ = _power_of(factor)
    return 2 if isinstance(base, ex.Velocity) else 1 if isinstance(base, ex.Apply) else 0


def quotient(
    tree: ex.Expression,
    budget: exact_field.Budget,
    symbols: Sequence[ex.Symbol | ex.Velocity] | None = None,
) -> ex.Expression:
    """The tree over one denominator, both factored, all relations used; as it is where that is too
    large.

    `symbols` are its variables in the order used for polynomials; by default those that occur in
    it.
    """
    try:
        return exact_field.shortest_tree(*_in_ring(tree, budget, symbols))
    except (exact_field.TooLarge, ZeroDivisionError, KeyError, errors.IrreducibleAtoms):
        return tree


def _in_ring(
    tree: ex.Expression,
    budget: exact_field.Budget,
    symbols: Sequence[ex.Symbol | ex.Velocity] | None = None,
) -> tuple[exact_field.ExactRing, exact_field.Quotient]:
    """The tree as an element of the ring of its formulas."""
    if symbols is None:
        nodes = ex.distinct_nodes((tree,))
        symbols = [node for node in nodes if isinstance(node, ex.Symbol | ex.Velocity)]
    ring = exact_field.exact_ring([tree], symbols, None, budget, unused="kept")
    return ring, ring.value(tree)


def shorten(
    tree: ex.Expression,
    budget: exact_field.Budget,
    symbols: Sequence[ex.Symbol | ex.Velocity] | None = None,
    cost: Callable[[ex.Expression], int] = ex.node_count,
) -> ex.Expression:
    """The cheapest of the tree as it is, multiplied out, and as one factored quotient."""
    return min((tree, collecting.collect(tree), quotient(tree, budget, symbols)), key=cost)


def collected_inside(
    tree: ex.Expression, cost: Callable[[ex.Expression], int] = ex.node_count
) -> ex.Expression:
    """Every sum collected by itself where that makes it cheaper."""
    tree = ex.rebuild(tree, lambda part: collected_inside(part, cost))
    return min(tree, collecting.collect(tree), key=cost) if isinstance(tree, ex.Sum) else tree


@lru_cache(maxsize=1024)
def as_one_quotient(tree: ex.Expression) -> ex.Expression:
    """The tree as one exact quotient, roots and trigonometric functions reduced; as it is where
    that is too large.
    """
    try:
        return readable(*_in_ring(tree, exact_field.Budget(work=_WORK)))
    except (exact_field.TooLarge, ZeroDivisionError):
        return tree


def much_shorter(tree: ex.Expression) -> ex.Expression:
    """A long tree, as one that was multiplied out, in the form of `as_one_quotient` where that has
    at most half of the nodes.
    """
    size = ex.node_count(tree)
    return (
        other
        if size > bounds.NODES
        and not has_many_divisors(tree)
        and 2 * ex.node_count(other := as_one_quotient(tree)) <= size
        else tree
    )


def has_many_divisors(tree: ex.Expression) -> bool:
    """Whether the tree has so many different sums as divisors that one quotient would be longer:
    the force on one of ten bodies has nine, their potential 45.
    """
    divisors = set[ex.Expression]()
    for node in ex.distinct_nodes([tree]):
        if (
            isinstance(node, ex.Power)
            and isinstance(node.exponent, ex.Number)
            and node.exponent.value < 0
        ):
            base = node.base
            while isinstance(base, ex.Power):  # 1/(u^(3/2)) divides by u
                base = base.base
            divisors |= {base} if isinstance(base, ex.Sum) else set()
    return len(divisors) > _MOST_DIVISORS


# Signs and numbers of a finished formula.


def one_square(tree: ex.Expression) -> ex.Expression:
    """a sin(u)^2 for a - a cos(u)^2 in each sum, a cos(u)^2 for a - a sin(u)^2, and a for
    a sin(u)^2 + a cos(u)^2; likewise for cosh(u)^2 - sinh(u)^2 = 1.
    """
    if not any(isinstance(node, ex.Apply) for node in ex.distinct_nodes([tree])):
        return tree
    tree = ex.rebuild(tree, one_square)
    while (joined := _with_squares_joined(tree)) != tree:
        tree = joined
    return tree


def _with_squares_joined(tree: ex.Expression) -> ex.Expression:
    """One pass of `one_square` over the terms: f^2 = a + b g^2."""
    terms = list(ex.summands(tree))
    places = {term: k for k, term in enumerate(terms)} if len(terms) > 1 else {}
    for term, k in list(places.items()):
        for base, exponent in ex.powers_of(term) if term in places else ():
            if isinstance(base, ex.Apply) and base.function in functions.SQUARES and exponent == 2:
                name, a, b = functions.SQUARES[base.function]
                other = ex.Apply(name, base.argument) ** 2
                before = ex.multiply(*(part for part in ex.factors_of(term) if part != base**2))
                joins = {-a * before: b * before * other, -b * before * other: a * before}
                partner = next((one for one in joins if one in places), None)
                if partner is not None:
                    terms[k] = joins[partner]
                    terms[places.pop(partner)] = ex.ZERO
                    del places[term]
                    break
    return ex.add(*terms) if len(places) < len(terms) else tree


def turned(tree: ex.Expression) -> ex.Expression:
    """-(a - b) c as (b - a) c."""
    match tree:
        case ex.Product((ex.Number(value), *rest)) if value < 0:
            place = next((k for k, factor in enumerate(rest) if isinstance(factor, ex.Sum)), None)
            if place is not None:
                return ex.multiply(
                    ex.number(-value), *rest[:place], ex.negated(rest[place]), *rest[place + 1 :]
                )
    return tree


def minus_inside(tree: ex.Expression, others: Sequence[ex.Expression] = ()) -> ex.Expression:
    """Each term -(a - b) c of a sum as (b - a) c, -c/(a - b) as c/(b - a); likewise where more
    terms are negative.

    Not where a - b is in a term that is not negative, too.
    """
    if isinstance(tree, ex.Sum):
        return ex.add(
            *(
                minus_inside(term, [one for one in tree.terms if not is_negative(one)])
                for term in tree.terms
            )
        )
    match tree:
        case ex.Product((ex.Number(value), *factors)) if value < 0:
            for place, factor in enumerate(factors):
                base, exponent = (
                    (factor.base, factor.exponent)
                    if isinstance(factor, ex.Power)
                    else (factor, ex.ONE)
                )
                is_kept = any(ex.holds(other, base) for other in others)
                if not isinstance(base, ex.Sum) or is_kept or not _is_half_negative(base):
                    continue
                if isinstance(exponent, ex.Number) and exponent.value % 2 == 1:
                    turned = (
                        ex.add(*sorted(map(ex.negate, base.terms), key=is_negative)) ** exponent
                    )
                    return ex.multiply(
                        ex.number(-value), *factors[:place], turned, *factors[place + 1 :]
                    )
    return tree


def roots_upright(tree: ex.Expression) -> ex.Expression:
    """1/sqrt(-a/(b - c)) as sqrt((c - b)/a): no quotient whose denominator is a sum under a root in
    a denominator.
    """
    tree = ex.rebuild(tree, roots_upright)
    match tree:
        case ex.Power(base, ex.Number(e)) if e < 0 and e.denominator > 1:
            powers = ex.powers_of(base)
            if any(isinstance(part, ex.Sum) and k == -1 for part, k in powers):
                negative = any(isinstance(part, ex.Number) and part.value < 0 for part, _ in powers)
                parts = [part if k == -1 else part**-k for part, k in powers]
                if negative:
                    place = next(
                        n
                        for n, (part, k) in enumerate(powers)
                        if isinstance(part, ex.Sum) and k == -1
                    )
                    parts = [
                        ex.negated(part) if n == place else part for n, part in enumerate(parts)
                    ]
                    parts.append(ex.number(-1))
                return ex.multiply(*parts) ** -e
    return tree


def numbers_outside(
    tree: ex.Expression,
    admits: Callable[[ex.Product, ex.Expression], bool] = lambda before, after: True,
) -> ex.Expression:
    """(x^2/2 + 3 y^2/2)/z as (x^2 + 3 y^2)/(2 z): no denominator in a bracket, no minus that all of
    its terms have.

    Under an exponent, only a denominator that all terms have is taken out. A product is written so
    if it and what it becomes are admitted.
    """
    known = dict[ex.Expression, ex.Expression]()

    def outside(part: ex.Expression) -> ex.Expression:
        if part not in known:
            known[part] = _number_outside(ex.rebuild(part, outside), admits)
        return known[part]

    return outside(tree)


def _number_outside(
    tree: ex.Expression, admits: Callable[[ex.Product, ex.Expression], bool]
) -> ex.Expression:
    if not isinstance(tree, ex.Product):
        return tree
    number, factors = Fraction(1), []
    for base, e in ex.powers_of(tree):
        if isinstance(base, ex.Sum) and e.denominator == 1:
            share = _content(base, is_whole=e == 1)
            base = ex.add(*(share * term for term in base.terms))
            number /= share**e.numerator
        factors.append(base**e)
    outside = ex.multiply(ex.number(number), *factors)
    return outside if admits(tree, outside) else tree


def with_sizes(tree: ex.Expression) -> ex.Expression:
    """abs(u)^3 for (u^2)^(3/2)."""
    tree = ex.rebuild(tree, with_sizes)
    match tree:
        case ex.Power(ex.Power(_, ex.Number(two)) as square, ex.Number(value)) if two == 2 and (
            value.denominator == 2 and abs(value) != Fraction(1, 2)
        ):
            return ex.square_root(square) ** value.numerator
    return tree


# Divisors that stay before a bracket with decimal numbers in it, as in (x'^2 - 0.1 x^2)/2.
_OUTSIDE = (1, 2)


def decimals_inside(tree: ex.Expression) -> ex.Expression:
    """19.62 cos(x) + x'^2/2 for (981 cos(x) + 25 x'^2)/50 where decimal numbers were typed."""
    if not printing.prints_decimals():
        return tree
    tree = ex.rebuild(tree, decimals_inside)
    match tree:
        case ex.Product((ex.Number(value), *factors)) if value.denominator > _PLAIN_DIVISOR:
            sums = [k for k, factor in enumerate(factors) if isinstance(factor, ex.Sum)]
            for k in sums[:1]:
                forms: list[ex.Expression] = [tree]
                for divisor in _OUTSIDE:
                    share = ex.number(value * divisor)
                    inner = ex.add(*(share * term for term in ex.summands(factors[k])))
                    outside = ex.number(Fraction(1, divisor))
                    forms.insert(-1, ex.multiply(outside, *factors[:k], inner, *factors[k + 1 :]))
                return min(forms, key=lambda form: len(printing.to_text(form)))
    return tree


def plain_quotients(tree: ex.Expression) -> ex.Expression:
    """18 (c u v - u^2/3 - v^2/3)/(c^2 - 16) as 6 (u^2 + v^2 - 3 c u v)/(16 - c^2), and (2 u - 4
    v)/6 as (u - 2 v)/3.

    Fractions in a bracket above a line, or that the number in front takes away; minus signs of two
    brackets at once.
    """
    tree = ex.rebuild(tree, plain_quotients)
    if not isinstance(tree, ex.Product):
        return tree
    number = ex.coefficient(tree)
    powers = ex.powers_of(ex.multiply(*tree.factors[isinstance(tree.factors[0], ex.Number) :]))
    sums = {
        k: base.terms
        for k, (base, e) in enumerate(powers)
        if isinstance(base, ex.Sum) and e % 2 == 1
    }
    surplus = {k: 2 * sum(map(is_negative, terms)) - len(terms) for k, terms in sums.items()}
    ordered = iter(sorted(sums, key=lambda k: -surplus[k]))
    for one, other in zip(ordered, ordered, strict=False):
        if surplus[one] + surplus[other] > 0:
            sums |= {k: tuple(map(ex.negate, sums[k][::-1])) for k in (one, other)}
    for k, terms in sums.items():
        share = Fraction(
            math.lcm(*(ex.coefficient(term).denominator for term in terms))
            if powers[k][1] == 1
            else 1
        )
        share = (
            share if number.numerator % share == 0 or min(e for _, e in powers) < 0 else Fraction(1)
        )
        below = number.denominator if powers[k][1] == 1 else 1
        share /= math.gcd(below, *((share * ex.coefficient(term)).numerator for term in terms))
        number /= share
        powers[k] = ex.add(*(share * term for term in terms)), powers[k][1]
    return ex.multiply(ex.number(number), *(base**e for base, e in powers))


def _content(tree: ex.Sum, is_whole: bool) -> Fraction:
    """What makes the coefficients integers without a common factor, if they are not; -1 if all are
    negative.
    """
    found = [ex.coefficient(term) for term in tree.terms]
    below = math.lcm(*(value.denominator for value in found))
    sign = -1 if all(value < 0 for value in found) else 1
    if below == 1 or not (is_whole or all(value.denominator == below for value in found)):
        return Fraction(sign)
    return Fraction(
        sign * below, math.gcd(*(value.numerator for value in found)) if is_whole else 1
    )


def _is_half_negative(tree: ex.Sum) -> bool:
    """Whether most of its terms have a minus sign, or half of them and no number is without one, as
    it is in 1 - mu.
    """
    surplus = 2 * sum(map(is_negative, tree.terms)) - len(tree.terms)
    return surplus > 0 or (
        surplus == 0 and not any(isinstance(t, ex.Number) and t.value > 0 for t in tree.terms)
    )


def is_negative(term: ex.Expression) -> bool:
    return ex.coefficient(term) < 0


def velocities_in(tree: ex.Expression, names: Collection[str]) -> set[str]:
    """The coordinates among `names` whose velocities occur."""
    return {
        node.coordinate
        for node in ex.walk(tree)
        if isinstance(node, ex.Velocity) and node.coordinate in names
    }


def separated(tree: ex.Expression) -> ex.Expression:
    """The tree expanded, exponentials as powers of atoms so that quotients of them cancel."""
    return ex.add(
        *(value * collecting.separate_tree(monomial) for monomial, value in collecting.expand(tree))
    )


@lru_cache(maxsize=512)
def opaque_quotient(tree: ex.Expression) -> ex.Expression:
    """The tree as one factored quotient of polynomials in atoms; as it is where that is too
    large.
    """
    plain = separated(tree)
    if ex.node_count(plain) > bounds.TERMS:
        return tree
    try:
        ring = exact_field.opaque_ring([plain], exact_field.Budget(bounds.TERMS))
        return collecting.merge_powers(exact_field.quotient_tree(ring, ring.value(plain)))
    except (ZeroDivisionError, exact_field.TooLarge):
        return tree


def shortest(forms: Sequence[ex.Expression]) -> ex.Expression:
    """The smallest of some equal trees; of those of the same size the first with the fewest
    terms.
    """
    return min(
        forms,
        key=lambda form: (ex.node_count(form), len(form.terms) if isinstance(form, ex.Sum) else 1),
    )


@lru_cache(maxsize=512)
def simplified(tree: ex.Expression) -> ex.Expression:
    """The shortest of: the tree as it is, collected, as one quotient; with sin^2 = 1 - cos^2 where
    both occur.
    """
    collected, merged = collecting.collect(tree), collecting.merge_powers(tree)
    forms = [collected, merged]
    if _is_monomial(collected):  # as momenta and energies of many masses are
        return shortest(forms)
    forms += [
        opaque_quotient(collected),
        *([opaque_quotient(merged)] if ex.node_count(merged) < ex.node_count(collected) else []),
    ]
    for other in _without_squares(collected):
        forms += [collecting.collect(other), opaque_quotient(other)]
    return shortest(forms)


def related(tree: ex.Expression) -> ex.Expression:
    """A long tree as one quotient, with the relations among its roots and functions used, where
    that is shorter.
    """
    return tree if ex.node_count(tree) <= bounds.NODES else shortest([tree, exact_quotient(tree)])


def exact_quotient(tree: ex.Expression) -> ex.Expression:
    """The tree as one factored quotient in which all relations are used; as it is where that is too
    large.
    """
    return quotient(tree, exact_field.Budget(bounds.EXPANSION, deadline.end(), _WORK_ON_ONE))


def exponentials_above(tree: ex.Expression) -> ex.Expression:
    """exp(-u) for 1/exp(u)."""
    match ex.rebuild(tree, exponentials_above):
        case ex.Power(ex.Apply("exp", argument), ex.Number(value)) if value < 0:
            return ex.Apply("exp", value * argument)
        case ex.Power(ex.Product(factors), ex.Number(value)) if value.denominator == 1:
            return ex.multiply(*(exponentials_above(factor**value) for factor in factors))
        case other:
            return other


def inside(tree: ex.Expression) -> ex.Expression:
    """The tree with each sum that a function is taken of as one quotient, where that is shorter."""
    match ex.rebuild(tree, inside):
        case ex.Apply(_, ex.Sum() as argument) as node:
            shorter = shortest([argument, turned(opaque_quotient(argument))])
            return functions.with_argument(node, shorter)
        case other:
            return other


def _is_monomial(tree: ex.Expression) -> bool:
    factors = ex.factors_of(tree)
    bases = (factor.base if isinstance(factor, ex.Power) else factor for factor in factors)
    return all(isinstance(base, ex.Number | ex.Symbol | ex.Velocity) for base in bases)


def trigonometric(tree: ex.Expression) -> ex.Expression:
    """The tree, or the shortest form of it with sin^2 = 1 - cos^2 where both occur."""
    return shortest([tree, *(opaque_quotient(other) for other in _without_squares(tree))])


@lru_cache(maxsize=512)
def with_shortest_sums(tree: ex.Expression) -> ex.Expression:
    """The tree with each sum in the shortest of three forms: as it is, collected, and grouped by
    functions.

    Functions of angles are first combined where that is shorter: 1 for sin(a)^2 + cos(a)^2,
    cos(a - b) for cos(a) cos(b) + sin(a) sin(b). A power (-a - b)^k of negative terms becomes
    (-1)^k (a + b)^k. Equal to the tree where the bases of its roots are positive: (v^2)^(1/2) is
    expanded as v.
    """
    tree = ex.rebuild(tree, with_shortest_sums)
    match tree:
        case ex.Power(ex.Sum(parts) as base, ex.Number(e)) if e.denominator == 1:
            if all(map(is_negative, parts)):
                return (ex.ONE if e % 2 == 0 else ex.MINUS_ONE) * ex.negated(base) ** e
    if not isinstance(tree, ex.Sum):
        return tree
    try:
        terms = tm.terms_of(tree)
        short = tm.shortest_in_angles(terms) if ex.has(tree, ex.Apply) else terms
        forms = [tree, tm.tree_of(short), _grouped_by_functions(short)]
    except tm.TooManyTerms:
        return tree
    return min(forms, key=ex.node_count)


def _grouped_by_functions(terms: tm.Terms) -> ex.Expression:
    """The sum, grouped by products of functions and velocities, with common factors taken out of
    each coefficient.
    """
    parts = []
    for outer, inner in tm.grouped(terms, lambda letter: not isinstance(letter, ex.Symbol)).items():
        content, common, rest = tm.split_content(inner)
        if len(inner) > 1 and all(value < 0 for value in inner.values()):
            content, rest = -content, ex.negated(rest)
        parts.append(content * tm.monomial_tree(common) * rest * tm.monomial_tree(outer))
    return ex.add(*parts)


def with_cosines(tree: ex.Expression) -> ex.Expression:
    """The tree with 1/cos^2 for 1 + tan^2."""
    match ex.rebuild(tree, with_cosines):
        case ex.Sum(
            (ex.Power(ex.Apply("tan", u), ex.TWO), ex.ONE)
            | (ex.ONE, ex.Power(ex.Apply("tan", u), ex.TWO))
        ):
            return ex.Apply("cos", u) ** -2
        case inner:
            return inner


def _without_squares(tree: ex.Expression) -> Iterator[ex.Expression]:
    """The tree with the squares of sines, and with those of cosines, written by the other
    function.
    """
    nodes = {node for node in ex.walk(tree) if isinstance(node, ex.Apply)}
    for function, other in (("sin", "cos"), ("cos", "sin")):
        both = {
            n.argument
            for n in nodes
            if n.function == function and ex.Apply(other, n.argument) in nodes
        }
        if both:
            yield _squares_replaced(tree, function, other, both)


def _squares_replaced(
    tree: ex.Expression, function: str, other: str, both: Collection[ex.Expression]
) -> ex.Expression:
    known: dict[ex.Expression, ex.Expression] = {}  # parts that occur often are replaced once

    def replaced(part: ex.Expression) -> ex.Expression:
        if part not in known:
            deadline.check(0)
            known[part] = ex.rebuild(part, replaced)
            match known[part]:
                case ex.Power(ex.Apply(name, argument), ex.Number(value)) if (
                    name == function and argument in both
                ):
                    whole = value.numerator // 2 if value.denominator == 1 and value > 1 else 0
                    square = 1 - ex.Apply(other, argument) ** 2
                    known[part] = square**whole * ex.Apply(name, argument) ** (value - 2 * whole)
        return known[part]

    return replaced(tree)


def roots_apart(tree: ex.Expression) -> ex.Expression:
    """The tree with (u w)^r = u^r w^r and (u^a)^r = u^(a r), which is wrong where a factor is
    negative.
    """
    apart = _apart(tree)
    return tree if apart == tree else simplified(apart)


def _apart(tree: ex.Expression) -> ex.Expression:
    match ex.rebuild(tree, _apart):
        case ex.Power(ex.Product(factors), exponent) as inner if not exact_field.is_integer_power(
            inner
        ):
            return ex.multiply(*(_apart(factor**exponent) for factor in factors))
        case ex.Power(ex.Power(base, ex.Number(value)), ex.Number(exponent)):
            return base ** (value * exponent)
        case inner:
            return inner


def cancelled(sign: int, tree: ex.Expression) -> ex.Expression:
    """The tree with sqrt(u^2) = sign u, atan(tan u) = u and log(exp u) = u, which hold on one
    branch only; shorter.
    """
    found = _cancelled(tree, sign)
    return tree if found == tree else simplified(found)


def _cancelled(tree: ex.Expression, sign: int) -> ex.Expression:
    inner = ex.rebuild(tree, lambda part: _cancelled(part, sign))
    match inner:
        case ex.Apply(outer, ex.Apply(function, argument)) if functions.solves(outer, function):
            return argument
        case ex.Power(ex.Product(factors), ex.Number(e)) if e.denominator == 1:
            return ex.multiply(*(factor**e for factor in factors))
        case ex.Power(ex.Product(factors), ex.Number(e)) if e.denominator == 2:
            roots = [_root_of_square(factor) for factor in factors]
            rest = ex.multiply(
                *(factor for factor, root in zip(factors, roots, strict=True) if root is None)
            )
            whole = ex.multiply(ex.number(sign), *(root for root in roots if root is not None))
            return whole**e.numerator * rest**e if any(roots) else inner
        case ex.Power(ex.Power() as square, ex.Number(e)) if e.denominator == 2 and (
            root := _root_of_square(square)
        ):
            return (sign * root) ** e.numerator
        case ex.Power(ex.Sum() as base, ex.Number(e)) if e.denominator == 2 and not isinstance(
            short := opaque_quotient(one_square(base)), ex.Sum
        ):
            return _cancelled(short**e, sign)
        case _:
            return inner


def _root_of_square(factor: ex.Expression) -> ex.Expression | None:
    """u^k for u^(2 k), and the root of the square of a rational number; else None."""
    match factor:
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 and value % 2 == 0:
            return base ** (value / 2)
        case ex.Number(value) if value > 0:
            root = Fraction(isqrt(value.numerator), isqrt(value.denominator))
            return ex.number(root) if root**2 == value else None
    return None


def sign_part(tree: ex.Expression) -> ex.Expression:
    """A short tree with the sign of this one, wherever it is not zero."""
    short = opaque_quotient(collecting.collect(tree))
    signs = [_sign_factor(factor) for factor in ex.factors_of(short)]
    product = ex.multiply(*signs)
    match product:
        case ex.Product((ex.Number(value), ex.Sum(terms))) if value < 0:
            return ex.add(*map(ex.negate, terms))
        case _:
            return shortest([collecting.collect(product), product])


def _sign_factor(factor: ex.Expression) -> ex.Expression:
    match factor:
        case ex.Number(value) if value:
            return ex.ONE if value > 0 else ex.MINUS_ONE
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return base if value % 2 else ex.ONE
        case ex.Power(_, ex.Number()) | ex.Apply("exp", _):
            return ex.ONE
        case _:
            return factor
