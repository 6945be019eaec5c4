"""Symbolic parameters: search with numbers in their place, then find how the coefficients depend on them.

The parameters are replaced by random whole numbers and the ladder is climbed for that system, which
fixes the support of L. On that small support the linear problem is solved again for many other numbers,
and each coefficient, relative to one of them, is interpolated as a quotient of polynomials in the
parameters (linear algebra modulo a prime, coefficients reconstructed).
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx, nmod_mat

from inverse_service.algebra.point import number_value
from inverse_service.algebra.primes import reconstruct, safe_prime
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    add,
    multiply,
    negate,
    number,
    power,
    substitute,
    walk,
)
from inverse_service.inverse_problem.decision.analysis import Analysis, analyse
from inverse_service.inverse_problem.search.choice import inertia
from inverse_service.inverse_problem.search.deadline import OutOfTime, within
from inverse_service.inverse_problem.search.found import Ladder
from inverse_service.inverse_problem.search.linear_ansatz import solve_ansatz
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.sampling import make_sampler
from inverse_service.inverse_problem.search.terms import Monomial, monomial_tree, rank, terms_of
from inverse_service.mechanics.euler_lagrange import hessian

_LARGEST_VALUE = 60
_HIGHEST_DEGREE = 3
_MOST_PARAMETERS = 6
_MOST_TERMS = 16
_SPARE = 4
# For the interpolation, and for the search with numbers.
_WORK, _WORK_FOR_NUMBERS = 800_000, 800_000
_BOUND = 10_000

Values = Mapping[str, int]


def applies(material: Material) -> bool:
    """Whether f holds one to six symbolic parameters."""
    system = material.analysis.system
    nodes = {node for f in system.accelerations for node in walk(f)}
    return 0 < sum(Symbol(name) in nodes for name in system.parameters) <= _MOST_PARAMETERS


def propose(material: Material, seed: int, ladder: Ladder) -> list[Expression]:
    """Lagrangians with symbolic coefficients from the parts of one without parameters."""
    generator = random.Random(f"parameters {seed}")
    special = _specialised(material.analysis, _draw(material, generator))
    outcome = ladder(special, material.motion.with_time, seed, _WORK_FOR_NUMBERS)
    try:
        with within(_WORK):
            found = [_generalised(material, part, generator, seed) for part in outcome.parts] if outcome else []
    except OutOfTime:
        return []
    trees = [_turned(material, tree) for tree in found if tree is not None]
    return [add(*trees)] if trees and len(trees) == len(found) else []


def _turned(material: Material, tree: Expression) -> Expression:
    """The tree or its opposite, whichever has more positive directions at the real point."""
    signs = inertia(material.analysis.real_point, hessian(tree, material.analysis.system.coordinates))
    return negate(tree) if signs is not None and signs[1] > signs[0] else tree


def _draw(material: Material, generator: random.Random) -> dict[str, int]:
    return {name: generator.randrange(2, _LARGEST_VALUE) for name in material.analysis.system.parameters}


def _specialised(analysis: Analysis, values: Values) -> Analysis:
    table: dict[Expression, Expression] = {Symbol(name): number(value) for name, value in values.items()}
    system = analysis.system
    forces = tuple(substitute(f, table) for f in system.accelerations)
    return analyse(replace(system, accelerations=forces, parameters=()))


def _generalised(material: Material, part: Expression, generator: random.Random, seed: int) -> Expression | None:
    """The part with coefficients that are polynomials in the parameters, or None."""
    support = sorted(terms_of(part), key=rank)
    if len(support) > _MOST_TERMS:
        return None
    data: list[tuple[Values, list[Fraction]]] = []
    for degree in range(_HIGHEST_DEGREE + 1):
        monomials = _monomials(len(material.analysis.system.parameters), degree)
        while len(data) < 2 * len(monomials) + _SPARE:
            values = _draw(material, generator)
            coefficients = _coefficients(material, support, values, seed)
            if coefficients is None:
                return None
            data.append((values, coefficients))
        quotients = [_interpolated(material, monomials, data, k) for k in range(len(support))]
        if all(quotient is not None for quotient in quotients):
            return _assembled(material, support, [q for q in quotients if q is not None])
    return None


def _coefficients(material: Material, support: Sequence[Monomial], values: Values, seed: int) -> list[Fraction] | None:
    """The coefficients on the support for these values, the first of them 1; None where not unique."""
    try:
        letters = dict.fromkeys(item for key in support for item in key)
        sampler = make_sampler(_specialised(material.analysis, values), letters)
        space = solve_ansatz(sampler, support, seed)
    except OutOfTime:
        raise
    except IrreducibleAtoms:
        return None
    if len(space.combinations) != 1 or len(space.combinations[0]) != len(support):
        return None
    (combination,) = space.combinations
    return [combination[key] / combination[support[0]] for key in support]


def _monomials(count: int, degree: int) -> list[tuple[int, ...]]:
    """Exponents of total degree <= degree, constants first."""
    every = itertools.product(range(degree + 1), repeat=count)
    return sorted((e for e in every if sum(e) <= degree), key=sum)


Quotient = tuple[fmpq_mpoly, fmpq_mpoly]


def _interpolated(
    material: Material, monomials: Sequence[tuple[int, ...]], data: Sequence[tuple[Values, list[Fraction]]], k: int
) -> Quotient | None:
    """P/Q with P(values) = coefficient Q(values) for all data; None where there is none of this degree."""
    names, prime, width = material.analysis.system.parameters, safe_prime(11), len(monomials)
    rows = []
    for values, coefficients in data:
        powers = [_value(monomial, [values[name] for name in names], prime) for monomial in monomials]
        c = number_value(coefficients[k], prime)
        rows.append([*powers, *(-c * p % prime for p in powers)])
    matrix, rank_found = nmod_mat(len(rows), 2 * width, [x for row in rows for x in row], prime).rref()
    if rank_found == 2 * width:
        return None
    return _simplest_null_vector(names, monomials, matrix, rank_found, prime)


def _value(monomial: Sequence[int], values: Sequence[int], prime: int) -> int:
    product = 1
    for value, e in zip(values, monomial, strict=True):
        product = product * pow(value, e, prime) % prime
    return product


def _simplest_null_vector(
    names: Sequence[str], monomials: Sequence[tuple[int, ...]], reduced: nmod_mat, rank_found: int, prime: int
) -> Quotient | None:
    """The null vector of the first free column: the denominator of lowest degree."""
    width = len(monomials)
    pivots = [next(c for c in range(2 * width) if int(reduced[i, c])) for i in range(rank_found)]
    free = next(c for c in range(2 * width) if c not in pivots)
    vector = {free: Fraction(1)}
    for i, pivot in enumerate(pivots):
        value = reconstruct(-int(reduced[i, free]) % prime, prime, _BOUND)
        if value is None:
            return None
        vector[pivot] = value
    context = fmpq_mpoly_ctx.get(tuple(f"a{k}" for k in range(len(names))))
    numerator, denominator = (
        context.from_dict({
            monomials[c - shift]: _rational(v) for c, v in vector.items() if shift <= c < shift + width and v
        })
        for shift in (0, width)
    )  # fmt: skip
    return None if denominator.is_zero() else (numerator, denominator)


def _rational(value: Fraction) -> fmpq:
    return fmpq(value.numerator, value.denominator)


def _assembled(material: Material, support: Sequence[Monomial], quotients: Sequence[Quotient]) -> Expression:
    """sum coefficient * term, all coefficients multiplied by the least common denominator."""
    common = quotients[0][1]
    for _, denominator in quotients[1:]:
        common = common * denominator / common.gcd(denominator)
    numerators = [common / denominator * numerator for numerator, denominator in quotients]
    shared = numerators[0]
    for numerator in numerators[1:]:
        shared = shared.gcd(numerator)
    names = material.analysis.system.parameters
    return add(
        *(
            multiply(_polynomial_tree(numerator / shared, names), monomial_tree(key))
            for numerator, key in zip(numerators, support, strict=True)
        )
    )


def _polynomial_tree(polynomial: fmpq_mpoly, names: Sequence[str]) -> Expression:
    parts = []
    for exponents, coefficient in polynomial.to_dict().items():
        value = Fraction(int(coefficient.p), int(coefficient.q))
        factors = [power(Symbol(name), int(e)) for name, e in zip(names, exponents, strict=True) if e]
        parts.append(multiply(number(value), *factors))
    return add(*parts)
