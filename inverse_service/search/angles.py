"""Write sums of products of sines and cosines in their shortest form.

The candidates for a polynomial in cos u, sin u, cos w, … are the polynomial itself, sin^2 in place of 1 - cos^2 in one
of the angles, and a sum of sines and cosines of sums of angles (cos(u - w) for cos u cos w + sin u sin w).
"""

import math
from fractions import Fraction
from functools import lru_cache

from inverse_service.expressions import tree as ex
from inverse_service.search import terms as tm

# p^2 = a + b q^2 for the pairs of functions p, q of one argument.
SQUARES = {"sin": ("cos", 1, -1), "cos": ("sin", 1, -1), "sinh": ("cosh", -1, 1), "cosh": ("sinh", 1, 1)}
# The largest power of one function that is expanded in multiple angles, and the largest number of waves per product.
_POWERS, _WAVES = 4, 256


def shortest(terms: tm.Terms) -> tm.Terms:
    """The form with the fewest terms; the given form if it has as few."""
    best = terms
    try:
        waves = _halved(by_multiple_angles(terms))
    except tm.TooManyTerms:
        waves = terms
    if 2 * len(waves) <= len(terms):
        return waves
    try:
        letters = sorted({p for key in terms for p, _ in key if isinstance(p, ex.Apply)}, key=repr)
        for name, argument in dict.fromkeys((name, p.argument) for p in letters for name in _with_partner(p.function)):
            other = _exchanged(best, name, argument)
            best = other if _length(other) < _length(best) else best
    except tm.TooManyTerms:
        return best
    return waves if _length(waves) < _length(best) else best


def _with_partner(function: str) -> tuple[str, ...]:
    return (function, SQUARES[function][0]) if function in SQUARES else ()


def _length(terms: tm.Terms) -> tuple[int, int]:
    return len(terms), sum(len(key) for key in terms)


def _arguments(terms: tm.Terms) -> list[ex.Expression]:
    return [p.argument for key in terms for p, _ in key if isinstance(p, ex.Apply) and p.function in ("sin", "cos")]


def _exchanged(terms: tm.Terms, old: str, argument: ex.Expression) -> tm.Terms:
    """The terms with 1 - sin^2 for cos^2 in one angle, 1 - cos^2 for sin^2, or likewise for hyperbolic functions."""
    new, constant, factor = SQUARES[old]
    letter, square = ex.Apply(old, argument), tm.times(tm.EMPTY, tm.monomial(ex.Apply(new, argument)), 2)
    parts = list[tm.Terms]()
    for key, value in terms.items():
        e = dict(key).get(letter, Fraction(0))
        half = int(e) // 2 if e.denominator == 1 and e >= 2 else 0
        part: tm.Terms = {tm.times(key, tm.monomial(letter), -2 * half) if half else key: value}
        for _ in range(half):
            part = tm.multiply_terms(part, {tm.EMPTY: Fraction(constant), square: Fraction(factor)})
        parts.append(part)
    return tm.sum_of(parts)


def _halved(waves: tm.Terms) -> tm.Terms:
    """The terms with 1 - 2 sin^2 u or 2 cos^2 u - 1 for cos 2u wherever that gives fewer terms."""
    for double in dict.fromkeys(p for key in waves for p, _ in key if isinstance(p, ex.Apply) and p.function == "cos"):
        halves = {key: value / 2 for key, value in tm.terms_of(double.argument).items()}
        if any(value.denominator > 1 for value in halves.values()):
            continue
        for name, unit in (("sin", 1), ("cos", -1)):
            square = tm.times(frozenset(), tm.monomial(ex.Apply(name, tm.tree_of(halves))), 2)
            held: tm.Terms = {key: value for key, value in waves.items() if (double, Fraction(1)) in key}
            other = tm.add_terms(waves, held, -1)
            for extra, factor in ((frozenset(), unit), (square, -2 * unit)):
                rest = {tm.times(key - {(double, Fraction(1))}, extra): value for key, value in held.items()}
                other = tm.add_terms(other, rest, factor)
            waves = other if _length(other) < _length(waves) else waves
    return waves


def by_multiple_angles(terms: tm.Terms) -> tm.Terms:
    """The terms with products of sines and cosines expanded into sines and cosines of sums of angles."""
    parts = list[tuple[tm.Terms, Fraction]]()
    for key, value in terms.items():
        circular: tm.Monomial = frozenset(
            (p, e)
            for p, e in key
            if isinstance(p, ex.Apply) and p.function in ("sin", "cos") and e.denominator == 1 and 0 < e <= _POWERS
        )
        parts += [({tm.times(key - circular, letter): factor}, value) for letter, factor in _in_waves(circular)]
    return tm.weighted_sum(parts)


@lru_cache(maxsize=1024)
def _in_waves(circular: tm.Monomial) -> tuple[tuple[tm.Monomial, Fraction], ...]:
    """The expansion of a product of sines and cosines: cos u cos w = (cos(u - w) + cos(u + w))/2, and so on.

    Raises TooManyTerms for more than _WAVES; n angles, each squared, have about 3^n.
    """
    functions = sorted((p for p, _ in circular if isinstance(p, ex.Apply)), key=repr)
    angles = list(dict.fromkeys(p.argument for p in functions))
    # cos or sin of sum_k n_k angles_k, by name and n.
    waves = {("cos", (0,) * len(angles)): Fraction(1)}
    exponents = dict(circular)
    degrees = [sum(exponents[p] for p in functions if p.argument == angle) for angle in angles]
    if math.prod(1 + degree for degree in degrees) > _WAVES:
        raise tm.TooManyTerms
    for p in functions:
        place = angles.index(p.argument)
        for _ in range(int(exponents[p])):
            product: dict[tuple[str, tuple[int, ...]], Fraction] = {}
            for (name, turns), factor in waves.items():
                same, half = name == p.function, factor / 2
                for turn, odd in ((1, name == "sin" if same else False), (-1, False if same else name == "cos")):
                    wave = "cos" if same else "sin", (*turns[:place], turns[place] + turn, *turns[place + 1 :])
                    product[wave] = product.get(wave, Fraction(0)) + (-half if odd else half)
            waves = product
    sums, parts = [tm.terms_of(angle) for angle in angles], list[tuple[tm.Terms, Fraction]]()
    for (name, turns), factor in waves.items():
        argument = tm.weighted_sum((angle, turn) for turn, angle in zip(turns, sums, strict=True) if turn)
        shown = ex.Apply(name, tm.tree_of(argument)) if argument else ex.number(int(name == "cos"))
        parts.append((tm.terms_of(shown), factor))
    return tuple(tm.weighted_sum(parts).items())


@lru_cache(maxsize=512)
def with_sums_of_angles(tree: ex.Expression) -> ex.Expression:
    """The tree with each sum of functions of several angles in its shortest form; cos(a - b) is kept."""
    tree = ex.rebuild(tree, with_sums_of_angles)
    match tree:
        case ex.Power(ex.Sum(parts) as base, ex.Number(e)) if e.denominator == 1 and all(map(_has_minus, parts)):
            return (ex.ONE if e % 2 == 0 else ex.MINUS_ONE) * ex.negated(base) ** e
    if not isinstance(tree, ex.Sum):
        return tree
    try:
        terms = tm.terms_of(tree)
        short = shortest(terms) if len(set(_arguments(terms))) > 1 else terms
        forms = [tree, tm.tree_of(short), _by_letters(short)]
    except tm.TooManyTerms:
        return tree
    return min(forms, key=ex.node_count)


def _by_letters(terms: tm.Terms) -> ex.Expression:
    """The sum, grouped by products of functions and velocities, with common factors taken out of each coefficient."""
    parts = []
    for outer, inner in tm.grouped(terms, lambda letter: not isinstance(letter, ex.Symbol)).items():
        content, common, rest = tm.split_content(inner)
        if len(inner) > 1 and all(value < 0 for value in inner.values()):
            content, rest = -content, ex.negated(rest)
        parts.append(content * tm.monomial_tree(common) * rest * tm.monomial_tree(outer))
    return ex.add(*parts)


def _has_minus(term: ex.Expression) -> bool:
    first = ex.factors_of(term)[0]
    return isinstance(first, ex.Number) and first.value < 0
