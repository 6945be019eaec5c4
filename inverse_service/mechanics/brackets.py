"""The kinetic energy as books write it: m (r'^2 + r^2 phi'^2)/2 for two terms with the factor m/2.

Everything here is an identity of the field of fractions.
"""

from collections.abc import Collection
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple

from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics import moves

Powers = frozenset[tuple[ex.Expression, Fraction]]


def with_common_constants(
    tree: ex.Expression, letters: Collection[ex.Expression], constants: Collection[ex.Expression]
) -> ex.Expression:
    """The terms of one degree in the letters (velocities, momenta) that have the same constants as
    factors in one bracket, where that costs less: k (x^2 + y^2)/2 among those without letters.

    Each bracket is tried with the numbers of its terms outside, and with their least common
    denominator: m l^2 (4 a'^2 + b'^2)/6. Quotients without letters stay apart, as k/r + k/s.
    """
    terms = [collecting.merge_powers(term) for term in ex.summands(tree)]
    groups: dict[tuple[int, Powers, Fraction | None], list[int]] = {}
    parts = dict[int, tuple[Fraction, list[ex.Expression], ex.Expression]]()
    for place, term in enumerate(terms):
        number, outside, inside = _split(term, constants)
        of = degree(term, letters)
        if of is None or of > 2 or (of < 2 and (not outside or _has_divisor(inside))):
            continue
        parts[place] = number, outside, inside
        key = frozenset(base for factor in outside for base in ex.powers_of(factor))
        groups.setdefault((of, key, abs(number)), []).append(place)
        groups.setdefault((of, key, None), []).append(place)
    best, least = tree, moves.cost(tree)
    for equal in (True, False):
        found = list[ex.Expression](terms)
        for (_, _, alike), places in groups.items():
            # Without constants, terms with different numbers stay apart: x'^2/2 + 2 y'^2.
            if (alike is None) is equal or not (equal or parts[places[0]][1]):
                continue
            found = _in_one_bracket(found, places, parts)
        if (price := moves.cost(whole := ex.add(*found))) < least:
            best, least = whole, price
    return best


def with_joined_coefficients(
    tree: ex.Expression, constants: Collection[ex.Expression]
) -> ex.Expression:
    """(1 - mu)/s for 1/s - mu/s: one constant coefficient for equal other factors, where that costs
    less.
    """
    groups: dict[frozenset[tuple[ex.Expression, Fraction]], list[int]] = {}
    parts = list[tuple[ex.Expression, ex.Expression]]()
    terms = [collecting.merge_powers(term) for term in ex.summands(tree)]
    for place, term in enumerate(terms):
        number, outside, inside = _split(term, constants)
        parts.append((ex.multiply(ex.number(number), *outside), inside))
        groups.setdefault(frozenset(ex.powers_of(inside)), []).append(place)
    found = list[ex.Expression](terms)
    for places in groups.values():
        if len(places) > 1:
            joined = ex.add(*(parts[k][0] for k in places))
            whole = _content_outside(joined) * parts[places[0]][1]
            if moves.cost(whole) < sum(moves.cost(terms[k]) for k in places):
                for place in places:
                    found[place] = ex.ZERO
                found[places[0]] = whole
    return ex.add(*found) if moves.cost(ex.add(*found)) < moves.cost(tree) else tree


def _content_outside(tree: ex.Expression) -> ex.Expression:
    """g (a - b) for g a - g b, and the first of its terms without a minus sign if there is one."""
    terms = [dict(ex.powers_of(term)) for term in ex.summands(tree)]
    if len(terms) < 2:
        return tree
    shared = [
        (base, e)
        for base, e in terms[0].items()
        if not isinstance(base, ex.Number) and all(other.get(base) == e for other in terms)
    ]
    number = Fraction(1, lcm(*(ex.coefficient(term).denominator for term in ex.summands(tree))))
    outside = ex.multiply(ex.number(number), *(base**e for base, e in shared))
    rest = [
        ex.number(ex.coefficient(term) / number)
        * ex.multiply(
            *(
                b**e
                for b, e in ex.powers_of(term)
                if not isinstance(b, ex.Number) and (b, e) not in shared
            )
        )
        for term in ex.summands(tree)
    ]
    return outside * ex.add(*sorted(rest, key=lambda term: ex.coefficient(term) < 0))


def _has_divisor(tree: ex.Expression) -> bool:
    return any(map(moves.is_divisor, ex.walk(tree)))


def _in_one_bracket(
    terms: list[ex.Expression],
    places: list[int],
    parts: dict[int, tuple[Fraction, list[ex.Expression], ex.Expression]],
) -> list[ex.Expression]:
    """The terms with those at the places in one bracket, at the first of these, if that is
    cheaper.
    """
    numbers = [parts[place][0] for place in places]
    share = Fraction(gcd(*(v.numerator for v in numbers)), lcm(*(v.denominator for v in numbers)))
    if numbers[0] < 0 and max(numbers) < 0:
        share = -share
    outside = parts[places[0]][1]
    inner = ex.add(*(ex.number(parts[k][0] / share) * parts[k][2] for k in places))
    whole = ex.multiply(ex.number(share), *outside, inner)
    before = sum(moves.cost(terms[k]) for k in places)
    if moves.cost(whole) >= before:
        return terms
    found = [ex.ZERO if k in places else term for k, term in enumerate(terms)]
    found[places[0]] = whole
    return found


class SharedFactors(NamedTuple):
    """A term by its number, its constant factors, and the rest."""

    number: Fraction
    constants: list[ex.Expression]
    rest: ex.Expression


def _split(term: ex.Expression, constants: Collection[ex.Expression]) -> SharedFactors:
    """The number, the constant factors, and the rest; what all terms of a bracket share is a
    factor.
    """
    number, outside, inside = Fraction(1), list[ex.Expression](), list[ex.Expression]()
    for factor in ex.factors_of(term):
        if isinstance(factor, ex.Number):
            number *= factor.value
        elif _is_constant(factor, constants):
            outside.append(factor)
        elif isinstance(factor, ex.Sum):
            shared, rest = _shared_constants(factor, constants)
            outside += shared
            inside.append(rest)
        else:
            inside.append(factor)
    return SharedFactors(number, outside, ex.multiply(*inside))


def _shared_constants(
    tree: ex.Sum, constants: Collection[ex.Expression]
) -> tuple[list[ex.Expression], ex.Expression]:
    """m and u'^2 + v'^2 of m u'^2 + m v'^2."""
    powers = [
        {base: e for base, e in ex.powers_of(term) if base in constants} for term in tree.terms
    ]
    common = {
        base: e for base, e in powers[0].items() if all(other.get(base) == e for other in powers)
    }
    if not common:
        return [], tree
    rest = [
        ex.multiply(*(b**e for b, e in ex.powers_of(term) if b not in common))
        for term in tree.terms
    ]
    return [base**e for base, e in common.items()], ex.add(*rest)


def _is_constant(tree: ex.Expression, constants: Collection[ex.Expression]) -> bool:
    leaves = [
        node for node in ex.walk(tree) if isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary)
    ]
    return bool(leaves) and all(node in constants for node in leaves)


def degree(tree: ex.Expression, letters: Collection[ex.Expression]) -> int | None:
    """The degree of a polynomial of the letters; None for anything else."""
    if not ex.holds(tree, *letters):
        return 0
    match tree:
        case ex.Symbol() | ex.Velocity():
            return 1
        case ex.Sum(terms):
            found = [degree(term, letters) for term in terms]
            return None if None in found else max(filter(None, found))
        case ex.Product(factors):
            degrees = [degree(factor, letters) for factor in factors]
            return None if None in degrees else sum(filter(None, degrees))
        case ex.Power(base, ex.Number(value)) if value.denominator == 1 and value > 0:
            inner = degree(base, letters)
            return None if inner is None else inner * int(value)
    return None
