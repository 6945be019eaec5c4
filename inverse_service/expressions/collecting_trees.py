"""Monomials of atoms as trees, in a fixed order, with powers and exponentials put together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import lru_cache
from math import prod
from typing import TypeGuard

from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    ONE,
    ZERO,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    factors_of,
    is_exponential,
    multiply,
    negate,
    number,
    rebuild,
)

Monomial = tuple[tuple[Expression, Fraction], ...]
Term = tuple[Monomial, Fraction]
Place = tuple[int, str]


def order(monomial: Monomial) -> tuple[tuple[Place, Fraction], ...]:
    """A key that sorts monomials by their atoms: numbers, symbols, functions, velocities."""
    return tuple((place(base), exponent) for base, exponent in monomial)


@lru_cache(maxsize=4096)
def place(base: Expression) -> Place:
    """The rank of an atom among atoms; its text settles ties."""
    ranks = {Number: 0, Symbol: 1, Arbitrary: 2, Velocity: 4}
    return ranks.get(type(base), 3), to_text(base)


def terms_tree(terms: Iterable[Term]) -> Expression:
    """The sum of coefficient * monomial."""
    return add(*(value * monomial_tree(monomial) for monomial, value in terms))


def monomial_tree(monomial: Monomial) -> Expression:
    """The product; exponentials become one, exp(k log u) becomes u^k."""
    exponents: dict[Expression, Expression] = {}
    argument: list[Expression] = []
    numbers: dict[Fraction, Fraction] = {}
    for base, exponent in monomial:
        if is_exponential(base):
            _split_exponential(base.argument, exponent, argument, exponents)
        elif isinstance(base, Number) and base.value > 0 and exponent.denominator != 1:
            numbers[exponent] = numbers.get(exponent, Fraction(1)) * base.value
        else:
            exponents[base] = exponents.get(base, ZERO) + exponent
    roots = [number(value) ** exponent for exponent, value in numbers.items()]
    factors = [base**exponent for base, exponent in exponents.items()]
    total = add(*argument)
    return multiply(*roots, *factors, *([Apply("exp", total)] if total != ZERO else []))


def _split_exponential(
    argument: Expression, scale: Fraction, plain: list[Expression], exponents: dict[Expression, Expression]
) -> None:
    """Add exp(scale * argument) to the plain exponentials, or as a power of u if argument = k log(u)."""
    factors = factors_of(argument)
    logs = [factor for factor in factors if isinstance(factor, Apply) and factor.function == "log"]
    if len(logs) != 1:
        plain.append(scale * argument)
        return
    rest = multiply(number(scale), *(factor for factor in factors if factor is not logs[0]))
    base = logs[0].argument
    exponents[base] = exponents.get(base, ZERO) + rest


@lru_cache(maxsize=1024)
def merge_powers(tree: Expression) -> Expression:
    """Products rewritten so that each base occurs once and there is one exponential; sums stay as they are."""
    inner = rebuild(tree, merge_powers)
    match inner:
        case Product(factors):
            return monomial_tree_of(_flat(factors))
        case Power(Apply("exp", argument), Number() as exponent):
            return Apply("exp", exponent * argument)
        case _:
            return inner


def _flat(factors: Iterable[Expression]) -> Iterator[Expression]:
    """The factors, those of a product under an integral power one by one."""
    for factor in factors:
        match factor:
            case Power(Product(inner), Number(value) as exponent) if value.denominator == 1:
                yield from (part**exponent for part in inner)
            case _:
                yield factor


def monomial_tree_of(factors: Iterable[Expression]) -> Expression:
    """The product of the factors with powers of the same base put together."""
    coefficient: Expression = ONE
    table: dict[Expression, Fraction] = {}
    symbolic: dict[Expression, list[Expression]] = {}
    for factor in factors:
        match factor:
            case Number():
                coefficient = coefficient * factor
            case Power(Power(base, exponent), Number(value) as times) if value.denominator == 1:
                symbolic.setdefault(base, []).append(times * exponent)
            case Power(base, Number(exponent)):
                table[base] = table.get(base, Fraction(0)) + exponent
            case Power(base, exponent):
                symbolic.setdefault(base, []).append(exponent)
            case _:
                table[factor] = table.get(factor, Fraction(0)) + 1
    exponents = {base: add(*found, Number(table.pop(base, Fraction(0)))) for base, found in symbolic.items()}
    rest = [base**exponent for base, exponent in exponents.items()]
    return multiply(coefficient, monomial_tree(tuple(table.items())), *rest)


def separate_tree(monomial: Monomial) -> Expression:
    """The product with each atom's power on its own: exp(u)^-1 and not exp(-u)."""
    return multiply(*(base**exponent for base, exponent in monomial))


def minus_inside(tree: Expression) -> Expression:
    """Each term -(a - 1) c of a sum as (1 - a) c, -c/(a - 1) as c/(1 - a); other numbers than 1 alike."""
    if isinstance(tree, Sum):
        return add(*map(minus_inside, tree.terms))
    match tree:
        case Product((Number(value), *factors)) if value < 0:
            for place, factor in enumerate(factors):
                base, exponent = (factor.base, factor.exponent) if isinstance(factor, Power) else (factor, ONE)
                if _is_difference(base) and isinstance(exponent, Number) and exponent.value % 2 == 1:
                    turned = add(*map(negate, base.terms[::-1])) ** exponent
                    return multiply(number(-value), *factors[:place], turned, *factors[place + 1 :])
    return tree


def numbers_outside(tree: Expression) -> Expression:
    """(x^2/2 + 3 y^2/2)/z as (x^2 + 3 y^2)/(2 z): no denominator or minus in a bracket that all of its terms have."""
    tree = rebuild(tree, numbers_outside)
    if not isinstance(tree, Product):
        return tree
    shares = [_common_denominator(factor) for factor in tree.factors]
    whole = [
        add(*(d * term for term in f.terms)) if isinstance(f, Sum) else f
        for f, d in zip(tree.factors, shares, strict=True)
    ]
    return multiply(number(Fraction(1, prod(shares))), *whole)


def _common_denominator(tree: Expression) -> int:
    """The denominator of the coefficients of a sum where they all have the same one, else 1; negative as they are."""
    found = [_coefficient(term) for term in tree.terms] if isinstance(tree, Sum) else [Fraction(1)]
    sign = -1 if all(value < 0 for value in found) else 1
    return sign * found[0].denominator if len({value.denominator for value in found}) == 1 else sign


def _coefficient(term: Expression) -> Fraction:
    first = term.factors[0] if isinstance(term, Product) else term
    return first.value if isinstance(first, Number) else Fraction(1)


def _is_difference(tree: Expression) -> TypeGuard[Sum]:
    """Whether it is a sum of two terms, one with a plus and one with a minus, one of them a number."""
    terms = tree.terms if isinstance(tree, Sum) else ()
    signs = {_is_negative(term) for term in terms}
    return len(terms) == len(signs) == 2 and any(isinstance(term, Number) for term in terms)


def _is_negative(term: Expression) -> bool:
    return _coefficient(term) < 0
