"""Expand trees exactly into terms (`expressions.terms`) that equal them wherever they are defined.

A term is a rational number times atoms with rational exponents. These rules apply on the real
domain: x^a x^b = x^(a+b), (u^r)^s = u^(r s) for r odd or fractional (a root means u >= 0), b^e =
exp(e log b), exp(u + w) = exp(u) exp(w), and f(g(u)) = u for inverse functions if it is true for
every u in the domain. sqrt(x^2) is not changed. A power of a sum with an exponent that is not a
positive integer is an atom, so sums are not cancelled against denominators. (`terms.terms_of` also
cancels these, and takes roots of products apart: what it finds may hold on one side of 0 alone.)
Terms are converted back to trees in a fixed order, with powers and exponentials combined.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, TypeVar

from inverse_service import deadline
from inverse_service.expressions import functions, minors, printing, terms as tm, tree as ex
from inverse_service.expressions.terms import Monomial, Terms

T = TypeVar("T", bound=Hashable)

Term = tuple[Monomial, Fraction]
Power = tuple[ex.Expression, Fraction]
Place = tuple[int, str]
MOST_TERMS = 3_000
_LARGEST_EXPONENT = 64
_COMPOSED = (ex.Number, ex.Sum, ex.Product, ex.Power)
# The same parts are expanded repeatedly while one system is solved; large results are not kept.
_KEPT: dict[ex.Expression, Terms] = {}
_MOST_KEPT, _LARGEST_KEPT = 4_096, 64


class _TooLarge(ArithmeticError):
    """The expansion would have more than MOST_TERMS terms, or a huge number."""


def expand(tree: ex.Expression) -> tuple[Term, ...]:
    """The terms of a tree, (monomial, coefficient), in a fixed order.

    A tree that cannot be expanded is one opaque atom.
    """
    try:
        terms = _expand(tree)
    except _TooLarge:
        terms = _atom(tree)
    return tuple(sorted(terms.items(), key=lambda item: order(item[0])))


def forget_expansions() -> None:
    """Empty the table of earlier expansions, so that the next measurement does not profit from
    it.
    """
    _KEPT.clear()


def collect(tree: ex.Expression) -> ex.Expression:
    """The tree with like terms collected: terms_tree(expand(tree))."""
    return terms_tree(expand(tree))


def _expand(tree: ex.Expression) -> Terms:
    """The terms of a tree. Callers must not change them, because the table may return them
    again.
    """
    if isinstance(tree, ex.Number | ex.Symbol | ex.Velocity):
        return _expansion(tree)
    known = _KEPT.get(tree)
    if known is None:
        deadline.check(0)  # checks only the clock: searches count their own work
        known = _expansion(tree)
        if len(known) <= _LARGEST_KEPT:
            if len(_KEPT) >= _MOST_KEPT:
                _KEPT.clear()
            _KEPT[tree] = known
    return known


def _expansion(tree: ex.Expression) -> Terms:
    match tree:
        case ex.Number(value):
            return {tm.EMPTY: value} if value else {}
        case ex.Sum(terms):
            return _sum(map(_expand, terms))
        case ex.Product(factors):
            return _product(map(_expand, factors))
        case ex.Power(base, ex.Number(value)):
            return _raised(_expand(base), value)
        case ex.Power(base, exponent):
            return _exponential(_product([_expand(exponent), _logarithm(_expand(base))]))
        case ex.Apply():
            return _function(tree)
        case ex.Arbitrary(name, arguments, orders) if not isinstance(tree, ex.Integral):
            return _atom(ex.Arbitrary(name, tuple(map(_canonical, arguments)), orders))
        case _:
            return _atom(tree)


def _canonical(tree: ex.Expression) -> ex.Expression:
    return _tree(_expand(tree))


def _tree(terms: Terms) -> ex.Expression:
    return terms_tree(sorted(terms.items(), key=lambda item: order(item[0])))


def _atom(tree: ex.Expression) -> Terms:
    return {tm.monomial(tree): Fraction(1)}


def _sum(parts: Iterable[Terms]) -> Terms:
    total = tm.sum_of(parts)
    if len(total) > MOST_TERMS:
        raise _TooLarge
    return total


def _product(parts: Iterable[Terms]) -> Terms:
    total: Terms = {tm.EMPTY: Fraction(1)}
    for part in parts:
        if len(total) * len(part) > MOST_TERMS:
            raise _TooLarge
        pairs = [(a, b) for a in total.items() for b in part.items()]
        total = _sum(_normal(tm.times(left, right), a * b) for (left, a), (right, b) in pairs)
    return total


def _normal(monomial: Monomial, coefficient: Fraction) -> Terms:
    """The terms of coefficient * monomial, with integer powers of numbers and sums multiplied
    out.
    """
    wholes = [(base, e) for base, e in monomial if isinstance(base, _COMPOSED)]
    wholes = [(base, whole) for base, e in wholes if (whole := _whole_part(base, e))]
    if not wholes:
        return {monomial: coefficient}
    parts: list[Terms] = []
    for base, whole in wholes:
        if isinstance(base, ex.Number):
            coefficient *= base.value ** int(whole)
        else:
            parts.append(_raised(_expand(base), whole))
    rest = tm.times(monomial, frozenset(wholes), -1)
    return _product([{rest: coefficient}, *parts]) if parts else {rest: coefficient}


def _whole_part(base: ex.Expression, exponent: Fraction) -> Fraction:
    """The part of the exponent of a number or a composite base that can be multiplied out."""
    if isinstance(base, ex.Sum):
        return exponent if exponent.denominator == 1 and exponent > 0 else Fraction(0)
    return Fraction(math.floor(exponent)) if base != ex.ZERO else Fraction(0)


def _raised(terms: Terms, exponent: Fraction) -> Terms:
    if not terms:
        return {} if exponent > 0 else {frozenset([(ex.ZERO, exponent)]): Fraction(1)}
    if len(terms) == 1:
        ((monomial, coefficient),) = terms.items()
        return _raised_monomial(monomial, coefficient, exponent)
    if exponent.denominator == 1 and exponent > 0:
        if math.comb(len(terms) + min(int(exponent), 999) - 1, len(terms) - 1) > MOST_TERMS:
            raise _TooLarge
        return _product([terms] * int(exponent))
    content, common, rest = _primitive(terms, exponent.denominator == 1)
    outside = _raised_monomial(common, content, exponent)
    return _product([outside, {frozenset([(_tree(rest), exponent)]): Fraction(1)}])


class Primitive(NamedTuple):
    """A sum as content times the common monomial times the rest."""

    content: Fraction
    common: Monomial
    rest: Terms


def _primitive(terms: Terms, with_monomial: bool) -> Primitive:
    """(content, common monomial, rest); the content is positive unless powers of -1 are
    harmless.
    """
    content, common = tm.content_of(terms.values()), tm.common_factor(terms)
    if with_monomial and terms[min(terms, key=order)] < 0:
        content = -content
    if not with_monomial:
        common = frozenset(item for item in common if ex.is_exponential(item[0]))
    parts = (_normal(tm.times(key, common, -1), value / content) for key, value in terms.items())
    return Primitive(content, common, _sum(parts))


def _raised_monomial(monomial: Monomial, coefficient: Fraction, exponent: Fraction) -> Terms:
    if exponent.denominator == 1:
        if abs(exponent) > _LARGEST_EXPONENT and abs(coefficient) != 1:
            raise _TooLarge
        return _normal(tm.times(tm.EMPTY, monomial, exponent), coefficient ** int(exponent))
    free = frozenset(
        (base, inner)
        for base, inner in monomial
        if ex.is_exponential(base) or inner.denominator != 1
    )
    bound = monomial - free
    if len(bound) == 1 and coefficient > 0 and all(inner % 2 == 1 for _, inner in bound):
        free, bound = monomial, tm.EMPTY
    factors = [
        _normal(tm.times(tm.EMPTY, free, exponent), Fraction(1)),
        _number_power(abs(coefficient), exponent),
    ]
    if bound or coefficient < 0:
        sign = 1 if coefficient > 0 else -1
        factors.append(_normal(frozenset([(sign * monomial_tree(bound), exponent)]), Fraction(1)))
    return _product(factors)


def _number_power(value: Fraction, exponent: Fraction) -> Terms:
    """value^exponent for value > 0, by the prime factors of small numbers."""
    table: dict[ex.Expression, Fraction] = {}
    for sign, part in ((1, value.numerator), (-1, value.denominator)):
        if part > 1:
            for prime, multiplicity in tm.factored(part):
                table[ex.number(prime)] = sign * multiplicity * exponent
    return _normal(frozenset(table.items()), Fraction(1))


def _function(tree: ex.Apply) -> Terms:
    inner, row = tree.argument, functions.FUNCTION.get(tree.function)
    if (simple := functions.of_inverse(tree)) is not None:
        return _expand(simple)
    special = _SPECIAL.get(tree.function)
    if special:
        return special(_expand(inner))
    inner = _canonical(inner)
    if (
        row is not None
        and row.parity
        and isinstance(inner, ex.Product)
        and ex.coefficient(inner) < 0
    ):
        return tm.scaled(_atom(ex.Apply(tree.function, -inner)), row.parity)
    return _atom(functions.with_argument(tree, inner))


def _exponential(argument: Terms) -> Terms:
    parts = []
    for monomial, value in argument.items():
        match tuple(monomial):
            case ((ex.Apply("log", inner), Fraction(numerator=1, denominator=1)),):
                parts.append(_raised(_expand(inner), value))
            case _:
                atom = ex.Apply("exp", monomial_tree(monomial))
                parts.append({frozenset([(atom, value)]): Fraction(1)})
    return _product(parts)


def _logarithm(argument: Terms) -> Terms:
    """log(exp(u) w) = u + log(w), log(1/w) = -log(w), log(w^r) = r log(w) for r odd or
    fractional.
    """
    if argument == {tm.EMPTY: Fraction(1)}:
        return {}
    if len(argument) != 1:
        return _atom(ex.Apply("log", _tree(argument)))
    ((monomial, value),) = argument.items()
    rest = frozenset(item for item in monomial if not ex.is_exponential(item[0]))
    exponentials = ((base, k) for base, k in monomial if ex.is_exponential(base))
    logs = [tm.scaled(_expand(base.argument), k) for base, k in exponentials]
    sign = -1 if rest and all(exponent < 0 for _, exponent in rest) else 1
    factors = tm.times(tm.EMPTY, rest, sign)
    value = value**sign
    if len(factors) == 1 and value == 1:
        ((base, exponent),) = factors
        if exponent % 2 != 0:
            return _sum([*logs, tm.scaled(_atom(ex.Apply("log", base)), sign * exponent)])
    if factors or value != 1:
        logs.append(tm.scaled(_atom(ex.Apply("log", _tree({factors: value}))), sign))
    return _sum(logs)


_SPECIAL: dict[str, Callable[[Terms], Terms]] = {"exp": _exponential, "log": _logarithm}


# Monomials to trees.


def order(monomial: Monomial) -> tuple[tuple[Place, Fraction], ...]:
    """A key that sorts monomials by their atoms: numbers, symbols, functions, velocities."""
    return tuple((place(base), exponent) for base, exponent in powers_in_order(monomial))


@lru_cache(maxsize=16384)
def powers_in_order(monomial: Monomial) -> tuple[Power, ...]:
    """The powers of a monomial in the order in which they are written."""
    return tuple(sorted(monomial, key=lambda power: place(power[0])))


@lru_cache(maxsize=4096)
def place(base: ex.Expression) -> Place:
    """The rank of an atom among atoms; its text breaks ties."""
    ranks = {ex.Number: 0, ex.Symbol: 1, ex.Arbitrary: 2, ex.Velocity: 4}
    return 0 if base == ex.PI else ranks.get(type(base), 3), printing.natural(
        printing.to_text(base)
    )


def terms_tree(terms: Iterable[Term]) -> ex.Expression:
    """The sum of coefficient * monomial."""
    return ex.add(*(value * monomial_tree(monomial) for monomial, value in terms))


@lru_cache(maxsize=8192)
def monomial_tree(monomial: Monomial) -> ex.Expression:
    """The product; exponentials become one, exp(k log u) becomes u^k."""
    return _product_tree(powers_in_order(monomial))


def _product_tree(powers: Iterable[Power]) -> ex.Expression:
    """As `monomial_tree`, for powers in the order in which they are to be written."""
    exponents: dict[ex.Expression, ex.Expression] = {}
    argument: list[ex.Expression] = []
    numbers: dict[Fraction, Fraction] = {}
    for base, exponent in powers:
        if ex.is_exponential(base) and (power := _as_power(base.argument, exponent)):
            exponents[power[0]] = exponents.get(power[0], ex.ZERO) + power[1]
        elif ex.is_exponential(base):
            argument.append(exponent * base.argument)
        elif isinstance(base, ex.Number) and base.value > 0 and exponent.denominator != 1:
            numbers[exponent] = numbers.get(exponent, Fraction(1)) * base.value
        else:
            exponents[base] = exponents.get(base, ex.ZERO) + exponent
    roots = [ex.number(value) ** exponent for exponent, value in numbers.items()]
    factors = [base**exponent for base, exponent in exponents.items()]
    total = ex.add(*argument)
    return ex.multiply(*roots, *factors, *([ex.Apply("exp", total)] if total != ex.ZERO else []))


def _as_power(
    argument: ex.Expression, scale: Fraction
) -> tuple[ex.Expression, ex.Expression] | None:
    """(u, k scale) for exp(scale * k log(u)) = u^(k scale); None without a single logarithm."""
    factors = ex.factors_of(argument)
    logs = [
        factor for factor in factors if isinstance(factor, ex.Apply) and factor.function == "log"
    ]
    if len(logs) != 1:
        return None
    return logs[0].argument, ex.multiply(
        ex.number(scale), *(factor for factor in factors if factor is not logs[0])
    )


@lru_cache(maxsize=1024)
def merge_powers(tree: ex.Expression) -> ex.Expression:
    """The tree with each base once and one exponential per product; sums are unchanged."""
    inner = ex.rebuild(tree, merge_powers)
    match inner:
        case ex.Product(factors):
            return monomial_tree_of(_flat(factors))
        case ex.Power(ex.Apply("exp", argument), ex.Number() as exponent):
            return ex.Apply("exp", exponent * argument)
        case _:
            return inner


def _flat(factors: Iterable[ex.Expression]) -> Iterator[ex.Expression]:
    """The factors; a product raised to an integer power yields its factors separately."""
    for factor in factors:
        match factor:
            case ex.Power(ex.Product(inner), ex.Number(value) as exponent) if (
                value.denominator == 1
            ):
                yield from (part**exponent for part in inner)
            case _:
                yield factor


def monomial_tree_of(factors: Iterable[ex.Expression]) -> ex.Expression:
    """The product of the factors, with powers of the same base combined."""
    coefficient: ex.Expression = ex.ONE
    table: dict[ex.Expression, Fraction] = {}
    symbolic: dict[ex.Expression, list[ex.Expression]] = {}
    for factor in factors:
        match factor:
            case ex.Number():
                coefficient = coefficient * factor
            case ex.Power(ex.Power(base, exponent), ex.Number(value) as times) if (
                value.denominator == 1
            ):
                symbolic.setdefault(base, []).append(times * exponent)
            case ex.Power(base, ex.Number(exponent)):
                table[base] = table.get(base, Fraction(0)) + exponent
            case ex.Power(base, exponent):
                symbolic.setdefault(base, []).append(exponent)
            case _:
                table[factor] = table.get(factor, Fraction(0)) + 1
    exponents = {
        base: ex.add(*found, ex.Number(table.pop(base, Fraction(0))))
        for base, found in symbolic.items()
    }
    rest = [base**exponent for base, exponent in exponents.items()]
    return ex.multiply(coefficient, _product_tree(table.items()), *rest)


def separate_tree(monomial: Monomial) -> ex.Expression:
    """The product with a separate power of each atom: exp(u)^-1 rather than exp(-u)."""
    return ex.multiply(*(base**exponent for base, exponent in powers_in_order(monomial)))


def in_order_of_products(names: Sequence[T], products: Iterable[Sequence[T]]) -> tuple[T, ...]:
    """The names in an order that agrees with the products where possible: m, g, l if m l and m g l
    occur.
    """
    before: dict[T, set[T]] = {name: set() for name in names}
    for product in products:
        known = [name for name in product if name in before]
        for place, name in enumerate(known):
            before[name].update(other for other in known[:place] if name not in before[other])
    left, found = [*names], list[T]()
    while left:
        found.append(next((name for name in left if not before[name] & {*left} - {name}), left[0]))
        left.remove(found[-1])
    return tuple(found)


def determinant(rows: Sequence[Sequence[ex.Expression]]) -> ex.Expression:
    """The determinant, by minors that are collected; 1 for a matrix without rows."""
    return minors.by_minors(
        rows,
        ex.ONE,
        lambda entry: entry == ex.ZERO,
        lambda terms: collect(
            ex.add(*(ex.multiply(ex.number(sign), *pair) for sign, *pair in terms))
        ),
    )
