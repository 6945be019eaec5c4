"""Monomials of atoms as trees, in a fixed order, with powers and exponentials put together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import lru_cache
from math import prod
from typing import TypeGuard

from inverse_service.expressions import printing
from inverse_service.expressions import tree as ex

Monomial = tuple[tuple[ex.Expression, Fraction], ...]
Term = tuple[Monomial, Fraction]
Place = tuple[int, str]


def order(monomial: Monomial) -> tuple[tuple[Place, Fraction], ...]:
    """A key that sorts monomials by their atoms: numbers, symbols, functions, velocities."""
    return tuple((place(base), exponent) for base, exponent in monomial)


@lru_cache(maxsize=4096)
def place(base: ex.Expression) -> Place:
    """The rank of an atom among atoms; its text settles ties."""
    ranks = {ex.Number: 0, ex.Symbol: 1, ex.Arbitrary: 2, ex.Velocity: 4}
    return 0 if base == ex.PI else ranks.get(type(base), 3), printing.to_text(base)


def terms_tree(terms: Iterable[Term]) -> ex.Expression:
    """The sum of coefficient * monomial."""
    return ex.add(*(value * monomial_tree(monomial) for monomial, value in terms))


def monomial_tree(monomial: Monomial) -> ex.Expression:
    """The product; exponentials become one, exp(k log u) becomes u^k."""
    exponents: dict[ex.Expression, ex.Expression] = {}
    argument: list[ex.Expression] = []
    numbers: dict[Fraction, Fraction] = {}
    for base, exponent in monomial:
        if ex.is_exponential(base):
            _split_exponential(base.argument, exponent, argument, exponents)
        elif isinstance(base, ex.Number) and base.value > 0 and exponent.denominator != 1:
            numbers[exponent] = numbers.get(exponent, Fraction(1)) * base.value
        else:
            exponents[base] = exponents.get(base, ex.ZERO) + exponent
    roots = [ex.number(value) ** exponent for exponent, value in numbers.items()]
    factors = [base**exponent for base, exponent in exponents.items()]
    total = ex.add(*argument)
    return ex.multiply(*roots, *factors, *([ex.Apply("exp", total)] if total != ex.ZERO else []))


def _split_exponential(
    argument: ex.Expression, scale: Fraction, plain: list[ex.Expression], exponents: dict[ex.Expression, ex.Expression]
) -> None:
    """Add exp(scale * argument) to the plain exponentials, or as a power of u if argument = k log(u)."""
    factors = ex.factors_of(argument)
    logs = [factor for factor in factors if isinstance(factor, ex.Apply) and factor.function == "log"]
    if len(logs) != 1:
        plain.append(scale * argument)
        return
    rest = ex.multiply(ex.number(scale), *(factor for factor in factors if factor is not logs[0]))
    base = logs[0].argument
    exponents[base] = exponents.get(base, ex.ZERO) + rest


@lru_cache(maxsize=1024)
def merge_powers(tree: ex.Expression) -> ex.Expression:
    """Products rewritten so that each base occurs once and there is one exponential; sums stay as they are."""
    inner = ex.rebuild(tree, merge_powers)
    match inner:
        case ex.Product(factors):
            return monomial_tree_of(_flat(factors))
        case ex.Power(ex.Apply("exp", argument), ex.Number() as exponent):
            return ex.Apply("exp", exponent * argument)
        case _:
            return inner


def _flat(factors: Iterable[ex.Expression]) -> Iterator[ex.Expression]:
    """The factors, those of a product under an integral power one by one."""
    for factor in factors:
        match factor:
            case ex.Power(ex.Product(inner), ex.Number(value) as exponent) if value.denominator == 1:
                yield from (part**exponent for part in inner)
            case _:
                yield factor


def monomial_tree_of(factors: Iterable[ex.Expression]) -> ex.Expression:
    """The product of the factors with powers of the same base put together."""
    coefficient: ex.Expression = ex.ONE
    table: dict[ex.Expression, Fraction] = {}
    symbolic: dict[ex.Expression, list[ex.Expression]] = {}
    for factor in factors:
        match factor:
            case ex.Number():
                coefficient = coefficient * factor
            case ex.Power(ex.Power(base, exponent), ex.Number(value) as times) if value.denominator == 1:
                symbolic.setdefault(base, []).append(times * exponent)
            case ex.Power(base, ex.Number(exponent)):
                table[base] = table.get(base, Fraction(0)) + exponent
            case ex.Power(base, exponent):
                symbolic.setdefault(base, []).append(exponent)
            case _:
                table[factor] = table.get(factor, Fraction(0)) + 1
    exponents = {base: ex.add(*found, ex.Number(table.pop(base, Fraction(0)))) for base, found in symbolic.items()}
    rest = [base**exponent for base, exponent in exponents.items()]
    return ex.multiply(coefficient, monomial_tree(tuple(table.items())), *rest)


def separate_tree(monomial: Monomial) -> ex.Expression:
    """The product with each atom's power on its own: exp(u)^-1 and not exp(-u)."""
    return ex.multiply(*(base**exponent for base, exponent in monomial))


def minus_inside(tree: ex.Expression) -> ex.Expression:
    """Each term -(a - 1) c of a sum as (1 - a) c, -c/(a - 1) as c/(1 - a); other numbers than 1 alike."""
    if isinstance(tree, ex.Sum):
        return ex.add(*map(minus_inside, tree.terms))
    match tree:
        case ex.Product((ex.Number(value), *factors)) if value < 0:
            for place, factor in enumerate(factors):
                base, exponent = (factor.base, factor.exponent) if isinstance(factor, ex.Power) else (factor, ex.ONE)
                if _is_difference(base) and isinstance(exponent, ex.Number) and exponent.value % 2 == 1:
                    turned = ex.add(*map(ex.negate, base.terms[::-1])) ** exponent
                    return ex.multiply(ex.number(-value), *factors[:place], turned, *factors[place + 1 :])
    return tree


def roots_upright(tree: ex.Expression) -> ex.Expression:
    """1/sqrt(-a/(b - c)) as sqrt((c - b)/a): no quotient whose denominator is a sum under a root in a denominator."""
    tree = ex.rebuild(tree, roots_upright)
    match tree:
        case ex.Power(base, ex.Number(e)) if e < 0 and e.denominator > 1:
            powers = ex.powers_of(base)
            if any(isinstance(part, ex.Sum) and k == -1 for part, k in powers):
                negative = any(isinstance(part, ex.Number) and part.value < 0 for part, _ in powers)
                parts = [part if k == -1 else part**-k for part, k in powers]
                if negative:
                    place = next(n for n, (part, k) in enumerate(powers) if isinstance(part, ex.Sum) and k == -1)
                    parts = [ex.negated(part) if n == place else part for n, part in enumerate(parts)]
                    parts.append(ex.number(-1))
                return ex.multiply(*parts) ** -e
    return tree


def numbers_outside(tree: ex.Expression) -> ex.Expression:
    """(x^2/2 + 3 y^2/2)/z as (x^2 + 3 y^2)/(2 z): no denominator or minus in a bracket that all of its terms have."""
    tree = ex.rebuild(tree, numbers_outside)
    if not isinstance(tree, ex.Product):
        return tree
    shares = [_common_denominator(factor) for factor in tree.factors]
    whole = [
        ex.add(*(d * term for term in f.terms)) if isinstance(f, ex.Sum) else f
        for f, d in zip(tree.factors, shares, strict=True)
    ]
    return ex.multiply(ex.number(Fraction(1, prod(shares))), *whole)


def _common_denominator(tree: ex.Expression) -> int:
    """The denominator of the coefficients of a sum where they all have the same one, else 1; negative as they are."""
    found = [_coefficient(term) for term in tree.terms] if isinstance(tree, ex.Sum) else [Fraction(1)]
    sign = -1 if all(value < 0 for value in found) else 1
    return sign * found[0].denominator if len({value.denominator for value in found}) == 1 else sign


def _coefficient(term: ex.Expression) -> Fraction:
    first = term.factors[0] if isinstance(term, ex.Product) else term
    return first.value if isinstance(first, ex.Number) else Fraction(1)


def _is_difference(tree: ex.Expression) -> TypeGuard[ex.Sum]:
    """Whether it is a sum of two terms, one with a plus and one with a minus, one of them a number."""
    terms = tree.terms if isinstance(tree, ex.Sum) else ()
    signs = {_is_negative(term) for term in terms}
    return len(terms) == len(signs) == 2 and any(isinstance(term, ex.Number) for term in terms)


def _is_negative(term: ex.Expression) -> bool:
    return _coefficient(term) < 0
