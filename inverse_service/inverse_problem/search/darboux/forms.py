"""First integrals and Darboux polynomials of Gamma that are linear or quadratic in the velocities.

Gamma(P) = K P is linear in P for a given cofactor K; it is solved over products of letters of f with
1, v_i and v_i v_j at random points modulo a prime, with coefficients reconstructed as rationals. What
is found proposes terms of an ansatz only, so no proof is needed here.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import nmod_mat

from inverse_service.algebra import montgomery
from inverse_service.algebra.echelon_kernels import Words
from inverse_service.algebra.montgomery import compiled, multiply
from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, power
from inverse_service.expressions.tree import multiply as multiply_trees
from inverse_service.inverse_problem.search.darboux.cofactors import cofactors, divergences
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.factors import Factors, position_monomials
from inverse_service.inverse_problem.search.gradings import factors, grouped
from inverse_service.inverse_problem.search.linear_ansatz import (
    Combination,
    exponent_lists,
    letters_of,
    to_montgomery,
)
from inverse_service.inverse_problem.search.material import Material, distinct
from inverse_service.inverse_problem.search.motion import has_velocity
from inverse_service.inverse_problem.search.null_vectors import kernel
from inverse_service.inverse_problem.search.one_coordinate.algebra import expanded, factored, factors_of
from inverse_service.inverse_problem.search.sampling import LetterTable, letter_table, make_sampler, monomial_values
from inverse_service.inverse_problem.search.shapes import pairs
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    monomial,
    terms_of,
    times,
    tree_of,
)

_MOST_LINEAR_TERMS = 240
_MOST_QUADRATIC_TERMS = 300
_MOST_OF_FACTORS = 8
_MOST_OF_PARAMETERS = 3
_HIGHEST_DEGREE = 3
_MOST_INTEGRALS = 2
_MULTIPLES = tuple(sign * Fraction(c) for c in ("1", "2", "1/2", "3", "1/3", "4", "1/4") for sign in (1, -1))
_SPARE = 8
_NO_POINTS = (IrreducibleAtoms, SingularPoint, ValueError)


@dataclass(frozen=True, slots=True)
class Form:
    """A Darboux polynomial factor * base, `base` without a common factor of its terms, of this degree in v."""

    base: Expression
    factor: Monomial
    degree: int


def darboux_polynomials(material: Material, factors: Factors, seed: int) -> list[Form]:
    """Irreducible ones of first degree, for the cofactors that f suggests; where they are few, of second degree too."""
    linear = _distinct(form for one in _linear(material, factors, seed) for form in _split(material, one))
    if len(linear) >= material.motion.size:
        return linear
    quadratic = [form for one in _quadratic(material, factors, seed) for form in _split(material, one)]
    return sorted(_distinct([*linear, *quadratic]), key=lambda form: form.degree)


def _distinct(forms: Iterable[Form]) -> list[Form]:
    """Each base once, with the first factor."""
    first: dict[Expression, Form] = {}
    for form in forms:
        first.setdefault(form.base, form)
    return list(first.values())


def _linear(material: Material, factors: Factors, seed: int) -> list[Combination]:
    """Multiples of the first integrals among them are cofactors too."""
    shapes = [EMPTY, *(monomial(v) for v in material.motion.velocities)]
    candidates = _candidates(material, factors, shapes, _MOST_LINEAR_TERMS)
    found = _of_cofactors(material, candidates, cofactors(material), seed)
    integrals = [combination for combination in found[0] if _moves(combination)]
    multiples = [{key: c * a for key, a in one.items()} for one in integrals[:_MOST_INTEGRALS] for c in _MULTIPLES]
    found += _of_cofactors(material, candidates, multiples, seed) if multiples else []
    return [combination for group in found for combination in group]


def _quadratic(material: Material, factors: Factors, seed: int) -> list[Combination]:
    """First integrals, and products of n = 2 linear ones, whose cofactor is known without theirs."""
    shapes = [EMPTY, *(monomial(v) for v in material.motion.velocities), *pairs(material)]
    candidates = _candidates(material, factors, shapes, _MOST_QUADRATIC_TERMS)
    tried: list[Terms] = [{}, *divergences(material)]
    return [combination for group in _of_cofactors(material, candidates, tried, seed) for combination in group]


def _moves(combination: Combination) -> bool:
    return any(has_velocity(letter) for key in combination for letter, _ in key)


def _candidates(material: Material, factors: Factors, shapes: Sequence[Monomial], most: int) -> list[Monomial]:
    """Functions of position times velocity shapes, as many functions as fit, simple ones first."""
    own = [EMPTY, *factors.plain[:_MOST_OF_FACTORS]]
    own += [key for key in material.parameter_monomials[:_MOST_OF_PARAMETERS] if key]
    products = _products_of_units(material)
    functions = list(dict.fromkeys([*distinct(own), *products]))[: most // len(shapes)]
    return [times(phi, shape) for phi in functions for shape in shapes]


def _products_of_units(material: Material) -> list[Monomial]:
    """Products of up to three letters of f, their inverses where f holds these, and coordinates."""
    units = [key for key in position_monomials(material, 1) if all(e.denominator == 1 for _, e in key)]
    units += [monomial(q) for q in material.motion.coordinates]
    found = [EMPTY]
    for count in range(1, _HIGHEST_DEGREE + 1):
        for chosen in itertools.combinations_with_replacement(distinct(units), count):
            product = EMPTY
            for unit in chosen:
                product = times(product, unit)
            found.append(product)
    return distinct(found)


def _of_cofactors(
    material: Material, candidates: Sequence[Monomial], tried: Sequence[Terms], seed: int
) -> list[list[Combination]]:
    """The solutions P of Gamma(P) = K P for each K."""
    found: list[list[Combination]] = [[] for _ in tried]
    letters = letters_of([*candidates, *(key for terms in tried for key in terms)])
    try:
        sampler = make_sampler(material.analysis, dict.fromkeys(p for key in candidates for p in key))
        for chosen, groups in _groups(material, candidates, tried):
            table = letter_table(sampler, letters, max(map(len, groups)) + _SPARE, seed)
            solved = _solved(table, letters, candidates, groups, [tried[k] for k in chosen])
            for k, combinations in zip(chosen, solved, strict=True):
                found[k] = combinations
    except _NO_POINTS:
        return [[] for _ in tried]
    return found


def _groups(
    material: Material, candidates: Sequence[Monomial], tried: Sequence[Terms]
) -> Iterator[tuple[list[int], list[list[int]]]]:
    """(numbers of cofactors, groups of candidates that do not mix under Gamma - K), by what reflections do to K.

    A K that does not scale as 1/t has no P: in the one or the other direction of a scaling the last part of K times
    the last part of P would have to vanish alone.
    """
    keys = list(dict.fromkeys(key for terms in tried for key in terms))
    *known, rate = factors(material.analysis.system, [*candidates, *keys, times(EMPTY, monomial(TIME), -1)])
    factor = dict(zip(keys, known[len(candidates) :], strict=True))
    scaled = [k for k, terms in enumerate(tried) if all(factor[key][0] == rate[0] for key in terms)]
    both = [k for k in scaled if all(factor[key] == rate for key in tried[k])]
    groups = grouped(known[: len(candidates)])
    if both:
        yield both, groups
    if len(both) < len(scaled):
        yield [k for k in scaled if k not in both], grouped((scale, 0) for scale, _ in known[: len(candidates)])


def _solved(
    table: LetterTable,
    letters: Sequence[Expression],
    candidates: Sequence[Monomial],
    groups: Sequence[Sequence[int]],
    tried: Sequence[Terms],
) -> list[list[Combination]]:
    """The solutions in the span of each group, for each K, in the order of the candidates."""
    prime, rows = table.prime, monomial_values(table, letters, candidates)
    groups = [_independent(rows[: len(group) + _SPARE], group, prime) for group in groups]
    rates = _rates(table, letters, candidates)
    found = []
    for terms in tried:
        check()
        matrix = _equations(rows, rates, _value(table, letters, terms), prime)
        vectors = [
            {group[k]: a for k, a in vector.items()}
            for group in groups
            for vector in kernel(matrix[: len(group) + _SPARE, group], prime).rational_vectors()
        ]
        found.append([{candidates[k]: a for k, a in vector.items()} for vector in sorted(vectors, key=max)])
    return found


def _independent(values: Words, group: Sequence[int], prime: int) -> list[int]:
    """The candidates of a group without those that are combinations of earlier ones as functions."""
    rows = values[:, group].tolist()
    reduced, rank = nmod_mat(len(rows), len(group), [a for row in rows for a in row], prime).rref()
    return [group[next(k for k in range(len(group)) if int(reduced[i, k]))] for i in range(rank)]


def _value(table: LetterTable, letters: Sequence[Expression], terms: Terms) -> Any:
    """K at each sample, in Montgomery form."""
    prime = table.prime
    if not terms:
        return np.zeros(len(table.values), np.uint64)
    weights = [a.numerator * pow(a.denominator, -1, prime) % prime for a in terms.values()]
    rows = monomial_values(table, letters, list(terms)).tolist()
    return np.array([sum(w * x for w, x in zip(weights, row, strict=True)) % prime for row in rows], np.uint64)


def _rates(table: LetterTable, letters: Sequence[Expression], candidates: Sequence[Monomial]) -> Any:
    """Gamma(log m) of each candidate at each sample, in Montgomery form."""
    starts, places, exponents = exponent_lists(letters, candidates, table.prime)
    modulus, inverse, _, _ = montgomery.constants(table.prime)
    result = np.zeros((len(table.values), len(candidates)), np.uint64)
    _fill_rates(starts, places, exponents, to_montgomery(table.along, table.prime), result, modulus, inverse)
    return result


@compiled
def _fill_rates(starts: Any, places: Any, exponents: Any, along: Any, result: Any, prime: Any, inverse: Any) -> None:
    for s in range(result.shape[0]):
        for c in range(result.shape[1]):
            for k in range(starts[c], starts[c + 1]):
                part = multiply(exponents[k], along[s, places[k]], prime, inverse)
                result[s, c] = (result[s, c] + part) % prime


def _equations(values: Any, rates: Any, cofactor: Any, prime: int) -> Any:
    """m (Gamma(log m) - K) for each candidate m at each sample, in Montgomery form."""
    modulus, inverse, _, _ = montgomery.constants(prime)
    result = np.zeros(values.shape, np.uint64)
    _fill_equations(values, rates, cofactor, result, modulus, inverse)
    return result


@compiled
def _fill_equations(values: Any, rates: Any, cofactor: Any, result: Any, prime: Any, inverse: Any) -> None:
    for s in range(values.shape[0]):
        for c in range(values.shape[1]):
            rate = (rates[s, c] + (prime - cofactor[s])) % prime
            result[s, c] = multiply(values[s, c], rate, prime, inverse)


def _split(material: Material, combination: Combination) -> list[Form]:
    """The factors that hold velocities, with the factors that hold none."""
    symbols: list[Symbol | Velocity] = [*material.motion.coordinates, *material.motion.velocities]
    try:
        parts = factors_of(factored(tree_of(combination), symbols))
        bases = [expanded(base) for base, _ in parts if has_velocity(base)]
        rest = multiply_trees(*(power(base, e) for base, e in parts if not has_velocity(base)))
        ((factor, _),) = terms_of(rest).items()
        return [Form(base, factor, _degree(base)) for base in bases]
    except (TooManyTerms, ValueError):
        return []


def _degree(base: Expression) -> int:
    """The degree in the velocities of a polynomial."""
    return max(sum(int(e) for letter, e in key if isinstance(letter, Velocity)) for key in terms_of(base))
