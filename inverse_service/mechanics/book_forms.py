"""Formulas as books write them: brackets and logarithms.

m (r'^2 + r^2 phi'^2)/2 for two terms with the factor m/2: identities of the field of fractions.
Then one logarithm of a quotient, upright, without exponentials in both of its halves: each step
holds wherever the tree before it is defined; the tree after it may be defined on more.
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


# Logarithms.


def in_one_logarithm(tree: ex.Expression) -> ex.Expression:
    """c log(a^2/b)/2 for c log a - c log b/2: logarithms in a sum with opposite coefficients.

    Coefficients are products of one factor and numbers; the smaller number stays outside.
    """
    tree = ex.rebuild(tree, in_one_logarithm)
    if not isinstance(tree, ex.Sum):
        return tree
    groups: dict[object, tuple[ex.Expression, list[tuple[Fraction, ex.Expression]]]] = {}
    others = list[ex.Expression]()
    for term in map(collecting.merge_powers, tree.terms):
        factors = ex.factors_of(term)
        logs = [f for f in factors if isinstance(f, ex.Apply) and f.function == "log"]
        if len(logs) == 1:
            rest = [f for f in factors if f is not logs[0] and not isinstance(f, ex.Number)]
            _, alike = groups.setdefault(frozenset(rest), (ex.multiply(*rest), []))
            alike.append((ex.coefficient(term), logs[0].argument))
        else:
            others.append(term)
    found = list[ex.Expression]()
    for outside, parts in groups.values():
        signs = {number > 0 for number, _ in parts}
        share = min(abs(number) for number, _ in parts)
        powers = [(argument, number / share) for number, argument in parts]
        if len(signs) == 2 and all(power.denominator == 1 for _, power in powers):
            whole = ex.multiply(*(argument**power for argument, power in powers))
            found.append(ex.number(share) * outside * ex.Apply("log", whole))
        else:
            found += [number * outside * ex.Apply("log", argument) for number, argument in parts]
    return ex.add(*found, *others) if len(found) + len(others) < len(tree.terms) else tree


def with_inverse_sines(tree: ex.Expression) -> ex.Expression:
    """asinh(u) for log(u + sqrt(u^2 + 1)), which is equal for every real u."""
    tree = ex.rebuild(tree, with_inverse_sines)
    match tree:
        case ex.Apply("log", ex.Sum((_, _) as both)):
            for u, root in (both, both[::-1]):
                match root:
                    case ex.Power(square, ex.Number(half)) if half == Fraction(1, 2) and (
                        collecting.collect(square - u**2 - ex.ONE) == ex.ZERO
                    ):
                        return ex.Apply("asinh", u)
    return tree


def upright(tree: ex.Expression) -> ex.Expression:
    """log(b/a) for -log(a/b), and c for exp(-u) c/(p - exp(-u) q) times exp(u) above and below."""
    tree = ex.rebuild(tree, upright)
    match tree:
        case ex.Apply("log", argument):
            return ex.Apply("log", _without_exponentials(argument))
        case ex.Product() if ex.coefficient(tree) < 0:
            for factor in ex.factors_of(tree):
                match factor:
                    case ex.Apply("log", ex.Product() | ex.Power() as quotient) if _is_divided(
                        quotient
                    ):
                        rest = ex.multiply(*(f for f in ex.factors_of(tree) if f is not factor))
                        return ex.negated(rest) * ex.Apply("log", _inverted(quotient))
    return tree


def _is_divided(quotient: ex.Expression) -> bool:
    return any(exponent < 0 for _, exponent in ex.powers_of(quotient))


def _inverted(quotient: ex.Expression) -> ex.Expression:
    return ex.multiply(*(_power(base, -e) for base, e in ex.powers_of(quotient)))


def _power(base: ex.Expression, exponent: Fraction) -> ex.Expression:
    match base:
        case ex.Apply("exp", argument):
            return ex.Apply("exp", exponent * argument)
        case _:
            return base**exponent


def _without_exponentials(quotient: ex.Expression) -> ex.Expression:
    """a/(exp(u) p - b) for exp(-u) a/(p - exp(-u) b)."""
    factors = ex.factors_of(quotient)
    for factor in factors:
        match factor:
            case ex.Apply("exp", argument):
                rest = [f for f in factors if f is not factor]
                for place, other in enumerate(rest):
                    match other:
                        case ex.Power(ex.Sum(terms), ex.Number(value)) if value == -1 and any(
                            factor in ex.factors_of(term) for term in terms
                        ):
                            grown = ex.add(
                                *(
                                    ex.multiply(*(f for f in ex.factors_of(term) if f != factor))
                                    if factor in ex.factors_of(term)
                                    else ex.Apply("exp", -argument) * term
                                    for term in terms
                                )
                            )
                            rest[place] = grown**-1
                            return ex.multiply(*rest)
    return quotient
